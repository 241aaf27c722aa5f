#include "octree/page/node_references.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/curve_key.h"

namespace surfeit {
namespace {

Status damaged(const char* field) {
  return Status::corruption(fmt::format("node group: damaged field {}", field));
}

}  // namespace

int levelOfPage(std::span<const std::uint32_t> level_first_page, std::uint32_t page) {
  const auto after = std::upper_bound(level_first_page.begin(), level_first_page.end(), page);
  return static_cast<int>(after - level_first_page.begin()) - 1;
}

Status resolveReference(const NodeLimits& limits, int level, int child_level,
                        std::uint64_t stored_page, std::uint64_t first, Node& node) {
  if (node.isLeaf()) {
    if (child_level != 0) return damaged("child level");
    if (stored_page >= limits.surfel_page_count || first >= limits.surfel_group_capacity ||
        node.surfel_count == 0) {
      return damaged("surfel reference");
    }
    // Only a leaf that begins a page may run over its end, and its pages must exist
    const std::uint64_t pages_after = limits.surfel_page_count - stored_page;
    if (node.surfel_count > pages_after * limits.surfel_group_capacity ||
        (first > 0 && node.surfel_count > limits.surfel_group_capacity - first)) {
      return damaged("surfel count");
    }
    node.page = static_cast<std::uint32_t>(stored_page);
  } else {
    if (child_level <= level || child_level > kCurveLevels) return damaged("child level");
    const std::uint64_t begin = limits.level_first_page[static_cast<std::size_t>(child_level)];
    const std::uint64_t end = limits.level_first_page[static_cast<std::size_t>(child_level) + 1];
    if (stored_page >= end - begin || node.child_count > 8 || node.child_count < 2 ||
        first > limits.node_group_capacity - node.child_count) {
      return damaged("child reference");
    }
    node.page = static_cast<std::uint32_t>(begin + stored_page);
  }
  node.first = static_cast<std::uint16_t>(first);
  return {};
}

}  // namespace surfeit
