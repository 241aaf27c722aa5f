#include "gather/scalar/receiver_raster.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <limits>

#include "core/assert.h"
#include "gather/light/environment_map.h"
#include "gather/rules/coverage_rules.h"
#include "gather/rules/ribbon.h"
#include "gather/scalar/pixel_record.h"

namespace surfeit {

ReceiverRaster::ReceiverRaster(const GatherRules& rules)
    : rules_(rules),
      contribution_rules_{rules.quality.sides, rules.hasLight(),
                          ribbonNested(pixelsPerSlope(rules))},
      near_disk_radii_(nearFieldRadii(rules, false)),
      near_sphere_radii_(nearFieldRadii(rules, true)),
      max_distance_sq_(maxDistanceSquared(rules)),
      has_frame_(rules.hasConeRaster()),
      geometry_(rasterGeometry(rules)),
      weights_(rules, 1 / geometry_.pixelsPerSlope()),
      cube_(geometry_, rules.hasLight(), rules.fades()) {
  contributions_.reserve(kReservedContributions);
  order_.reserve(kReservedContributions);
  near_surfels_.reserve(kReservedNearSurfels);
}

void ReceiverRaster::begin(const LocalReceiver& receiver) {
  receiver_ = receiver;
  is_spherical_ = receiver.isSpherical();
  axis_ = lobeAxis(receiver, rules_);
  if (has_frame_) frame_ = ConeFrame(axis_);
  contributions_.clear();
  near_surfels_.clear();
}

void ReceiverRaster::addNode(const Node& node, float part) {
  if (!node.hasFacets()) {
    return addPatch(node, node.isFlat() ? CubeKind::kFlatNode : CubeKind::kRoughNode, part);
  }
  for (std::size_t i = 0; i < node.facet_count; ++i) {
    addPatch(node.facet(i), CubeKind::kFacet, part);
  }
}

template <typename NodeOrFacet>
void ReceiverRaster::addPatch(const NodeOrFacet& source, CubeKind kind, float part) {
  const glm::vec3 to_source = source.position - receiver_.position;
  Entry entry;
  if (!makeContribution(source, to_source, contribution_rules_, entry.contribution)) return;
  if (!(heightAboveHorizon(receiver_, entry.contribution.direction) > 0)) return;
  if (!(entry.contribution.distance_sq <= max_distance_sq_)) return;
  entry.contribution.opacity *= part;
  entry.kind = kind;
  contributions_.push_back(entry);
}

void ReceiverRaster::addSurfel(const Surfel& stored, float part) {
  Surfel surfel = withSides(stored, contribution_rules_.sides);
  const Ribbon ribbon = Ribbon::of(surfel);
  surfel.radius = drawnRadius(surfel, ribbon);
  const glm::vec3 to_surfel = surfel.position - receiver_.position;
  const float distance_sq = glm::dot(to_surfel, to_surfel);
  if (!(distance_sq <= max_distance_sq_)) return;

  if (is_spherical_ && surfel.isSphere()) {
    const float clearance = kFidelity.sphere_clearance * surfel.radius;
    if (distance_sq < clearance * clearance) return;
  }

  // Mid field: a patch, when its middle is above the horizon
  const float height = heightAboveHorizon(receiver_, to_surfel);
  const float radii = surfel.isSphere() ? near_sphere_radii_ : near_disk_radii_;
  const float border = radii * nearFieldSize(surfel.radius, ribbon);
  const float near_part = nearPart(distance_sq, nearBorderSq(border));
  Entry patch;
  if (near_part < 1 && height > 0 &&
      makeContribution(surfel, to_surfel, contribution_rules_, patch.contribution)) {
    patch.contribution.opacity = part * (1 - near_part);
    patch.kind = CubeKind::kPatch;
    contributions_.push_back(patch);
  }
  if (near_part == 0) return;

  // Near field: traced later, unless even the highest point of the disk is below the horizon of the
  // rays. Along the receiver's normal a disk reaches radius * sin(angle of normals) above its
  // middle; this drops the receiver's own surface, which would cover it through rounding alone.
  const float bias = rayBias(surfel);
  const float cosine = glm::dot(receiver_.normal, surfel.normal);
  const float rise = surfel.radius * std::sqrt(std::max(0.f, 1 - cosine * cosine));
  if (!(height + rise > bias)) return;

  if (!showsTracedSide(surfel, to_surfel - bias * receiver_.normal)) return;
  Entry entry;
  entry.contribution = {};
  entry.contribution.distance_sq = distance_sq;
  entry.contribution.opacity = part * near_part;
  const float distance = std::sqrt(std::max(distance_sq, std::numeric_limits<float>::min()));
  entry.contribution.reach = reachOf(surfel, ribbon, surfel.radius, to_surfel / distance);
  entry.near_index = std::int32_t(near_surfels_.size());
  entry.kind = CubeKind::kTraced;
  near_surfels_.push_back(surfel);
  contributions_.push_back(entry);
}

// Nothing is seen of the back of a one-sided disk, nor of a sphere from inside. `centre`: from the
// origin of the rays.
bool ReceiverRaster::showsTracedSide(const Surfel& surfel, const glm::vec3& centre) const {
  if (surfel.isSphere()) return glm::dot(centre, centre) > surfel.radius * surfel.radius;
  if (surfel.isTwoSided() || contribution_rules_.sides == GatherSides::kBoth) return true;
  return glm::dot(centre, surfel.normal) < 0;
}

// A strict order of what two entries draw, whatever order they were added in.
bool ReceiverRaster::isLessContent(const Entry& a, const Entry& b) const {
  const int patch = std::memcmp(&a.contribution, &b.contribution, sizeof(Contribution));
  if (patch != 0) return patch < 0;
  if (a.near_index < 0) return false;  // equal patches; a near surfel has no direction
  return std::memcmp(&near_surfels_[std::size_t(a.near_index)],
                     &near_surfels_[std::size_t(b.near_index)], sizeof(Surfel)) < 0;
}

void ReceiverRaster::sortByDistance() {
  // Distances are positive, and positive floats sort like their bits
  SURFEIT_CHECK(contributions_.size() <= std::numeric_limits<std::uint32_t>::max());
  order_.resize(contributions_.size());
  for (std::size_t i = 0; i < order_.size(); ++i) {
    const std::uint32_t bits =
        std::bit_cast<std::uint32_t>(contributions_[i].contribution.distance_sq);
    order_[i] = std::uint64_t{bits} << 32 | i;
  }
  std::sort(order_.begin(), order_.end());

  // Equal distances: by content, so that the order of adding does not matter
  const auto isLess = [this](std::uint64_t a, std::uint64_t b) {
    return isLessContent(contributions_[std::uint32_t(a)], contributions_[std::uint32_t(b)]);
  };
  for (std::size_t begin = 0; begin < order_.size();) {
    std::size_t end = begin + 1;
    while (end < order_.size() && order_[end] >> 32 == order_[begin] >> 32) ++end;
    if (end - begin > 1) {
      std::sort(order_.begin() + std::ptrdiff_t(begin), order_.begin() + std::ptrdiff_t(end),
                isLess);
    }
    begin = end;
  }
}

// The bias keeps disks of the receiver's own surface from covering it. What faces the receiver
// closely is none of those, nor what rises above its plane and is seen from both sides: either
// would be looked through. So the bias fades out with the normal, and of two-sided surfels, whose
// normal is one of two, with the height. (A dragon on a plane: AO RMSE .0254 with a constant bias,
// .0218 fading with the normal.) Ribbons are as rough as they are wide. (AO RMSE of hair .0088;
// .0117 with radii.)
float ReceiverRaster::rayBias(const Surfel& surfel) const {
  const Ribbon ribbon = Ribbon::of(surfel);
  const float radius = ribbon.isEmpty() ? surfel.radius : ribbon.width;
  float bias = rules_.quality.bias * radius * (ribbon.isEmpty() ? 1 : kFidelity.ribbon_bias);
  if (surfel.isTwoSided()) {
    const glm::vec3 to_surfel = surfel.position - receiver_.position;
    bias *= biasPart(heightAboveHorizon(receiver_, to_surfel) / radius);
  }
  // Zero for spheres. With backs the surfel was turned, and its own surface faces it
  const bool is_turned = rules_.quality.sides == GatherSides::kBack && !surfel.isTwoSided();
  const float turned = is_turned ? -1.f : 1.f;
  const float cosine = turned * glm::dot(receiver_.normal, surfel.normal);
  return surfel.isTwoSided() ? bias : bias * std::min(1.f, 1 + cosine);
}

void ReceiverRaster::trace(const Surfel& surfel, float part, const DepthRange& depth) {
  const glm::vec3 centre =
      surfel.position - receiver_.position - rayBias(surfel) * receiver_.normal;
  Ribbon ribbon = Ribbon::of(surfel);
  const RasterCube::Texture texture = {.thicket = thicketPart(surfel),
                                       .opacity = part,
                                       .nested = nestedPart(surfel, ribbon, contribution_rules_),
                                       .is_solid = mayTile(surfel)};
  if (surfel.isSphere()) {
    cube_.traceSphere(inRaster(centre), surfel.radius, texture, depth, surfel.radiosity);
    return;
  }
  if (!ribbon.isEmpty()) {
    ribbon.along = inRaster(ribbon.along);
    ribbon.across = inRaster(ribbon.across);
    cube_.traceRibbon(inRaster(centre), inRaster(surfel.normal), ribbon, texture, depth,
                      surfel.radiosity);
    return;
  }
  const bool sends_light = surfel.isTwoSided() || glm::dot(centre, surfel.normal) < 0;
  cube_.traceDisk(inRaster(centre), inRaster(surfel.normal), surfel.radius,
                  softDiskPeak(surfel.radius, surfel.area, surfel.isTwoSided()), texture, depth,
                  sends_light ? surfel.radiosity : glm::vec3(0));
}

void ReceiverRaster::setRecorder(PixelRecorder* recorder) {
  recorder_ = recorder;
  cube_.setRecorder(recorder);
}

GatherResult ReceiverRaster::finish() {
  sortByDistance();
  cube_.clear(inRaster(receiver_.normal), weights_.isPlainCosine() && !has_frame_);
  if (recorder_ != nullptr) recorder_->begin(geometry_.pixels().size());
  for (const std::uint64_t key : order_) {
    const Entry& entry = contributions_[std::uint32_t(key)];
    const Contribution& patch = entry.contribution;
    if (recorder_ != nullptr) recorder_->setKind(entry.kind);
    const float distance = std::sqrt(patch.distance_sq);
    const DepthRange depth = {distance - patch.reach, distance + patch.reach,
                              rules_.fades() ? fadeAt(distance, rules_) : 1};
    if (entry.near_index >= 0) {
      trace(near_surfels_[std::size_t(entry.near_index)], patch.opacity, depth);
    } else {
      cube_.splat({inRaster(patch.direction),
                   inRaster(patch.normal),
                   inRaster(patch.shape),
                   patch.solid_angle,
                   patch.spread,
                   {patch.overlap, patch.thicket, patch.opacity, patch.nested, patch.is_solid > 0}},
                  depth, patch.radiosity);
    }
  }
  cube_.close();
  return integrate();
}

ResultSums::Pixel ReceiverRaster::pixel(std::size_t i) const {
  const RasterGeometry::Pixel& pixel = geometry_.pixels()[i];
  const glm::vec3 direction = has_frame_ ? frame_.toWorld(pixel.direction) : pixel.direction;
  float weight = 1;
  if (!is_spherical_) {
    weight = glm::dot(direction, receiver_.normal) > 0 ? weights_(glm::dot(direction, axis_)) : 0;
  }
  glm::vec3 environment(0);
  if (has_frame_ && rules_.environment != nullptr) {
    environment = rules_.environment->lookup(direction, pixel.solid_angle);
  } else if (rules_.environment_cube != nullptr) {
    environment = rules_.environment_cube->pixels()[i];
  }
  return {.direction = direction,
          .solid_angle = pixel.solid_angle,
          .weight = weight,
          .coverage = cube_.coverage(i),
          .occlusion = rules_.fades() ? cube_.fadedCoverage(i) : cube_.coverage(i),
          .radiosity = rules_.hasLight() ? cube_.radiosity(i) : glm::vec3(0),
          .environment = environment};
}

GatherResult ReceiverRaster::integrate() const {
  ResultSums sums;
  for (std::size_t i = 0; i < geometry_.pixels().size(); ++i) sums.add(pixel(i));
  return sums.result(rules_, is_spherical_);
}

std::size_t ReceiverRaster::memoryBytes(const GatherQuality& quality) {
  const std::size_t pixel_bytes = sizeof(RasterGeometry::Pixel) + RasterCube::kPixelBytes;
  return sizeof(ReceiverRaster) +
         RasterGeometry::pixelCount(quality.raster_resolution) * pixel_bytes +
         kReservedContributions * (sizeof(Entry) + sizeof(std::uint64_t)) +
         kReservedNearSurfels * sizeof(Surfel);
}

}  // namespace surfeit
