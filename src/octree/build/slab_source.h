// Where the slabs of a scene come from: cut from sorted surfels and built here, or built before, by
// another machine.
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "octree/build/slab.h"
#include "octree/build/slab_builder.h"
#include "octree/read/scene_file.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

// Slabs in order. Each has a number while it is on its way; numbers come again.
class SlabSource {
 public:
  virtual ~SlabSource() = default;
  // Brings the next slab, as number `work`; false at the end. One thread at a time.
  virtual Result<bool> fetch(std::size_t work) = 0;
  // Replaces `built` by the slab that was brought as `work`. From any thread.
  virtual Status build(std::size_t work, BuiltSlab& built) = 0;
};

class CutSlabs : public SlabSource {
 public:
  // Of numbers below `works`. The header says how pages are filled and stored.
  CutSlabs(SortedSurfelStream& stream, const SceneHeader& header, std::size_t works,
           const StreamEnds& ends = {})
      : cutter_(stream, ends), header_(header), slabs_(works) {}

  Result<bool> fetch(std::size_t work) override;
  Status build(std::size_t work, BuiltSlab& built) override;

 private:
  SlabCutter cutter_;
  const SceneHeader header_;
  std::vector<Slab> slabs_;
};

// Hands all slabs to `take`, in order, built by the threads of the current arena; fewer than
// `works` are on their way at a time. kInterrupted when cancelled.
using SlabTaker = std::function<Status(const BuiltSlab& slab)>;
Status buildSlabs(SlabSource& source, std::size_t works, const SlabTaker& take, Progress& progress);

}  // namespace surfeit
