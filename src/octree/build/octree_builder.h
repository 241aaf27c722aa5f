// Builds the octree bottom-up in one sweep over sorted surfels, slab by slab: threads build slabs,
// one stitches their octrees together and numbers pages, threads encode node pages, one writes.
// Nothing but the page directory grows with the cloud: slabs on their way, open cells, and an open
// node page per level.
// docs/architecture.md, "Building", explains the stages.
#pragma once

#include <cstdint>
#include <vector>

#include "octree/build/cell_sweep.h"
#include "octree/build/scene_writer.h"
#include "octree/build/slab_builder.h"
#include "octree/build/slab_source.h"
#include "octree/build/sorted_surfels.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

// Joins the octrees of slabs, in order. One thread at a time.
class SlabStitcher {
 public:
  explicit SlabStitcher(SceneWriter& writer)
      : writer_(writer), sweep_(writer, writer.header().flatness_limit) {}

  // Places the slab's nodes in the file and joins its roots to the tree.
  void add(BuiltSlab& slab);
  bool isComplete() const { return complete_; }

 private:
  void addGiantPiece(BuiltSlab& slab, BuiltSlab::Root& root);
  void resolve(LevelNode& node) const;
  void join(FinishedNode& node, int boundary_level);

  SceneWriter& writer_;
  CellSweep sweep_;
  std::uint32_t surfel_pages_ = 0;  // of all slabs before
  std::vector<GroupPlace> places_;  // of the slab's sibling groups
  FinishedNode giant_;              // pieces so far
  bool complete_ = false;
};

// What decides how much memory a slab takes once it is built.
struct SlabForm {
  std::uint32_t leaf_capacity = 16;
  bool full_precision = false;

  // At most, about: scenes have half of it or less.
  double nodesPerSurfel() const;
};

// Slabs on their way at a time: enough that stages do not wait for each other, and the fewest that
// keep the threads busy, for when memory is scarce.
constexpr std::size_t usualSlabs(int threads) {
  return static_cast<std::size_t>(threads) * 3 / 2 + 2;
}
constexpr std::size_t fewestSlabs(int threads) { return static_cast<std::size_t>(threads) + 1; }

// Takes every surfel of the stream and hands all pages to the writer, with the threads of the
// current arena; `slabs` bound what is on its way. kInterrupted when cancelled.
Status buildOctree(SortedSurfelStream& stream, SceneWriter& writer, std::size_t slabs,
                   Progress& progress);

// The same from slabs of any source.
Status stitchOctree(SlabSource& source, SceneWriter& writer, std::size_t slabs, Progress& progress);

// Memory that buildOctree takes at most, beside stream and writer.
std::uint64_t buildOctreeBytes(const SlabForm& form, int threads, std::size_t slabs);

}  // namespace surfeit
