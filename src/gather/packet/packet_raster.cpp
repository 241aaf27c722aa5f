#include "gather/packet/packet_raster.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <new>
#include <utility>

#include "core/assert.h"
#include "core/long_side.h"
#include "core/ribbon.h"
#include "gather/packet/pixel_record.h"
#include "gather/rules/contribution.h"
#include "gather/rules/coverage_rules.h"
#include "gather/rules/layers.h"
#include "gather/rules/lobe_light.h"
#include "octree/node/hidden_layers.h"

namespace surfeit {
namespace {

// Sorts by the upper 32 bits of keys, stable: a radix sort of 8 bits a pass, for a few thousand.
// The first `count` of `order` are replaced; `scratch` grows to hold as many.
void sortByUpperHalf(std::vector<std::uint64_t>& order, std::size_t count,
                     std::vector<std::uint64_t>& scratch) {
  constexpr int kBits = 8, kPasses = 4;
  constexpr std::size_t kBuckets = std::size_t{1} << kBits;
  const auto digit = [](std::uint64_t key, int pass) {
    return std::size_t(key >> (32 + pass * kBits)) & (kBuckets - 1);
  };
  std::array<std::array<std::uint32_t, kBuckets>, kPasses> begin{};
  for (const std::uint64_t key : std::span(order).first(count)) {
    for (int pass = 0; pass < kPasses; ++pass) ++begin[std::size_t(pass)][digit(key, pass)];
  }
  if (scratch.size() < count) scratch.resize(order.size());
  for (int pass = 0; pass < kPasses; ++pass) {
    std::uint32_t sum = 0;
    for (std::uint32_t& place : begin[std::size_t(pass)]) sum += std::exchange(place, sum);
    for (const std::uint64_t key : std::span(order).first(count)) {
      scratch[begin[std::size_t(pass)][digit(key, pass)]++] = key;
    }
    order.swap(scratch);
  }
}

}  // namespace

PacketRaster::PacketRaster(const GatherRules& rules, const PacketKernel& kernel)
    : kernel_(kernel),
      rules_(rules),
      near_disk_radii_(nearFieldRadii(rules, false)),
      near_sphere_radii_(nearFieldRadii(rules, true)),
      max_distance_sq_(maxDistanceSquared(rules)),
      geometry_(rasterGeometry(rules)),
      weights_(rules, 1 / geometry_.pixelsPerSlope()),
      pixels_(hwy::AllocateAligned<float>(geometry_.pixels().size() * kPacketReceivers *
                                          PacketCanvas::channels(rules_, true))) {
  if (pixels_ == nullptr) throw std::bad_alloc();
  patches_.reserve(kReservedPatches);
  parts_.reserve(kReservedParts);
  if (rules.hasLight()) lights_.reserve(kReservedLights);
  order_.resize(kReservedEntries);
  order_scratch_.resize(kReservedEntries);
}

void PacketRaster::begin(std::span<const LocalReceiver> receivers, const PacketView& view) {
  SURFEIT_ASSERT(!receivers.empty() && receivers.size() <= kPacketReceivers);
  view_ = view;
  receiver_count_ = receivers.size();
  for (std::size_t i = 0; i < kPacketReceivers; ++i) {
    const LocalReceiver& receiver = receivers[std::min(i, receivers.size() - 1)];
    lanes_.x[i] = receiver.position.x;
    lanes_.y[i] = receiver.position.y;
    lanes_.z[i] = receiver.position.z;
    lanes_.normal_x[i] = receiver.normal.x;
    lanes_.normal_y[i] = receiver.normal.y;
    lanes_.normal_z[i] = receiver.normal.z;
    lanes_.spherical[i] = receiver.isSpherical() ? 1 : 0;
    const ConeFrame frame(lobeAxis(receiver, rules_));
    for (int axis = 0; axis < 3; ++axis) {
      lanes_.frame[std::size_t(axis)][i] = frame.x[axis];
      lanes_.frame[std::size_t(3 + axis)][i] = frame.y[axis];
      lanes_.frame[std::size_t(6 + axis)][i] = frame.z[axis];
    }
  }
  centre_lane_.x.fill(view.centre.x);
  centre_lane_.y.fill(view.centre.y);
  centre_lane_.z.fill(view.centre.z);
  kernel_.findSeenPixels(canvas(), seen_);
  seen_faces_ = 0;
  for (std::size_t i = 0; i < RasterGeometry::kFaces; ++i) {
    seen_faces_ |= (seen_.faces[i].isEmpty() ? 0u : 1u) << i;
  }
  is_face_used_.fill(false);
  if (recorder_ != nullptr) recorder_->begin(geometry_.pixels().size());
  patches_.clear();
  parts_.resize(1);   // that of what counts wholly
  lights_.resize(1);  // of what sends evenly
  order_count_ = 0;
  has_tints_ = is_translucent_ = false;
  setFrame(nullptr);
}

void PacketRaster::setFrame(const InstanceFrame* frame) {
  frame_ = frame;
  local_centre_ = toLocal(view_.centre);
  local_radius_ = frame != nullptr ? view_.radius / frame->scale : view_.radius;
}

// A patch as made in the frame of an instance.
void PacketRaster::bringToWorld(Patch& patch) const {
  if (frame_ == nullptr) return;
  const float scale = frame_->scale, square = scale * scale;
  patch.position = frame_->toWorld(patch.position);
  patch.normal = frame_->directionToWorld(patch.normal);
  patch.shape = frame_->spreadToWorld(patch.shape);
  for (float* area : {&patch.area, &patch.disk_area, &patch.round_area, &patch.most_area}) {
    *area *= square;
  }
  patch.radius *= scale;
  patch.reach *= scale;
  patch.near_distance *= scale;
  if (patch.is_ribbon) patch.ribbon_width *= scale;
}

// Puts the last patch in the order of those faces that count and that some receiver may see some of
// it on, or drops it when there is none.
void PacketRaster::orderLastPatch(const PacketCanvas& canvas) {
  std::uint32_t faces = seen_faces_ & kernel_.facesThatSee(canvas, patches_.back());
  if (faces == 0) return patches_.pop_back();
  is_translucent_ |= patches_.back().clear > 0;
  SURFEIT_CHECK(patches_.size() < std::numeric_limits<std::uint32_t>::max());
  const auto index = static_cast<std::uint32_t>(patches_.size() - 1);
  const glm::vec3 middle = patches_.back().position - view_.centre;
  const float distance_sq = glm::dot(middle, middle);
  if (order_.size() < order_count_ + RasterGeometry::kFaces) order_.resize(2 * order_.size());
  for (; faces != 0; faces &= faces - 1) {
    order_[order_count_++] = draw_order::key(std::countr_zero(faces), distance_sq, index);
  }
}

// Their place among those of the patches; 0: wholly.
std::uint32_t PacketRaster::keepParts(const LaneParts* parts) {
  if (parts == nullptr) return 0;
  parts_.push_back({*parts});
  return static_cast<std::uint32_t>(parts_.size() - 1);
}

void PacketRaster::addNode(const Node& node, const LaneParts* lane_parts, const NodeLobes* lobes) {
  has_tints_ |= node.isTinted();
  const std::uint32_t parts = keepParts(lane_parts);
  const auto lobeOf = [lobes](std::size_t i) { return lobes != nullptr ? &(*lobes)[i] : nullptr; };
  if (node.isRough()) return addRoughNode(node, lane_parts, parts);
  const bool has_hidden = rules_.groups == kAllGroups && hasHiddenPieces(node);
  const auto add = [&](std::size_t i, const Facet& facet) {
    std::uint32_t seen = parts;
    if (has_hidden) {
      const auto seen_of = [&](const glm::vec3& eye) { return seenOfPiece(node, i, eye); };
      if (!keepSeenParts(seen_of, lane_parts, seen)) return;
    }
    addFacet(node, facet, false, seen, lobeOf(i), node.slopes[i]);
  };
  if (node.isFlat()) return add(0, facetOf(node));
  for (std::size_t i = 0; i < node.facet_count; ++i) {
    const NodeFacet& codes = node.facets[i];
    const glm::vec3 position = codes.positionIn(node.position, node.radius);
    if (node.isTwoSided(i) || !turnsAway(position, codes.meanNormal())) {
      has_tints_ |= isTinted(codes.tint);
      add(i, node.facet(i));
    }
  }
}

// Of what lies behind other layers: how much counts for each receiver, in the frame of what is
// added. `place`, that of `parts` among those of the patches, becomes another one unless all is
// seen. False: nobody sees any.
template <typename SeenOf>
bool PacketRaster::keepSeenParts(const SeenOf& seenOf, const LaneParts* parts,
                                 std::uint32_t& place) {
  LaneParts seen;
  bool is_all = true, is_none = true;
  for (std::size_t i = 0; i < kPacketReceivers; ++i) {
    const float part = seenOf(toLocal(eye(i)));
    is_all = is_all && part == 1;
    is_none = is_none && part == 0;
    seen[i] = part * partOf(parts, i);
  }
  if (!is_all) place = keepParts(&seen);
  return !is_none;
}

// Whether no receiver sees any of a facet.
bool PacketRaster::turnsAway(const glm::vec3& position, const glm::vec3& normal) const {
  const GatherSides sides = rules_.quality.sides;
  const glm::vec3 to_facet = position - local_centre_;
  const float away = glm::dot(to_facet, normal) * (sides == GatherSides::kBack ? -1.f : 1.f);
  if (sides == GatherSides::kBoth || !(away > local_radius_)) return false;
  return away > normalRange(normal) * glm::length(to_facet) + local_radius_;
}

// Of the last patch, which is in the frame of the receivers. `normal`: of its surface, of any
// length, in the frame of what is added.
void PacketRaster::addLobe(const Lobe& lobe, const glm::vec3& normal) {
  const float facing = glm::length(normal);
  if (lobe.isEven() || !(facing > 0)) return;
  LobeLight light(lobe, normal / facing);
  if (frame_ != nullptr) light.axis = frame_->directionToWorld(light.axis);
  Patch& patch = patches_.back();
  patch.lights = static_cast<std::uint32_t>(lights_.size());
  kernel_.seeLobe(lanes_, receiver_count_, patch, light, lights_.emplace_back());
}

// Of the last patch, as addLobe: as the centre sees it, or, where receivers see it from too
// different directions, each by itself. `range`: of its normals.
void PacketRaster::addSlope(const RadiositySlope& slope, float range) {
  if (slope.isNone() || !(range > 0)) return;
  Patch& patch = patches_.back();
  std::array<glm::vec3, 3> slopes;
  for (std::size_t c = 0; c < 3; ++c) {
    slopes[c] = frame_ ? frame_->directionToWorld(slope.value(c)) : slope.value(c);
  }
  PacketLights own;
  for (int c = 0; c < 3; ++c) own.colors[std::size_t(c)].fill(patch.radiosity[c]);
  if (patch.lights == 0 && isSharedLook(patch.position)) {
    kernel_.seeSlope(centre_lane_, 1, patch, slopes, range, own);
    for (int c = 0; c < 3; ++c) patch.radiosity[c] = own.colors[std::size_t(c)][0];
    return;
  }
  if (patch.lights == 0) {
    patch.lights = static_cast<std::uint32_t>(lights_.size());
    lights_.push_back(own);
  }
  kernel_.seeSlope(lanes_, receiver_count_, patch, slopes, range, lights_[patch.lights]);
}

void PacketRaster::addFacet(const Node& node, const Facet& facet, bool is_hull, std::uint32_t parts,
                            const Lobe* lobe, const RadiositySlope& slope) {
  const GatherSides sides = rules_.quality.sides;
  const glm::vec3 to_facet = facet.position - local_centre_;
  const float distance = glm::length(to_facet);
  const glm::vec3 direction = to_facet / distance;
  const float range = normalRange(facet.normal), cosine = -glm::dot(direction, facet.normal);
  const float side = sides == GatherSides::kBack ? -1.f : 1.f;

  Patch& patch = patches_.emplace_back();
  patch.position = facet.position;
  patch.radius = patch.reach = facet.radius;
  patch.normal = facet.is_two_sided ? facet.normal : side * facet.normal;
  patch.is_alone = facet.is_thicket;
  patch.is_solid = is_hull || (!facet.is_thicket && isFilled(node, facet));
  patch.has_gaps = !patch.is_solid;
  patch.is_spread = !node.isFlat() || !patch.is_solid;
  patch.shape = shapeOf(facet.covariance);
  const float opacity = facet.opacity[color_];
  // What is opaque keeps all of its area, and so its power
  patch.layers = opacity < 1 ? facetLayers(facet) : 1;
  patch.opacity = layersOpacity(opacity, patch.layers);
  if (!patch.is_alone) patch.clear = 1 - opacity;
  patch.disk_area = facet.area / patch.layers;
  patch.area = patch.disk_area;
  // The root of two principal moments is at most half of the trace
  if (patch.is_spread) patch.area = std::max(patch.area, 2 * kPi * facet.covariance.trace());
  patch.most_area = std::min(patch.disk_area, kPi * facet.radius * facet.radius);
  const float gain = rules_.gains.ofAlike(node.groups);  // the cut opens others
  if (sides != GatherSides::kBack) patch.radiosity = gain * facet.radiosity;
  const bool shows_both = facet.is_two_sided || sides == GatherSides::kBoth;
  const bool is_rim = std::abs(cosine) < range + local_radius_ / distance;
  if (is_rim) patch.range = range;
  patch.seen = facet.is_two_sided ? Patch::Seen::kBoth
               : shows_both       ? Patch::Seen::kDarkBack
               : patch.range > 0  ? Patch::Seen::kAllAround
                                  : Patch::Seen::kFront;
  patch.is_hull = is_hull;
  patch.kind = node.isFlat() ? CubeKind::kFlatNode : CubeKind::kFacet;
  patch.parts = parts;
  bringToWorld(patch);
  if (lobe != nullptr) addLobe(*lobe, facet.normal);
  if (sides != GatherSides::kBack && rules_.hasLight()) addSlope(slope, range);
  orderLastPatch(canvas());
}

// As seen from the centre, or, where receivers see it from too different directions, by each.
void PacketRaster::addRoughNode(const Node& node, const LaneParts* lane_parts,
                                std::uint32_t parts) {
  if (isSharedLook(toWorld(node.position))) {
    return addRoughNode(node, local_centre_, parts);
  }
  for (std::size_t i = 0; i < receiver_count_; ++i) {
    LaneParts own{};
    own[i] = partOf(lane_parts, i);
    if (own[i] != 0) addRoughNode(node, toLocal(eye(i)), keepParts(&own));
  }
}

void PacketRaster::addRoughNode(const Node& node, const glm::vec3& eye, std::uint32_t parts) {
  RoughSight seen;
  const GatherSides sides = rules_.quality.sides;
  const glm::vec3 to_node = node.position - eye, direction = glm::normalize(to_node);
  kernel_.seeRoughNode(node, direction, seen);
  const float round_area = shownArea(node, seen.facing, sides);
  if (!(round_area > kFidelity.least_visible_part * node.area)) return;
  const SeenPart visible = seenPart(node, to_node, seen.facing, sides);
  Patch& patch = patches_.emplace_back();
  patch.position = node.position + visible.middle;
  // Rough one-sided disks are corners and folds, which meet others where their middle does. What
  // has no sides is rough on a smooth sheet, too, of which its neighbours are the rest
  patch.radius = node.radius;
  patch.reach = partWithoutSides(node) * node.radius;
  patch.normal = node.flatness * node.normal;
  const bool lets_through = transparencyOf(node.transparency, node.tint, color_) != 0;
  patch.is_alone = isThicket(node) || lets_through;
  patch.shape = shapeOf(node.covariance);
  patch.is_solid = false;
  const RoughCover cover = roughCover(node, direction, visible.perspective * round_area, color_);
  patch.area = patch.round_area = cover.area;
  patch.most_area = cover.most;
  patch.opacity = cover.opacity;
  patch.parts = parts;
  const auto [front, back] = seen.facing;
  if (sides != GatherSides::kBack) {
    const float gain = rules_.gains.ofAlike(node.groups);
    patch.radiosity = (gain * front / (round_area * node.opacity(color_))) * seen.radiosity;
  }
  patch.seen = Patch::Seen::kAllAround;
  patch.kind = CubeKind::kRoughNode;
  bringToWorld(patch);
  orderLastPatch(canvas());
}

void PacketRaster::addSurfels(std::span<const Surfel> surfels, const LaneParts* lane_parts,
                              std::span<const Lobe> lobes) {
  const std::uint32_t all_parts = keepParts(lane_parts);
  const PacketCanvas canvas = this->canvas();
  for (const Surfel& stored : surfels) {
    std::uint32_t parts = all_parts;
    if (hiddenSidesOf(stored) != 0 && rules_.groups == kAllGroups) {
      const auto seen_of = [&](const glm::vec3& eye) { return seenOf(stored, eye); };
      if (!keepSeenParts(seen_of, lane_parts, parts)) continue;
    }
    const Surfel surfel = withSides(stored, rules_.quality.sides);
    has_tints_ |= surfel.isTinted();
    const bool lets_through = transparencyOf(surfel.transparency, surfel.tint, color_) != 0;
    Patch& patch = patches_.emplace_back();
    patch.position = surfel.position;
    patch.normal = surfel.normal;
    const Ribbon ribbon = Ribbon::of(surfel);
    const float sharers = sharersOf(surfel);
    float piece_area = sharers * surfel.area;
    patch.radius = patch.reach = std::max(surfel.radius, ribbon.radius());
    if (surfel.isLoose() && !ribbon.isEmpty()) patch.reach = 0.7071f * ribbon.width;
    if (ribbon.isEmpty()) {
      patch.shape = withoutDirection(surfel.normal);
      // Only tiles may cover more than they should to leave no gaps
      const bool is_part =
          surfel.isTwoSided() && !isTile(surfel) && coversInPart(patch.radius, piece_area);
      const bool is_exact = surfel.isLoose() || is_part;
      const float share = is_exact ? 1 : tileShare(surfel);
      patch.soft_peak = softDiskPeak(patch.radius, share * piece_area, is_exact);
      if (share > 1) piece_area *= share, patch.filled = 1 / share;
    } else {
      patch.shape = ribbon.shape();
      patch.is_ribbon = true;
      patch.ribbon_width = ribbon.width;
    }
    patch.area = patch.most_area = piece_area;
    (surfel.isSphere() ? patch.round_area : patch.disk_area) = piece_area;
    patch.radiosity = rules_.gains.of(surfel.group) * surfel.radiosity;
    patch.seen = surfel.isSphere()                            ? Patch::Seen::kAllAround
                 : surfel.isTwoSided()                        ? Patch::Seen::kBoth
                 : rules_.quality.sides == GatherSides::kBoth ? Patch::Seen::kDarkBack
                                                              : Patch::Seen::kFront;
    patch.opacity = surfel.opacity(color_) / sharers;
    patch.is_alone = surfel.isLone() || (lets_through && (surfel.isSphere() || surfel.isLoose()));
    if (!patch.is_alone) patch.clear = 1 - surfel.opacity(color_);
    patch.is_solid = !surfel.isSphere() && !surfel.isLoose();
    patch.is_layered = hiddenSidesOf(stored) != 0;
    // Positive, for a surfel may be at a receiver; then it is near at any setting
    const float radii = surfel.isSphere() ? near_sphere_radii_ : near_disk_radii_;
    patch.near_distance = std::max(radii * patch.radius, std::numeric_limits<float>::min());
    patch.parts = parts;
    bringToWorld(patch);
    if (!lobes.empty()) addLobe(lobes[std::size_t(&stored - surfels.data())], surfel.normal);
    orderLastPatch(canvas);
  }
}

void PacketRaster::addPatch(const Patch& patch) {
  patches_.push_back(patch);
  orderLastPatch(canvas());
}

PacketCanvas PacketRaster::canvas() const {
  return {.lanes = &lanes_,
          .receiver_count = receiver_count_,
          .rules = &rules_,
          .geometry = &geometry_,
          .weights = &weights_,
          .max_distance_sq = max_distance_sq_,
          .luminance = luminance_,
          .packet_radius = view_.radius,
          .pixels = pixels_.get(),
          .is_face_used = &is_face_used_,
          .seen = &seen_,
          .is_translucent = is_translucent_,
          .parts = parts_.data(),
          .lights = lights_.data(),
          .recorder = recorder_,
          .scratch = &order_scratch_};
}

void PacketRaster::sort() { sortByUpperHalf(order_, order_count_, order_scratch_); }

void PacketRaster::draw() {
  kernel_.draw(canvas(), patches_.data(), std::span(order_).first(order_count_));
}

std::size_t PacketRaster::tracedCount() const {
  return std::size_t(std::count_if(patches_.begin(), patches_.end(), [&](const Patch& patch) {
    return glm::length(patch.position - view_.centre) < patch.near_distance;
  }));
}

std::size_t PacketRaster::memoryBytes(const GatherRules& rules) {
  const std::size_t pixel_bytes =
      sizeof(RasterGeometry::Pixel) +
      PacketCanvas::channels(rules, true) * kPacketReceivers * sizeof(float);
  return sizeof(PacketRaster) +
         RasterGeometry::pixelCount(rules.quality.raster_resolution) * pixel_bytes +
         kReservedPatches * sizeof(Patch) + kReservedParts * sizeof(PacketParts) +
         (rules.hasLight() ? kReservedLights * sizeof(PacketLights) : 0) +
         2 * kReservedEntries * sizeof(std::uint64_t);
}

}  // namespace surfeit
