#include "octree/node_sums.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <iterator>
#include <limits>

namespace surfeit {
namespace {

// The lobe that a surfel's projected area is, by direction (memo 3.2 and 7.5).
const ZonalFactors& lobeOf(const Surfel& surfel) {
  if (surfel.isSphere()) return kConstant;
  return surfel.isTwoSided() ? kAbsoluteCosine : kClampedCosine;
}

// The mean of x x^T over a disk of area A around the origin is A / (4 pi) (I - n n^T); over the
// disk that a sphere looks like, the same without a normal.
double diskSpread(const Surfel& surfel) {
  const double radius = double(surfel.radius);
  return std::min(double(surfel.area) / (4 * double(kPi)), radius * radius / 4);
}

}  // namespace

void NodeSums::add(const Surfel& surfel) {
  addMoments(surfel);
  const double a = double(surfel.area);
  const double area_and_power[4] = {1, double(surfel.radiosity[0]), double(surfel.radiosity[1]),
                                    double(surfel.radiosity[2])};
  surfel_count += 1;
  groups |= groupBit(surfel.group);
  area += a;
  for (int axis = 0; axis < 3; ++axis) {
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
  if (!surfel.isSphere()) {
    const ShCoefficients fourth = shBand4(surfel.normal);
    const double weight = a * (surfel.isTwoSided() ? 2 : 1) * (4 * double(kPi) / 9);
    for (int i = 0; i < kShCount; ++i) band_4[i] += weight * double(fourth[i]);
  }
  // Far from the origin a sum of position and radius rounds by more than the radius
  const glm::vec3 half = glm::abs(surfel.position) * 0x1p-23f + surfel.radius;
  disk_bounds.add(surfel.position - half);
  disk_bounds.add(surfel.position + half);
}

// Of positions, which are relative to the origin.
void NodeSums::addMoments(const Surfel& surfel) {
  if (surfel_count == 0) {
    for (int axis = 0; axis < 3; ++axis) origin[axis] = double(surfel.position[axis]);
  }
  const double a = double(surfel.area), spread = diskSpread(surfel);
  const bool has_front = !surfel.isSphere() && !surfel.isTwoSided();
  double x[3], n[3];
  for (int axis = 0; axis < 3; ++axis) {
    x[axis] = double(surfel.position[axis]) - origin[axis];
    n[axis] = surfel.isSphere() ? 0 : double(surfel.normal[axis]);
    position[axis] += a * x[axis];
  }
  for (std::size_t i = 0; i < SymmetricMatrix::kEntries; ++i) {
    const int row = SymmetricMatrix::kRow[i], column = SymmetricMatrix::kColumn[i];
    const double identity = row == column ? 1 : 0;
    second_moment[i] += a * (x[row] * x[column] + spread * (identity - n[row] * n[column]));
  }
  if (!has_front) return;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      front_moment[row][column] += a * x[row] * n[column];
    }
  }
}

// The child's, moved by d from its origin to ours: (x + d)(x + d)^T, and (x + d) n^T.
void NodeSums::addMoments(const NodeSums& child) {
  if (surfel_count == 0) std::copy(std::begin(child.origin), std::end(child.origin), origin);
  double d[3];
  for (int axis = 0; axis < 3; ++axis) d[axis] = child.origin[axis] - origin[axis];
  for (std::size_t i = 0; i < SymmetricMatrix::kEntries; ++i) {
    const int row = SymmetricMatrix::kRow[i], column = SymmetricMatrix::kColumn[i];
    second_moment[i] += child.second_moment[i] + d[row] * child.position[column] +
                        child.position[row] * d[column] + child.area * d[row] * d[column];
  }
  for (int row = 0; row < 3; ++row) {
    position[row] += child.position[row] + child.area * d[row];
    for (int column = 0; column < 3; ++column) {
      front_moment[row][column] += child.front_moment[row][column] + d[row] * child.normal[column];
    }
  }
}

void NodeSums::add(const NodeSums& child) {
  addMoments(child);
  surfel_count += child.surfel_count;
  groups |= child.groups;
  area += child.area;
  for (int axis = 0; axis < 3; ++axis) {
    normal[axis] += child.normal[axis];
    radiosity[axis] += child.radiosity[axis];
  }
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
  for (std::size_t i = 0; i < SymmetricMatrix::kEntries; ++i) {
    const int row = SymmetricMatrix::kRow[i], column = SymmetricMatrix::kColumn[i];
    node.covariance.entries[i] =
        float(second_moment[i] / area - position[row] / area * (position[column] / area));
  }
  if (node.flatness > flatness_limit) {
    node.flags = kNodeFlat;
    return node;
  }
  for (int i = 0; i < kShCount; ++i) {
    for (int kind = 0; kind < kNodeShKinds; ++kind) node.sh[i][kind] = float(sh[i][kind]);
    node.area_band_4[i] = float(band_4[i]);
  }
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      constexpr double kMost = std::numeric_limits<float>::max();
      const double moment = front_moment[row][column] - position[row] / area * normal[column];
      node.front_moment[row][column] = float(std::clamp(moment, -kMost, kMost));
    }
  }
  return node;
}

float radiusOfBox(const glm::vec3& centre, const Bounds3& box) {
  // In double: squares of a float's smallest lengths are zero, of its largest infinite
  const glm::dvec3 corner(glm::max(box.max - centre, centre - box.min));
  return float(std::sqrt(corner.x * corner.x + corner.y * corner.y + corner.z * corner.z));
}

}  // namespace surfeit
