// Builds the octree bottom-up in one sweep over sorted surfels, and hands its groups to a
// SceneWriter. Nothing grows with the cloud: open cells (one per level) and one open group per
// level. docs/architecture.md, "Building", explains the sweep.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec4.hpp>
#include <span>
#include <vector>

#include "core/curve_key.h"
#include "octree/node_sums.h"
#include "octree/scene_writer.h"
#include "octree/surfel_sorter.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

// One thread at a time.
class OctreeBuilder {
 public:
  explicit OctreeBuilder(SceneWriter& writer) : writer_(writer) {}

  // Takes every surfel of the stream and finishes the root. kInterrupted when cancelled.
  Status build(SortedSurfelStream& stream, Progress& progress);

 private:
  // A finished node that waits for its parent.
  struct Pending {
    LevelNode node;
    NodeSums sums;
  };
  // An octree cell whose last children have not come yet.
  struct OpenCell {
    int level = 0;
    int child_count = 0;
    std::array<Pending, 8> children;
  };

  Status refill(SortedSurfelStream& stream);
  // Surfels at the front of the window that make the next leaf; its cell must begin at or below
  // `boundary_level`, where it differs from the cell before. 0: more than a leaf holds share one
  // curve cell.
  std::size_t leafSize(int boundary_level) const;
  Status takeLeaf(std::size_t size, Pending& leaf);
  Status takeEqualKeys(SortedSurfelStream& stream, Pending& leaf);
  Status takeSurfels(std::size_t size, std::vector<glm::vec4>& disks, Pending& leaf);
  // Puts a finished node under the cell that it and the next one share, closing deeper cells.
  Status place(Pending node, int boundary_level);
  Result<Pending> closeCell(OpenCell& cell);

  SceneWriter& writer_;
  std::vector<SortedSurfel> window_;  // sorted surfels not yet in a leaf begin at at_
  std::size_t at_ = 0;
  bool stream_ended_ = false;
  std::vector<OpenCell> cells_;  // levels rise
  std::uint64_t surfels_taken_ = 0;
};

}  // namespace surfeit
