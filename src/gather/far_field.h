// The far field that the packets of a cluster share: drawn once for all, a packet in a lane of a
// raster, as seen from the packet's centre. Receivers beside the centre see it to first order, by
// what the packets around see. docs/algorithm.md, "The shared far field".
#pragma once

#include <hwy/aligned_allocator.h>

#include <cstddef>

#include "gather/gather_rules.h"
#include "gather/packet_cluster.h"
#include "gather/packet_kernel.h"
#include "gather/packet_raster.h"

namespace surfeit {

// One thread at a time. Takes memoryBytes().
class FarField {
 public:
  FarField(const GatherRules& rules, const PacketKernel& kernel);

  static std::size_t memoryBytes(const GatherRules& rules);

  // What the packets of the cluster share goes in here and is drawn, then finish() takes it.
  PacketRaster& raster() { return raster_; }
  void finish(const PacketCluster& cluster);

  // What packet i of that cluster sees.
  SharedFarField of(const PacketCluster& cluster, std::size_t i) const;

 private:
  void findSlopes(const PacketCluster& cluster);

  PacketRaster raster_;
  FarFieldSlopes slopes_;
  hwy::AlignedFreeUniquePtr<FarPixel[]> pixels_;
};

}  // namespace surfeit
