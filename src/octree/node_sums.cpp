#include "octree/node_sums.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

namespace surfeit {
namespace {

// The lobe that a surfel's projected area is, by direction (memo 3.2 and 7.5).
const ZonalFactors& lobeOf(const Surfel& surfel) {
  if (surfel.isSphere()) return kConstant;
  return surfel.isTwoSided() ? kAbsoluteCosine : kClampedCosine;
}

}  // namespace

void NodeSums::add(const Surfel& surfel) {
  const double a = double(surfel.area);
  const double area_and_power[4] = {1, double(surfel.radiosity[0]), double(surfel.radiosity[1]),
                                    double(surfel.radiosity[2])};
  surfel_count += 1;
  groups |= groupBit(surfel.group);
  area += a;
  for (int axis = 0; axis < 3; ++axis) {
    position[axis] += a * double(surfel.position[axis]);
    radiosity[axis] += a * area_and_power[axis + 1];
    // Both sides of a two-sided disk face everywhere: it gives a node no direction
    if (!surfel.isTwoSided()) normal[axis] += a * double(surfel.normal[axis]);
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
  // Far from the origin a sum of position and radius rounds by more than the radius
  const glm::vec3 half = glm::abs(surfel.position) * 0x1p-23f + surfel.radius;
  disk_bounds.add(surfel.position - half);
  disk_bounds.add(surfel.position + half);
}

void NodeSums::add(const NodeSums& child) {
  surfel_count += child.surfel_count;
  groups |= child.groups;
  area += child.area;
  for (int axis = 0; axis < 3; ++axis) {
    position[axis] += child.position[axis];
    normal[axis] += child.normal[axis];
    radiosity[axis] += child.radiosity[axis];
  }
  for (int i = 0; i < kShCount; ++i) {
    for (int k = 0; k < 4; ++k) sh[i][k] += child.sh[i][k];
  }
  disk_bounds.add(child.disk_bounds);
}

glm::vec3 NodeSums::centre() const {
  return {float(position[0] / area), float(position[1] / area), float(position[2] / area)};
}

Node NodeSums::toNode(float flatness_limit) const {
  Node node{};
  node.position = centre();
  node.area = float(area);
  node.surfel_count = surfel_count;
  node.groups = groups;
  const double length =
      std::sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]);
  node.flatness = float(std::min(length / area, 1.0));
  for (int axis = 0; axis < 3; ++axis) {
    node.normal[axis] = length > 0 ? float(normal[axis] / length) : 0;
    node.radiosity[axis] = float(radiosity[axis] / area);
  }
  if (node.flatness > flatness_limit) {
    node.flags = kNodeFlat;
    return node;
  }
  for (int i = 0; i < kShCount; ++i) {
    for (int kind = 0; kind < kNodeShKinds; ++kind) node.sh[i][kind] = float(sh[i][kind]);
  }
  return node;
}

float radiusOfBox(const glm::vec3& centre, const Bounds3& box) {
  // In double: squares of a float's smallest lengths are zero, of its largest infinite
  const glm::dvec3 corner(glm::max(box.max - centre, centre - box.min));
  return float(std::sqrt(corner.x * corner.x + corner.y * corner.y + corner.z * corner.z));
}

}  // namespace surfeit
