// References of nodes: what a page holds, and what it means in the file.
#pragma once

#include <cstdint>
#include <span>

#include "octree/node/node.h"
#include "octree/page/node_group.h"
#include "surfeit/status.h"

namespace surfeit {

// The level that a node page belongs to.
int levelOfPage(std::span<const std::uint32_t> level_first_page, std::uint32_t page);

// Turns stored references into global ones and checks that they point at something that exists.
// kCorruption names the field.
Status resolveReference(const NodeLimits& limits, int level, int child_level,
                        std::uint64_t stored_page, std::uint64_t first, Node& node);

}  // namespace surfeit
