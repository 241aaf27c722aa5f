// Sets of groups of surfels as users write and read them: "0,2-5".
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "octree/read/scene_file.h"
#include "surfeit/status.h"
#include "surfeit/surfel.h"

namespace surfeit {

// The groups of a set in rising order, runs of three or more as ranges; "none" for the empty set.
std::string describeGroups(std::uint64_t groups);

// The set that a list of groups and ranges means, separated by commas. kInvalidArgument tells the
// part that is neither, or that names a group beyond kMaxGroups - 1.
Result<std::uint64_t> parseGroups(std::string_view text);

// Whether these groups can be chosen from the scene. kCorruption when it has no groups,
// kInvalidArgument when none of these is there, with those that are; any scene has kAllGroups.
// Reads the first page of a scene with groups; errors as of decodeNodes.
Status checkGroups(const SceneFile& scene, std::uint64_t groups);

}  // namespace surfeit
