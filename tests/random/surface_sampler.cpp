#include "random/surface_sampler.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>

namespace surfeit {
namespace {

constexpr double kHalfTurn = 3.141592653589793;

glm::dvec3 colorAt(const SamplingLook& look, const glm::dvec3& position) {
  return look.color * (.55 + .45 * glm::sin(look.waves * position));
}

double parallelogramArea(const glm::dvec3& half_u, const glm::dvec3& half_v) {
  return 4 * glm::length(glm::cross(half_u, half_v));
}

}  // namespace

std::string SamplingLook::describe() const {
  std::string text = is_two_sided ? ", two-sided" : "";
  if (is_scattered) text += ", scattered";
  if (jitter > 0) text += fmt::format(", jitter {:.1f}", jitter);
  if (position_noise > 0) text += fmt::format(", positions off by {:.2f} spacings", position_noise);
  if (normal_noise > 0) text += fmt::format(", normals by {:.2f} rad", normal_noise);
  return text;
}

SamplingLook randomLook(bool may_be_two_sided, RandomNumbers& random) {
  SamplingLook look;
  look.is_two_sided = random.chance(.3) && may_be_two_sided;
  const double regular = random.unit();
  look.jitter = regular < .5 ? 0 : random.between(.1, .9);
  look.is_scattered = regular > .9;
  if (random.chance(.2)) look.position_noise = random.logBetween(.02, .5);
  if (random.chance(.2)) look.normal_noise = random.logBetween(.02, .4);
  look.radius_by_area = random.chance(.3);
  look.color = random.color(.05, 1);
  if (random.chance(.6)) look.waves = random.color(0, 8);
  return look;
}

CellGrid::CellGrid(const ShapePatch& patch, int columns, int rows)
    : columns_(columns), rows_(rows) {
  // Each spacing is a constant factor longer than the one before
  const double factor = std::sqrt(patch.grading);
  const auto graded = [factor](double part) {
    return factor > 1 ? (std::pow(factor, part) - 1) / (factor - 1) : part;
  };
  for (int row = 0; row <= rows; ++row) {
    const double v = graded(double(row) / rows);
    for (int column = 0; column <= columns; ++column) {
      corners_.push_back(patch.at(graded(double(column) / columns), v));
    }
  }
}

SurfaceSite CellGrid::site(int column, int row, double s, double t) const {
  const glm::dvec3 a = corner(column, row), d = corner(column + 1, row + 1);
  const glm::dvec3 between = s > t ? corner(column + 1, row) : corner(column, row + 1);
  SurfaceSite site;
  site.position = a + std::max(s, t) * (between - a) + std::min(s, t) * (d - between);
  const glm::dvec3 normal = glm::cross(between - a, d - a);
  site.normal = glm::normalize(s > t ? normal : -normal);
  site.spacing = std::sqrt(cellArea(column, row));
  return site;
}

double CellGrid::cellArea(int column, int row) const {
  const glm::dvec3 across = corner(column + 1, row + 1) - corner(column, row);
  return .5 * glm::length(glm::cross(across, corner(column, row + 1) - corner(column + 1, row)));
}

double CellGrid::cellRadius(int column, int row) const {
  glm::dvec3 middle(0);
  for (int i = 0; i < 4; ++i) middle += .25 * corner(column + i % 2, row + i / 2);
  double radius = 0;
  for (int i = 0; i < 4; ++i) {
    radius = std::max(radius, glm::length(corner(column + i % 2, row + i / 2) - middle));
  }
  return radius;
}

void sampleGrid(const CellGrid& grid, const SamplingLook& look, RandomNumbers& random,
                std::vector<SampledSurfel>& surfels) {
  const int count = grid.columns() * grid.rows();
  for (int i = 0; i < count; ++i) {
    const int cell = look.is_scattered ? random.below(count) : i;
    const int column = cell % grid.columns(), row = cell / grid.columns();
    const double width = look.is_scattered ? 1 : look.jitter;
    const double s = .5 + width * (random.unit() - .5);
    const double t = .5 + width * (random.unit() - .5);
    const SurfaceSite site = grid.site(column, row, s, t);
    SampledSurfel& surfel = surfels.emplace_back();
    surfel.area = grid.cellArea(column, row);
    surfel.radius = look.radius_by_area || look.is_scattered
                        ? std::sqrt(2 * surfel.area / kHalfTurn)
                        : grid.cellRadius(column, row);
    surfel.radiosity = colorAt(look, site.position);
    surfel.is_two_sided = look.is_two_sided;
    const double rise = look.position_noise * random.bell();
    surfel.position = site.position + rise * site.spacing * site.normal;
    const glm::dvec3 tilt = random.direction();
    surfel.normal = glm::normalize(site.normal + look.normal_noise * tilt);
  }
}

void sampleLeaf(const ShapeLeaf& leaf, const SamplingLook& look,
                std::vector<SampledSurfel>& surfels) {
  SampledSurfel& surfel = surfels.emplace_back();
  surfel.position = leaf.middle;
  surfel.normal = glm::normalize(glm::cross(leaf.half_u, leaf.half_v));
  surfel.area = parallelogramArea(leaf.half_u, leaf.half_v);
  surfel.radius = glm::length(leaf.half_u + leaf.half_v);
  if (leaf.is_ribbon) surfel.long_side = 2. * leaf.half_u;
  surfel.radiosity = colorAt(look, leaf.middle);
  surfel.is_two_sided = true;
}

void samplePoint(const ShapePoint& point, const SamplingLook& look,
                 std::vector<SampledSurfel>& surfels) {
  SampledSurfel& surfel = surfels.emplace_back();
  surfel.position = point.middle;
  surfel.radius = point.radius;
  surfel.area = kHalfTurn * point.radius * point.radius;
  surfel.radiosity = colorAt(look, point.middle);
}

}  // namespace surfeit
