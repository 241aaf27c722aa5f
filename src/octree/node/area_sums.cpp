#include "octree/node/area_sums.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/ribbon.h"
#include "core/spherical_harmonics.h"

namespace surfeit {
namespace {

// The mean of x x^T over a surfel, from its middle, within its radius. Over a disk of area A it is
// A / (4 pi) (I - n n^T); over the disk that a sphere looks like, the same without a normal.
std::array<double, SymmetricMatrix::kEntries> spreadOf(const Surfel& surfel) {
  std::array<double, SymmetricMatrix::kEntries> spread{};
  const double radius = double(surfel.radius);
  const Ribbon ribbon = Ribbon::of(surfel);
  if (!ribbon.isEmpty()) {
    const double within = std::min(1.0, radius / double(ribbon.radius()));
    const SymmetricMatrix rectangle = ribbon.spread();
    for (std::size_t i = 0; i < SymmetricMatrix::kEntries; ++i) {
      spread[i] = within * within * double(rectangle.entries[i]);
    }
    return spread;
  }
  const double scale = std::min(double(surfel.area) / (4 * double(kPi)), radius * radius / 4);
  const glm::dvec3 n = surfel.isSphere() ? glm::dvec3(0) : glm::dvec3(surfel.normal);
  for (std::size_t i = 0; i < SymmetricMatrix::kEntries; ++i) {
    const int row = SymmetricMatrix::kRow[i], column = SymmetricMatrix::kColumn[i];
    spread[i] = scale * ((row == column ? 1 : 0) - n[row] * n[column]);
  }
  return spread;
}

}  // namespace

AreaSums::AreaSums(const Surfel& surfel, const double (&origin)[3]) {
  const double a = double(surfel.area);
  const auto spread = spreadOf(surfel);
  area = a;
  double x[3], n[3];
  for (int axis = 0; axis < 3; ++axis) {
    x[axis] = double(surfel.position[axis]) - origin[axis];
    n[axis] = surfel.isSphere() ? 0 : double(surfel.normal[axis]);
    position[axis] = a * x[axis];
    // Axes count colors, too
    const double o = double(surfel.opacity(axis));
    covered[axis] = a * o;
    radiosity[axis] = a * o * double(surfel.radiosity[axis]);
    radiosity_sq += radiosity[axis] * double(surfel.radiosity[axis]);
    // Both sides of a two-sided disk face everywhere: it gives a node no direction
    if (!surfel.isTwoSided()) normal[axis] = a * n[axis];
  }
  for (int color = 0; color < 3 && !surfel.isTwoSided(); ++color) {
    for (int axis = 0; axis < 3; ++axis) power_normal[color][axis] = radiosity[color] * n[axis];
  }
  for (std::size_t i = 0; i < SymmetricMatrix::kEntries; ++i) {
    const int row = SymmetricMatrix::kRow[i], column = SymmetricMatrix::kColumn[i];
    second_moment[i] = a * (x[row] * x[column] + spread[i]);
  }
}

// (x + d)(x + d)^T.
void AreaSums::move(const double (&shift)[3]) {
  for (std::size_t i = 0; i < SymmetricMatrix::kEntries; ++i) {
    const int row = SymmetricMatrix::kRow[i], column = SymmetricMatrix::kColumn[i];
    second_moment[i] += shift[row] * position[column] + position[row] * shift[column] +
                        area * shift[row] * shift[column];
  }
  for (int axis = 0; axis < 3; ++axis) position[axis] += area * shift[axis];
}

void AreaSums::add(const AreaSums& other) {
  area += other.area;
  for (std::size_t i = 0; i < SymmetricMatrix::kEntries; ++i) {
    second_moment[i] += other.second_moment[i];
  }
  for (int axis = 0; axis < 3; ++axis) {
    position[axis] += other.position[axis];
    normal[axis] += other.normal[axis];
    for (int color = 0; color < 3; ++color) {
      power_normal[color][axis] += other.power_normal[color][axis];
    }
    covered[axis] += other.covered[axis];
    radiosity[axis] += other.radiosity[axis];
  }
  radiosity_sq += other.radiosity_sq;
}

double AreaSums::normalLength() const {
  return std::sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]);
}

SymmetricMatrix AreaSums::covariance() const {
  SymmetricMatrix covariance;
  for (std::size_t i = 0; i < SymmetricMatrix::kEntries; ++i) {
    const int row = SymmetricMatrix::kRow[i], column = SymmetricMatrix::kColumn[i];
    covariance.entries[i] =
        float(second_moment[i] / area - position[row] / area * (position[column] / area));
  }
  return covariance;
}

}  // namespace surfeit
