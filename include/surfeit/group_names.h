// Object groups by name: surfeit/index.h (IndexOptions::named) gives inputs names, the scene keeps
// them, and a gather may be asked for by them.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "surfeit/api.h"
#include "surfeit/status.h"

namespace surfeit {

// The name of an object group. Groups without one are known by their number.
struct GroupName {
  std::uint32_t group = 0;
  std::string name;
};

// Whether a group may have that name: 1 to 200 bytes, no comma, no control character, and no digit
// at the front, so that lists of names and numbers can be read. kInvalidArgument says what is
// wrong.
SURFEIT_API Status checkGroupName(std::string_view name);

// The names that a scene has for its groups, by rising number. Reads header and directory. Errors:
// kIoError, kCorruption.
SURFEIT_API Result<std::vector<GroupName>> readGroupNames(const std::string& scene_path);

// The set of groups that a list means, as parseGroups (surfeit/scene.h), where parts may be names:
// "lamp,5-7". kInvalidArgument tells the part that is neither, and the names that there are. Safe
// from any thread.
SURFEIT_API Result<std::uint64_t> parseGroupNames(std::string_view text,
                                                  const std::vector<GroupName>& names);

}  // namespace surfeit
