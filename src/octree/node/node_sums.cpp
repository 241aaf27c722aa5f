#include "octree/node/node_sums.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <iterator>
#include <limits>

#include "octree/node/radiosity_variance.h"
#include "octree/node/stored_loss.h"

namespace surfeit {
namespace {

// The lobe that a surfel's projected area is, by direction (memo 3.2 and 7.5).
const ZonalFactors& lobeOf(const Surfel& surfel) {
  if (surfel.isSphere()) return kConstant;
  return surfel.isTwoSided() ? kAbsoluteCosine : kClampedCosine;
}

void setNormal(const AreaSums& sums, Node& node) {
  const double length = sums.normalLength();
  node.flatness = float(std::min(length / sums.area, 1.0));
  for (int axis = 0; axis < 3; ++axis) {
    node.normal[axis] = length > 0 ? float(sums.normal[axis] / length) : 0;
  }
}

}  // namespace

void NodeSums::add(const Surfel& surfel) {
  if (surfel_count == 0) {
    for (int axis = 0; axis < 3; ++axis) origin[axis] = double(surfel.position[axis]);
  }
  const AreaSums one(surfel, origin);
  AreaSums::add(one);
  const bool has_one_front = !surfel.isSphere() && !surfel.isTwoSided();
  surfel.isSphere() ? facets.giveUp() : facets.add({one, surfel});
  for (int row = 0; row < 3 && has_one_front; ++row) {
    for (int column = 0; column < 3; ++column) {
      front_moment[row][column] += one.position[row] * double(surfel.normal[column]);
    }
  }
  surfel_count += 1;
  groups |= groupBit(surfel.group);
  const double a = double(surfel.area);
  if (!has_one_front) loose_area += surfel.isLoose() ? a : -a;
  double area_and_power[4] = {1};
  for (int c = 0; c < 3; ++c) {
    area_and_power[powerKind(c)] = double(surfel.opacity(c)) * double(surfel.radiosity[c]);
  }
  const ZonalFactors& factors = lobeOf(surfel);
  const double bands[3] = {a * double(factors[0]), a * double(factors[1]), a * double(factors[2])};
  const ShCoefficients basis = shBasis(surfel.normal);
  // A sphere has no normal, and only band 0
  const int count = surfel.isSphere() ? 1 : kShCount;
  for (int i = 0; i < count; ++i) {
    const double lobe = bands[kShBand[i]] * double(basis[i]);
    for (int k = 0; k < 4; ++k) sh[i][k] += lobe * area_and_power[k];
  }
  if (!surfel.isSphere()) {
    const ShCoefficients fourth = shBand4(surfel.normal);
    const double weight = a * (surfel.isTwoSided() ? 2 : 1) * (4 * double(kPi) / 9);
    for (int i = 0; i < kShCount; ++i) band_4[i] += weight * double(fourth[i]);
  }
  // Far from the origin a sum of position and radius rounds by more than the radius
  const glm::vec3 half = glm::abs(surfel.position) * 0x1p-23f + radiusWithLoss(surfel);
  disk_bounds.add(surfel.position - half);
  disk_bounds.add(surfel.position + half);
}

// Moved by d from the child's origin to ours: (x + d) n^T.
void NodeSums::add(const NodeSums& child) {
  if (surfel_count == 0) std::copy(std::begin(child.origin), std::end(child.origin), origin);
  double shift[3];
  for (int axis = 0; axis < 3; ++axis) shift[axis] = child.origin[axis] - origin[axis];
  AreaSums moved = child;
  moved.move(shift);
  AreaSums::add(moved);
  facets.add(child.facets, shift);
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      front_moment[row][column] +=
          child.front_moment[row][column] + shift[row] * child.normal[column];
    }
  }
  surfel_count += child.surfel_count;
  groups |= child.groups;
  loose_area += child.loose_area;
  for (int i = 0; i < kShCount; ++i) {
    for (int k = 0; k < 4; ++k) sh[i][k] += child.sh[i][k];
    band_4[i] += child.band_4[i];
  }
  disk_bounds.add(child.disk_bounds);
}

