// The scene fields of a .sft header: what is written and what is believed.
#pragma once

#include <cstddef>
#include <vector>

#include "io/file.h"
#include "octree/scene_file.h"
#include "surfeit/status.h"

namespace surfeit {

// The fields as docs/format.md, "Scene fields", lays them out.
std::vector<std::byte> encodeSceneHeader(const SceneHeader& header);

// Checks every field against what is possible and against the file's page counts. kCorruption
// names the field, but not the file.
Result<SceneHeader> decodeSceneHeader(Bytes fields, std::uint32_t node_page_count,
                                      std::uint32_t surfel_page_count);

}  // namespace surfeit
