// The gather of a packet of neighbouring receivers from a paged octree: one traversal, one cut, one
// order front to back, and a raster cube per receiver in the lanes of vectors (memo, section 3).
#pragma once

#include <cstddef>
#include <span>

#include "gather/cut.h"
#include "gather/packet_raster.h"
#include "gather/receiver.h"
#include "octree/paged_octree.h"
#include "surfeit/gather.h"
#include "surfeit/status.h"

namespace surfeit {

// One thread at a time; make one per thread. For its memory see PacketRaster.
class PacketGatherer {
 public:
  // `quality` must be valid, as for PointGatherer.
  PacketGatherer(GatherMode mode, const GatherQuality& quality,
                 const PacketKernel& kernel = fastestPacketKernel());

  // Gathers at 1 to kPacketReceivers receivers, whose values must be finite; results are as many.
  // On an error (a page that cannot be read or decoded) the results are unchanged. They depend on
  // the scene, the packet, mode, quality and instruction set alone, bit for bit.
  Status gather(std::span<const Receiver> receivers, PagedOctree::Reader& octree,
                std::span<GatherResult> results);

  // What the last gather took, for benches and tests.
  struct Work {
    std::size_t nodes_visited = 0;
    std::size_t surfels_visited = 0;
    std::size_t patches = 0;  // drawn
    // CPU time by phase, seconds; measured only when asked for with measurePhases().
    double walk_seconds = 0, sort_seconds = 0, draw_seconds = 0, integrate_seconds = 0;
  };
  const Work& work() const { return work_; }
  void measurePhases(bool measures) { measures_phases_ = measures; }

  // Bytes that a gatherer holds from the start.
  static std::size_t memoryBytes(GatherMode mode, const GatherQuality& quality) {
    return sizeof(PacketGatherer) + PacketRaster::memoryBytes(mode, quality);
  }

 private:
  double phaseSeconds();

  PacketRaster raster_;
  CutWalk cut_;
  Work work_;
  bool measures_phases_ = false;
  double last_seconds_ = 0;
};

}  // namespace surfeit