glm::vec3 NodeSums::centre() const {
  glm::vec3 mean;
  for (int axis = 0; axis < 3; ++axis) mean[axis] = float(origin[axis] + position[axis] / area);
  return mean;
}

Facet NodeSums::toFacet(const AreaSums& group) const {
  Facet facet{};
  facet.area = float(group.area);
  for (int axis = 0; axis < 3; ++axis) {
    facet.position[axis] = float(origin[axis] + group.position[axis] / group.area);
    facet.normal[axis] = float(group.normal[axis] / group.area);
    facet.radiosity[axis] = float(group.radiosity[axis] / group.covered[axis]);
    facet.opacity[axis] = float(group.covered[axis] / group.area);
  }
  facet.covariance = group.covariance();
  return facet;
}

RoughNode NodeSums::toRough() const {
  RoughNode rough{};
  for (int i = 0; i < kShCount; ++i) {
    for (int kind = 0; kind < kNodeShKinds; ++kind) rough.sh[i][kind] = float(sh[i][kind]);
    rough.area_band_4[i] = float(band_4[i]);
  }
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      constexpr double kMost = std::numeric_limits<float>::max();
      const double moment = front_moment[row][column] - position[row] / area * normal[column];
      rough.front_moment[row][column] = float(std::clamp(moment, -kMost, kMost));
    }
  }
  return rough;
}

AreaSums NodeSums::flatPiece(bool is_two_sided, float flatness_limit) const {
  if (!is_two_sided) return *this;
  const FacetSums fewest = facets.fewest(flatness_limit);
  return fewest.groups().empty() ? AreaSums(*this) : AreaSums(fewest.groups().front());
}

Node NodeSums::toNode(float flatness_limit, float radius) const {
  Node node{};
  node.radius = radius;
  node.forgetBounds();
  node.surfel_count = surfel_count;
  node.groups = groups;
  const Facet all = toFacet(*this);
  node.position = all.position;
  node.area = all.area;
  node.radiosity = all.radiosity;
  node.transparency = transparencyOf(covered[0] / area);
  node.tint = tintOf(node.transparency, transparencyOf(covered[1] / area),
                     transparencyOf(covered[2] / area));
  node.covariance = all.covariance;
  node.radiosity_variance = RadiosityVariance::of(*this);
  setNormal(*this, node);
  if (loose_area > 0) node.flags = kNodeLoose;
  const bool is_flat = node.flatness > flatness_limit;
  if (is_flat && !facets.hideDifferently()) {
    node.flags |= kNodeFlat;
    node.hidden = facets.hiddenSides();
    node.slopes[0] = RadiositySlope::of(*this);
    return node;
  }
  const FacetSums fewest = facets.fewest(flatness_limit);
  if (fewest.groups().empty()) {
    node.rough = toRough();
    return node;
  }
  if (fewest.groups().size() == 1 && fewest.groups().front().is_two_sided) {
    setNormal(fewest.groups().front(), node);
    node.flags |= kNodeFlat | kNodeTwoSided;
    node.hidden = fewest.groups().front().hidden;
    node.slopes[0] = RadiositySlope::of(fewest.groups().front());
    return node;
  }
  node.facets = {};
  RadiosityVariance variance;
  for (const FacetGroup& group : fewest.groups()) {
    variance.add(group);
    if (group.is_two_sided) node.flags |= std::uint8_t(kNodeTwoSided << node.facet_count);
    node.slopes[node.facet_count] = RadiositySlope::of(group);
    NodeFacet& facet = node.facets[node.facet_count++];
    facet = NodeFacet::encode(toFacet(group), node.position, node.radius, node.area);
    facet.hidden = group.hidden;
  }
  node.radiosity_variance = float(variance.value());
  return node;
}

float radiusOfBox(const glm::vec3& centre, const Bounds3& box) {
  // In double: squares of a float's smallest lengths are zero, of its largest infinite
  const glm::dvec3 corner(glm::max(box.max - centre, centre - box.min));
  return float(std::sqrt(corner.x * corner.x + corner.y * corner.y + corner.z * corner.z));
}

}  // namespace surfeit
