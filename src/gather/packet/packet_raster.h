// The rasters of a packet of receivers side by side: 16 raster cubes interleaved by pixel, so that
// a footprint of a few pixels is a few vector operations for all receivers at once. Collects what
// the packet's cut gives, sorts it by distance from the packet's centre, draws it front to back and
// integrates (memo 3.4 and 3.5).
//
// docs/algorithm.md tells what the lanes share ("Packets") and how contributions cover pixels
// ("Coverage").
#pragma once

#include <hwy/aligned_allocator.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>
#include <span>
#include <vector>

#include "gather/cut/cut.h"
#include "gather/cut/instance_tree.h"
#include "gather/packet/packet_kernel.h"
#include "gather/packet/pixel_record.h"
#include "gather/rules/contribution.h"
#include "gather/rules/raster_geometry.h"
#include "gather/rules/receiver.h"
#include "octree/node/lobe.h"
#include "octree/node/node.h"
#include "surfeit/gather.h"
#include "surfeit/surfel.h"

namespace surfeit {

// One thread at a time. Room for kReservedPatches is there from the start, far more than cuts with
// a sensible max solid angle have. It grows for the most demanding packet so far and is kept, so
// that a steady state does not allocate. With a max solid angle of 0 every surfel above the horizon
// contributes, and that memory is the caller's to budget.
class PacketRaster {
 public:
  static constexpr std::size_t kReservedPatches = 4096;
  static constexpr std::size_t kReservedParts = 1024;    // of what fades
  static constexpr std::size_t kReservedLights = 1024;   // of what is glossy, or curved
  static constexpr std::size_t kReservedEntries = 8192;  // of the order

  // `rules` must be valid, as gatherCloud checks them: even resolution within its limits, the rest
  // neither negative nor NaN.
  explicit PacketRaster(const GatherRules& rules,
                        const PacketKernel& kernel = fastestPacketKernel());
  PacketRaster(const PacketRaster&) = delete;
  PacketRaster& operator=(const PacketRaster&) = delete;

  // Starts over for 1 to kPacketReceivers receivers.
  void begin(std::span<const LocalReceiver> receivers, const PacketView& view);
  // What is added next is in the frame of an instance; null, as at first: in that of the receivers.
  void setFrame(const InstanceFrame* frame);
  // Adds a node as a whole. All receivers must lie outside its radius.
  // `parts`: how much it counts for each receiver; null: wholly. `lobes`: null: it has none.
  void addNode(const Node& node, const LaneParts* parts = nullptr,
               const NodeLobes* lobes = nullptr);
  // Adds a patch as it is, in the frame of the receivers.
  void addPatch(const Patch& patch);
  // Adds the hull of a node that is looked into, for what is below it leaves gaps, for receivers
  // that see no hull of a node above it.
  OpenedNode addHull(const Node& node, const LaneParts* parts = nullptr,
                     const OpenedNode& parent = {});
  // Adds those of the surfels that some receiver may see. `lobes`: as many, or none.
  void addSurfels(std::span<const Surfel> surfels, const LaneParts* parts = nullptr,
                  std::span<const Lobe> lobes = {});

  // Sorts what was added, and draws it.
  void sort();
  void draw();

  // One result per receiver.
  void integrate(std::span<GatherResult> results);

  // Whether something of what was added lets colors through differently: then what was drawn holds
  // for one color alone (docs/algorithm.md, "Tints").
  bool hasTints() const { return has_tints_; }
  // The color, 0 to 2, whose opacities count in what is added from now on; at first red.
  void setColor(int color) { color_ = color; }
  // Instead of integrate(): the part of that color in the results; the colors come in their order.
  void integrateColor(std::span<GatherResult> results);

  std::size_t patchCount() const { return patches_.size(); }

