#include "gather/packet_raster.h"

#include <algorithm>
#include <bit>
#include <glm/geometric.hpp>
#include <limits>
#include <new>
#include <utility>

#include "core/assert.h"

namespace surfeit {
namespace {

// Sorts by the upper 32 bits of keys that are below 2^63, stable: a radix sort of 11 bits a pass.
// `order` is replaced, `scratch` gets its size.
void sortByUpperHalf(std::vector<std::uint64_t>& order, std::vector<std::uint64_t>& scratch) {
  constexpr int kBits = 11, kPasses = 3;
  constexpr std::size_t kBuckets = std::size_t{1} << kBits;
  const auto digit = [](std::uint64_t key, int pass) {
    return std::size_t(key >> (32 + pass * kBits)) & (kBuckets - 1);
  };
  std::array<std::array<std::uint32_t, kBuckets>, kPasses> begin{};
  for (const std::uint64_t key : order) {
    for (int pass = 0; pass < kPasses; ++pass) ++begin[std::size_t(pass)][digit(key, pass)];
  }
  scratch.resize(order.size());
  for (int pass = 0; pass < kPasses; ++pass) {
    std::uint32_t sum = 0;
    for (std::uint32_t& count : begin[std::size_t(pass)]) sum += std::exchange(count, sum);
    for (const std::uint64_t key : order) {
      scratch[begin[std::size_t(pass)][digit(key, pass)]++] = key;
    }
    order.swap(scratch);
  }
}

}  // namespace

PacketRaster::PacketRaster(GatherMode mode, const GatherQuality& quality,
                           const PacketKernel& kernel)
    : kernel_(kernel),
      quality_(quality),
      rules_{quality.sides, mode == GatherMode::kBleeding},
      max_distance_sq_(quality.max_distance < 1e19f ? quality.max_distance * quality.max_distance
                                                    : std::numeric_limits<float>::infinity()),
      geometry_(quality.raster_resolution),
      pixels_(hwy::AllocateAligned<float>(geometry_.pixels().size() *
                                          PacketCanvas::pixelFloats(rules_.has_color))) {
  if (pixels_ == nullptr) throw std::bad_alloc();
  patches_.reserve(kReservedPatches);
  order_.reserve(kReservedPatches);
  order_scratch_.reserve(kReservedPatches);
}

void PacketRaster::begin(std::span<const Receiver> receivers, const PacketView& view) {
  SURFEIT_ASSERT(!receivers.empty() && receivers.size() <= kPacketReceivers);
  view_ = view;
  for (std::size_t i = 0; i < kPacketReceivers; ++i) {
    const Receiver& receiver = receivers[std::min(i, receivers.size() - 1)];
    lanes_.x[i] = receiver.position.x;
    lanes_.y[i] = receiver.position.y;
    lanes_.z[i] = receiver.position.z;
    lanes_.normal_x[i] = receiver.normal.x;
    lanes_.normal_y[i] = receiver.normal.y;
    lanes_.normal_z[i] = receiver.normal.z;
    lanes_.spherical[i] = receiver.isSpherical() ? 1 : 0;
  }
  is_face_used_.fill(false);
  patches_.clear();
  order_.clear();
}

// Distances are positive, and positive floats sort like their bits.
void PacketRaster::addPatch(const Patch& patch, float distance_sq) {
  SURFEIT_CHECK(patches_.size() < std::numeric_limits<std::uint32_t>::max());
  order_.push_back(std::uint64_t{std::bit_cast<std::uint32_t>(distance_sq)} << 32 |
                   patches_.size());
  patches_.push_back(patch);
}

void PacketRaster::addNode(const Node& node) {
  const glm::vec3 to_node = node.position - view_.centre;
  Patch patch;
  patch.position = node.position;
  patch.radius = node.radius;
  patch.normal = node.flatness * node.normal;
  patch.most_area = std::min(node.area, kPi * node.radius * node.radius);
  if (node.isFlat()) {
    patch.kind = rules_.sides == GatherSides::kBoth ? PatchKind::kDarkBack : PatchKind::kFront;
    patch.area = node.area;
    patch.radiosity = node.radiosity;
  } else {
    Contribution seen;
    if (!makeContribution(node, to_node, rules_, seen)) return;
    patch.kind = PatchKind::kRound;
    patch.area = seen.solid_angle * seen.distance_sq;
    patch.radiosity = seen.radiosity;
  }
  addPatch(patch, glm::dot(to_node, to_node));
}

void PacketRaster::addSurfels(std::span<const Surfel> surfels) {
  const PacketCanvas canvas = this->canvas();
  for (const Surfel& surfel : surfels) {
    Patch patch;
    patch.position = surfel.position;
    patch.radius = surfel.radius;
    patch.normal = surfel.normal;
    patch.area = patch.most_area = surfel.area;
    patch.radiosity = surfel.radiosity;
    patch.kind = surfel.isSphere()                    ? PatchKind::kRound
                 : surfel.isTwoSided()                ? PatchKind::kTwoSided
                 : rules_.sides == GatherSides::kBoth ? PatchKind::kDarkBack
                                                      : PatchKind::kFront;
    // Positive, for a surfel may be at a receiver; then it is near at any setting
    patch.near_distance =
        std::max(quality_.near_field_radii * surfel.radius, std::numeric_limits<float>::min());
    if (!kernel_.isSeen(canvas, patch)) continue;
    const glm::vec3 to_surfel = surfel.position - view_.centre;
    addPatch(patch, glm::dot(to_surfel, to_surfel));
  }
}

PacketCanvas PacketRaster::canvas() {
  return {.lanes = &lanes_,
          .geometry = &geometry_,
          .has_color = rules_.has_color,
          .bias = quality_.bias,
          .max_distance_sq = max_distance_sq_,
          .centre = view_.centre,
          .packet_radius = view_.radius,
          .pixels = pixels_.get(),
          .is_face_used = &is_face_used_};
}

void PacketRaster::sort() { sortByUpperHalf(order_, order_scratch_); }

void PacketRaster::draw() { kernel_.draw(canvas(), patches_.data(), order_); }

void PacketRaster::integrate(std::span<GatherResult> results) {
  kernel_.integrate(canvas(), results);
}

std::size_t PacketRaster::memoryBytes(GatherMode mode, const GatherQuality& quality) {
  const std::size_t pixel_bytes =
      sizeof(RasterGeometry::Pixel) +
      PacketCanvas::pixelFloats(mode == GatherMode::kBleeding) * sizeof(float);
  return sizeof(PacketRaster) +
         RasterGeometry::pixelCount(quality.raster_resolution) * pixel_bytes +
         kReservedPatches * (sizeof(Patch) + 2 * sizeof(std::uint64_t));
}

}  // namespace surfeit
