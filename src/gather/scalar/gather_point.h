// The gather of one receiver from a paged octree: chooses the cut by solid angle and hands it to
// the raster (memo, section 3). This scalar code is the definition that faster gathers are held to.
#pragma once

#include <cstddef>

#include "gather/cut/cut.h"
#include "gather/scalar/receiver_raster.h"
#include "octree/read/paged_octree.h"
#include "surfeit/bake.h"
#include "surfeit/status.h"

namespace surfeit {

// One thread at a time; make one per thread. For its memory see ReceiverRaster.
class PointGatherer {
 public:
  // `rules` must be valid, as gatherCloud checks them: even resolution within its limits, the rest
  // neither negative nor NaN.
  explicit PointGatherer(const GatherRules& rules);
  PointGatherer(GatherMode mode, const GatherQuality& quality)
      : PointGatherer(GatherRules(mode, quality)) {}

  // Gathers at `receiver`, whose values must be finite. On an error (a page that cannot be read or
  // decoded) `result` is unchanged. The result depends on the scene, the receiver, mode and quality
  // alone, bit for bit.
  Status gather(const LocalReceiver& receiver, PagedOctree::Reader& octree, GatherResult& result);

  // ReceiverRaster::setRecorder, and what the last gather drew.
  void setRecorder(PixelRecorder* recorder) { raster_.setRecorder(recorder); }
  const ReceiverRaster& raster() const { return raster_; }

  // What the last gather took, for benches and tests.
  struct Work {
    std::size_t nodes_visited = 0;
    std::size_t surfels_visited = 0;
    std::size_t contributions = 0;
    std::size_t near_surfels = 0;
  };
  const Work& work() const { return work_; }
  // Bytes that a gatherer holds from the start; more only for cuts larger than ReceiverRaster
  // reserves, which max_solid_angle = 0 may ask for.
  static std::size_t memoryBytes(const GatherQuality& quality) {
    return sizeof(PointGatherer) + ReceiverRaster::memoryBytes(quality);
  }

 private:
  const GatherRules rules_;
  ReceiverRaster raster_;
  CutWalk cut_;
  Work work_;
};

}  // namespace surfeit