  // Tells it from now on what every pixel of the first receiver gets; null, as at first: nobody. It
  // must outlive the drawing.
  void setRecorder(PixelRecorder* recorder) { recorder_ = recorder; }
  const RasterGeometry& geometry() const { return geometry_; }
  // After drawing, what the first receiver has in its pixels, as many as the geometry has.
  void readPixels(std::span<PixelContent> pixels) const;
  // Patches of surfels so near to the packet's centre that they are ray traced at least in part.
  std::size_t tracedCount() const;

  // Bytes that a raster of this quality holds from the start.
  static std::size_t memoryBytes(const GatherRules& rules);

 private:
  static constexpr std::uint32_t kAllLanes = (1u << kPacketReceivers) - 1;

  bool turnsAway(const glm::vec3& position, const glm::vec3& normal) const;
  std::uint32_t keepParts(const LaneParts* parts);
  template <typename SeenOf>
  bool keepSeenParts(const SeenOf& seenOf, const LaneParts* parts, std::uint32_t& place);
  // Adds a facet of the node, or all of a flat one, or the hull of that alone.
  void addFacet(const Node& node, const Facet& facet, bool is_hull, std::uint32_t parts,
                const Lobe* lobe, const RadiositySlope& slope);
  bool mayLeaveHull(const Node& node) const;
  std::uint32_t lanesBeyond(const glm::vec3& position, float distance) const;
  // Adds a hull for those of these lanes that see it, and says which need no other.
  std::uint32_t addFacetHull(const Node& node, const Facet& facet, const LaneParts* parts,
                             std::uint32_t lanes);
  void addLobe(const Lobe& lobe, const glm::vec3& normal);
  // Whether all receivers see a thing there as the centre does.
  bool isSharedLook(const glm::vec3& world_place) const {
    return view_.radius <= kFidelity.shared_look * glm::distance(world_place, view_.centre);
  }
  void addSlope(const RadiositySlope& slope, float range);
  void addRoughNode(const Node& node, const LaneParts* lane_parts, std::uint32_t parts);
  void addRoughNode(const Node& node, const glm::vec3& eye, std::uint32_t parts);
  glm::vec3 toWorld(const glm::vec3& place) const {
    return frame_ != nullptr ? frame_->toWorld(place) : place;
  }
  glm::vec3 toLocal(const glm::vec3& place) const {
    return frame_ != nullptr ? frame_->toLocal(place) : place;
  }
  // Of a receiver, in the world.
  glm::vec3 eye(std::size_t i) const { return {lanes_.x[i], lanes_.y[i], lanes_.z[i]}; }
  void bringToWorld(Patch& patch) const;
  void orderLastPatch(const PacketCanvas& canvas);
  PacketCanvas canvas() const;

  const PacketKernel& kernel_;
  const GatherRules rules_;
  const float near_disk_radii_, near_sphere_radii_;
  float max_distance_sq_;
  RasterGeometry geometry_;
  DirectionWeights weights_;
  hwy::AlignedFreeUniquePtr<float[]> pixels_;
  mutable std::array<bool, RasterGeometry::kFaces> is_face_used_{};

  PacketLanes lanes_;
  PacketLanes centre_lane_{};  // the centre, in every lane
  std::size_t receiver_count_ = 0;
  SeenPixels seen_;
  std::uint32_t seen_faces_ = 0;  // set of those with pixels that count
  PacketView view_;
  PixelRecorder* recorder_ = nullptr;
  const InstanceFrame* frame_ = nullptr;
  glm::vec3 local_centre_{0};  // of the view, in the frame of what is added
  float local_radius_ = 0;
  int color_ = 0;
  bool has_tints_ = false;
  bool is_translucent_ = false;          // PacketCanvas::is_translucent
  glm::vec3 luminance_{0};               // PacketCanvas::luminance
  std::vector<PixelContent> of_colors_;  // with a recorder: what readPixels() tells of all colors
  std::vector<Patch> patches_;
  std::vector<PacketParts> parts_;
  std::vector<PacketLights> lights_;
  std::vector<std::uint64_t> order_;  // see draw_order; grows by doubling
  mutable std::vector<std::uint64_t> order_scratch_;
  std::size_t order_count_ = 0;
};

}  // namespace surfeit
