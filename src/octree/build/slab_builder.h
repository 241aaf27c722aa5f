// What a thread makes of a slab by itself: encoded surfel pages, and the octree of each brick.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "octree/build/cell_sweep.h"
#include "octree/build/slab.h"
#include "octree/page/encoded_pages.h"
#include "octree/read/scene_file.h"

namespace surfeit {

// A built slab. Leaves refer to surfel pages by their number in the slab, interior nodes to the
// children by the number of the sibling group in the slab.
struct BuiltSlab {
  struct Siblings {
    std::uint8_t level = 0, count = 0;
  };
  struct Root {
    FinishedNode node;
    int boundary_level = 0;
    std::size_t siblings_end = 0;  // sibling groups of this brick and those before
  };
  EncodedPages surfel_pages;
  std::size_t surfel_count = 0;
  std::vector<LevelNode> nodes;  // sibling group after sibling group, in the order of closing
  std::vector<Siblings> siblings;
  std::vector<Root> roots;  // by brick
  std::optional<GiantPiece> giant;

  void clear();
};

// Builds a slab into `built` (replaced, its memory used again); `header` says how pages are filled
// and stored. Safe from any thread.
Status buildSlab(const Slab& slab, const SceneHeader& header, BuiltSlab& built);

}  // namespace surfeit
