// The rasters of a packet of receivers side by side: 16 raster cubes interleaved by pixel, so that
// a footprint of a few pixels is a few vector operations for all receivers at once. Collects what
// the packet's cut gives, sorts it by distance from the packet's centre, draws it front to back and
// integrates (memo 3.4 and 3.5).
//
// Each lane is the raster of one receiver by the rules of ReceiverRaster, which is the definition;
// what the lanes share is the cut and the order. A rough node is seen from the packet's centre.
#pragma once

#include <hwy/aligned_allocator.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "gather/contribution.h"
#include "gather/cut.h"
#include "gather/packet_kernel.h"
#include "gather/raster_cube.h"
#include "gather/receiver.h"
#include "octree/node.h"
#include "surfeit/gather.h"
#include "surfeit/surfel.h"

namespace surfeit {

// One thread at a time. Has room for kReservedPatches from the start; for what grows beyond, see
// ReceiverRaster.
class PacketRaster {
 public:
  static constexpr std::size_t kReservedPatches = 4096;
  static constexpr std::size_t kReservedEntries = 8192;  // of the order

  // `rules` must be valid, as for PointGatherer.
  explicit PacketRaster(const GatherRules& rules,
                        const PacketKernel& kernel = fastestPacketKernel());
  PacketRaster(const PacketRaster&) = delete;
  PacketRaster& operator=(const PacketRaster&) = delete;

  // Starts over for 1 to kPacketReceivers receivers. What they see is looked at as well from places
  // of which the horizon differs by `horizon_slack`, the sine of an angle.
  void begin(std::span<const Receiver> receivers, const PacketView& view, float horizon_slack = 0);
  // Adds a node as a whole. All receivers must lie outside its radius.
  void addNode(const Node& node);
  // Adds those of the surfels that are of the region and that some receiver may see.
  void addSurfels(std::span<const Surfel> surfels, const CutRegion& region);

  // Sorts what was added, and draws it.
  void sort();
  void draw();

  // Makes what was drawn a far field for others: lane i for a packet around receiver i.
  void finishFarField();
  // One result per receiver. `far`: the raster whose lane has what is behind, at least
  // `far_distance` away; or null.
  void integrate(std::span<GatherResult> results, const PacketRaster* far = nullptr,
                 std::size_t far_lane = 0, float far_distance = 0);

  std::size_t patchCount() const { return patches_.size(); }

  // Bytes that a raster of this quality holds from the start.
  static std::size_t memoryBytes(const GatherRules& rules);

 private:
  bool turnsAway(const glm::vec3& position, const glm::vec3& normal) const;
  void addFacet(const Facet& facet);
  void addRoughNode(const Node& node);
  void orderLastPatch();
  PacketCanvas canvas() const;

  const PacketKernel& kernel_;
  const GatherRules rules_;
  const float near_field_radii_;
  float max_distance_sq_;
  RasterGeometry geometry_;
  DirectionWeights weights_;
  hwy::AlignedFreeUniquePtr<float[]> pixels_, thickets_, fill_scratch_;
  mutable std::array<bool, RasterGeometry::kFaces> is_face_used_{};

  PacketLanes lanes_;
  SeenPixels seen_;
  PacketView view_;
  std::vector<Patch> patches_;
  bool has_thickets_ = false;                         // among patches_
  std::vector<std::uint64_t> order_, order_scratch_;  // see draw_order; grow by doubling
  std::size_t order_count_ = 0;
};

}  // namespace surfeit
