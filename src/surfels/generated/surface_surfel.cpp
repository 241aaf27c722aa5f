#include "surfels/generated/surface_surfel.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "core/square_strata.h"

// This file is compiled without contraction of a * b + c (src/io/CMakeLists.txt), and uses no
// function of the mathematical library but sqrt, so that surfels are the same on every machine.

namespace surfeit {
namespace {

constexpr double kQuarterPi = 0.78539816339744830962;
constexpr double kPiInverse = 0.31830988618379067154;
// A cell is known by its derivatives in its middle; this much wider, a disk covers it for certain.
constexpr double kCoverMargin = 1.03;

// Light: a sun, and a sky that is brighter above than below. Irradiance in scene-linear rgb.
const glm::vec3 kSunDirection(0.48f, -0.36f, 0.8f);
const glm::vec3 kSunIrradiance(2.4f, 2.25f, 2.0f);
const glm::vec3 kSkyIrradiance(0.55f, 0.68f, 0.9f);

// A point of a surface with the directions of its derivatives by u and v.
struct SurfacePoint {
  glm::dvec3 position{0}, along_u{0}, along_v{0};
};

// Sine and cosine of t * pi / 4 for |t| <= 1, to 2e-9.
void sinCosOfEighths(double t, double& sine, double& cosine) {
  const double x = t * kQuarterPi, y = x * x;
  sine = x * (1 - y / 6 * (1 - y / 20 * (1 - y / 42 * (1 - y / 72))));
  cosine = 1 - y / 2 * (1 - y / 12 * (1 - y / 30 * (1 - y / 56 * (1 - y / 90))));
}

// A point of the unit disc in polar form, and how far a step of u or v leads along and across the
// radius. Shirley and Chiu's concentric map of the square -1..1, which keeps ratios of area.
struct DiscPoint {
  double radius, cosine, sine;
  double radial_u, across_u, radial_v, across_v;
};

DiscPoint concentricDisc(double u, double v) {
  const double a = 2 * u - 1, b = 2 * v - 1;
  const bool is_wide = std::abs(a) > std::abs(b);  // left or right quarter; else top or bottom
  const double radius = is_wide ? a : b, other = is_wide ? b : a;
  const double ratio = radius != 0 ? other / radius : 0;
  double sine, cosine;
  sinCosOfEighths(ratio, sine, cosine);
  DiscPoint point;
  point.radius = radius;
  // d(radius) = 2 along the axis of the quarter; the angle is pi/4 other / radius
  const double across_main = -2 * kQuarterPi * ratio, across_other = 2 * kQuarterPi;
  if (is_wide) {
    point.cosine = cosine, point.sine = sine;
    point.radial_u = 2, point.across_u = across_main;
    point.radial_v = 0, point.across_v = across_other;
  } else {
    point.cosine = sine, point.sine = cosine;
    point.radial_u = 0, point.across_u = -across_other;
    point.radial_v = 2, point.across_v = -across_main;
  }
  return point;
}

// A point of the unit hemisphere about z: the disc, lifted by Lambert's map, which keeps area too.
// A step along the radius stretches to 2 / w of its length, and one across it to w.
struct HemispherePoint {
  glm::dvec3 position{0};
  DiscPoint disc;
  double lift = 1;  // w = sqrt(2 - radius^2)
};

HemispherePoint lambertHemisphere(double u, double v) {
  HemispherePoint point;
  point.disc = concentricDisc(u, v);
  const double radius = point.disc.radius, radius_sq = radius * radius;
  point.lift = std::sqrt(2 - radius_sq);
  point.position = {radius * point.lift * point.disc.cosine, radius * point.lift * point.disc.sine,
                    1 - radius_sq};
  return point;
}

double lengthOf(const glm::dvec3& v) { return std::sqrt(v.x * v.x + v.y * v.y + v.z * v.z); }

// Half the longer diagonal of the parallelogram of two sides, given by squares and product.
double halfDiagonal(double u_sq, double v_sq, double u_dot_v) {
  return 0.5 * std::sqrt(u_sq + v_sq + 2 * std::abs(u_dot_v));
}

// Steps of a cell, the one across the rows longer by as much as the middle may be off.
struct CellReach {
  explicit CellReach(const Stratum& cell) : u(cell.du), v(cell.dv * (1 + 2 * kRowJitter)) {}
  double u, v;
};

// A radius that reaches over the cell, and is no smaller than that of a square of the area.
float coveringRadius(double half_diagonal, double area) {
  return float(std::max(half_diagonal * kCoverMargin, std::sqrt(0.5 * area)));
}

glm::vec3 unitNormal(const glm::dvec3& direction) {
  const double length = lengthOf(direction);
  return {float(direction.x / length), float(direction.y / length), float(direction.z / length)};
}

// A direction of the upper hemisphere, uniform.
glm::dvec3 randomDirection(std::uint64_t hash) {
  return lambertHemisphere(unitFromBits(hash, 0), unitFromBits(hash, 16)).position;
}

// Two directions that are orthogonal to a unit vector with z >= 0 and to each other (Duff et al.
// 2017, "Building an orthonormal basis, revisited").
void orthonormalBasis(const glm::dvec3& n, glm::dvec3& x, glm::dvec3& y) {
  const double a = -1 / (1 + n.z), b = n.x * n.y * a;
  x = {1 + n.x * n.x * a, b, -n.x};
  y = {b, 1 + n.y * n.y * a, -n.y};
}

glm::vec3 irradianceOf(const glm::vec3& normal) {
  const float cosine =
      normal.x * kSunDirection.x + normal.y * kSunDirection.y + normal.z * kSunDirection.z;
  return std::max(cosine, 0.0f) * kSunIrradiance + (0.5f + 0.5f * normal.z) * kSkyIrradiance;
}

// Part of 0..1 that lies behind the last whole number.
float fractionOf(float value) { return value - float(std::int32_t(value)); }

glm::vec3 facadeAlbedo(const Surface& surface, double u, double v) {
  const float across = float(u) * float(surface.tiles_u), up = float(v) * float(surface.tiles_v);
  const float x = fractionOf(across), y = fractionOf(up);
  if (x < 0.22f || x > 0.78f || y < 0.3f || y > 0.82f) return surface.albedo;
  // Panes, and here and there a drawn blind
  const std::uint64_t window =
      (std::uint64_t(std::int32_t(across)) << 32) + std::uint64_t(std::int32_t(up));
  const bool has_blind = unitFromBits(hashOf(surface.tiles_u, window), 0) < 0.15;
  return has_blind ? glm::vec3(0.5f, 0.48f, 0.42f) : glm::vec3(0.05f, 0.07f, 0.10f);
}

glm::vec3 streetAlbedo(const Surface& surface, const glm::vec3& position) {
  // Metres from the middle of the street, along either axis
  constexpr float kLot = float(kLotExtent);
  const float x = kLot * std::abs(fractionOf(position.x / kLot + 0.5f) - 0.5f);
  const float y = kLot * std::abs(fractionOf(position.y / kLot + 0.5f) - 0.5f);
  const float nearest = std::min(x, y);
  if (nearest > 5) return surface.albedo;
  if (nearest > 3.2f) return glm::vec3(0.42f, 0.41f, 0.39f);  // pavement
  const bool has_mark = nearest < 0.12f && fractionOf(0.2f * std::max(x, y)) < 0.5f;
  return has_mark ? glm::vec3(0.75f) : glm::vec3(0.09f, 0.09f, 0.095f);
}

glm::vec3 hillAlbedo(const Surface& surface, const glm::vec3& position, const glm::vec3& normal) {
  if (normal.z < 0.82f) return glm::vec3(0.33f, 0.30f, 0.27f);                     // rock
  if (position.z > 75 && normal.z > 0.88f) return glm::vec3(0.83f, 0.85f, 0.88f);  // snow
  return surface.albedo;
}

glm::vec3 albedoAt(const Surface& surface, double u, double v, const Surfel& surfel) {
  switch (surface.material) {
    case SurfaceMaterial::kPlain:
      break;
    case SurfaceMaterial::kFacade:
      return facadeAlbedo(surface, u, v);
    case SurfaceMaterial::kStreets:
      return streetAlbedo(surface, surfel.position);
    case SurfaceMaterial::kHills:
      return hillAlbedo(surface, surfel.position, surfel.normal);
  }
  return surface.albedo;
}

// Albedo with a little noise, and the light that it sends on.
void addColor(const glm::vec3& albedo, const glm::vec3& irradiance, std::uint64_t hash,
              Surfel& surfel) {
  const float noise = 0.9f + 0.2f * float(unitFromBits(hash, kStratumHashBits));
  surfel.albedo = glm::min(noise * albedo, glm::vec3(1));
  surfel.radiosity = surfel.albedo * irradiance;
}

// The cell of a bilinear surface.
Surfel bilinearSurfel(const Surface& surface, const Stratum& cell, double area,
                      std::uint64_t hash) {
  const glm::dvec3 edge_u(surface.edge_u), edge_v(surface.edge_v), edge_w(surface.edge_w);
  const glm::dvec3 along_u = edge_u + cell.v * edge_w, along_v = edge_v + cell.u * edge_w;
  const glm::dvec3 across(along_u.y * along_v.z - along_u.z * along_v.y,
                          along_u.z * along_v.x - along_u.x * along_v.z,
                          along_u.x * along_v.y - along_u.y * along_v.x);
  const double density = lengthOf(across);
  Surfel surfel;
  surfel.position = glm::vec3(glm::dvec3(surface.origin) + cell.u * along_u + cell.v * edge_v);
  surfel.normal = {float(across.x / density), float(across.y / density), float(across.z / density)};
  const double surfel_area = area * density / double(surface.area);
  surfel.area = float(surfel_area);
  const CellReach reach(cell);
  const glm::dvec3 u = reach.u * along_u, v = reach.v * along_v;
  surfel.radius = coveringRadius(
      halfDiagonal(u.x * u.x + u.y * u.y + u.z * u.z, v.x * v.x + v.y * v.y + v.z * v.z,
                   u.x * v.x + u.y * v.y + u.z * v.z),
      surfel_area);
  addColor(albedoAt(surface, cell.u, cell.v, surfel), irradianceOf(surfel.normal), hash, surfel);
  return surfel;
}

// Half the longer diagonal of a cell on the disc, whose radius and circumference are stretched.
double discHalfDiagonal(const DiscPoint& disc, const CellReach& reach, double along,
                        double across) {
  const double u_along = reach.u * disc.radial_u * along,
               u_across = reach.u * disc.across_u * across;
  const double v_along = reach.v * disc.radial_v * along,
               v_across = reach.v * disc.across_v * across;
  return halfDiagonal(u_along * u_along + u_across * u_across,
                      v_along * v_along + v_across * v_across,
                      u_along * v_along + u_across * v_across);
}

Surfel hemisphereSurfel(const Surface& surface, const Stratum& cell, double area,
                        std::uint64_t hash) {
  const HemispherePoint point = lambertHemisphere(cell.u, cell.v);
  const glm::dvec3 outwards = point.position.x * glm::dvec3(surface.edge_u) +
                              point.position.y * glm::dvec3(surface.edge_v) +
                              point.position.z * glm::dvec3(surface.edge_w);
  Surfel surfel;
  surfel.position = glm::vec3(glm::dvec3(surface.origin) + outwards);
  surfel.normal = unitNormal(outwards);
  surfel.area = float(area);
  const double sphere_radius = double(surface.edge_u.x);
  surfel.radius = coveringRadius(
      sphere_radius * discHalfDiagonal(point.disc, CellReach(cell), 2 / point.lift, point.lift),
      area);
  addColor(surface.albedo, irradianceOf(surfel.normal), hash, surfel);
  return surfel;
}

// A leaf of a crown: centre and normal, the same at every density. Leaves come in rows around the
// upper half and then the lower half of the crown, at random depths.
struct Leaf {
  glm::dvec3 centre{0}, normal{0};
};

Leaf leafOf(const Surface& surface, std::uint64_t key, std::uint64_t number) {
  // Where in its half
  const std::uint64_t upper = (surface.leaves + 1) / 2;
  const bool is_upper = number < upper;
  const std::uint64_t index = is_upper ? number : number - upper;
  const std::uint64_t count = is_upper ? upper : surface.leaves - upper;
  const std::uint64_t leaf_key = key ^ (is_upper ? 0x75u : 0x6Cu);
  const std::uint64_t hash = hashOf(leaf_key, index);
  const Share row = shareOf(index, count, stratumRows(count, 1));
  const Stratum cell = squareStratum(row, index, count, leaf_key, hash);

  // The greatest of three has the distribution of the distance from the centre of a full ball
  const std::uint64_t more = mixBits(hash);
  const double depth =
      std::max(unitFromBits(more, 0), std::max(unitFromBits(more, 16), unitFromBits(more, 32)));
  const glm::dvec3 at = depth * lambertHemisphere(cell.u, cell.v).position;
  Leaf leaf;
  leaf.centre = glm::dvec3(surface.origin) + at.x * glm::dvec3(surface.edge_u) +
                at.y * glm::dvec3(surface.edge_v) +
                (is_upper ? at.z : -at.z) * glm::dvec3(surface.edge_w);
  leaf.normal = randomDirection(mixBits(more));
  return leaf;
}

// Both sides of a leaf are lit, and each sends half of what both receive, as translucent leaves do.
glm::vec3 leafIrradiance(const glm::vec3& normal) {
  return 0.5f * (irradianceOf(normal) + irradianceOf(-normal));
}

// Surfel `index` of the `count` of a crown: some leaves, of which it takes the place of the middle
// one, or where there are more surfels than leaves, a cell of one leaf. `area` is the mean of all.
Surfel crownSurfel(const Surface& surface, std::uint64_t key, std::uint64_t index,
                   std::uint64_t count, double area) {
  Surfel surfel;
  std::uint64_t hash = hashOf(key, index);
  surfel.flags = kSurfelTwoSided;
  if (count <= surface.leaves) {
    const std::uint64_t begin = index * surface.leaves / count;
    const std::uint64_t end = (index + 1) * surface.leaves / count;
    const Leaf leaf = leafOf(surface, key, (begin + end) / 2);
    surfel.position = glm::vec3(leaf.centre);
    surfel.normal = unitNormal(leaf.normal);
    surfel.area = float(area);
    surfel.radius = float(std::sqrt(area * kPiInverse));
  } else {
    const Share share = shareOf(index, count, surface.leaves);
    const std::uint64_t cells = share.end - share.begin, cell_index = index - share.begin;
    const std::uint64_t leaf_key = mixBits(key + share.part);
    hash = hashOf(leaf_key, cell_index);
    const Share row = shareOf(cell_index, cells, stratumRows(cells, 1));
    const Stratum cell = squareStratum(row, cell_index, cells, leaf_key, hash);
    const DiscPoint disc = concentricDisc(cell.u, cell.v);

    const Leaf leaf = leafOf(surface, key, share.part);
    glm::dvec3 x, y;
    orthonormalBasis(leaf.normal, x, y);
    const double leaf_radius = double(surface.leaf_radius);
    surfel.position =
        glm::vec3(leaf.centre + leaf_radius * disc.radius * (disc.cosine * x + disc.sine * y));
    surfel.normal = unitNormal(leaf.normal);
    // The leaf's part of the crown, and the cell's part of the leaf
    const double cell_area = area * double(count) / double(surface.leaves) * cell.du * cell.dv;
    surfel.area = float(cell_area);
    surfel.radius =
        coveringRadius(leaf_radius * discHalfDiagonal(disc, CellReach(cell), 1, 1), cell_area);
  }
  addColor(surface.albedo, leafIrradiance(surfel.normal), hash, surfel);
  return surfel;
}

// Sphere `index` of the `count` of a haze: layers, and each of them as a square.
Surfel hazeSurfel(const Surface& surface, std::uint64_t key, std::uint64_t index,
                  std::uint64_t count, std::uint64_t layers, double area) {
  const Share layer = shareOf(index, count, layers);
  const std::uint64_t in_layer = layer.end - layer.begin, place = index - layer.begin;
  const std::uint64_t layer_key = mixBits(key + layer.part);
  const std::uint64_t hash = hashOf(layer_key, place);
  const Share row = shareOf(place, in_layer, stratumRows(in_layer, 1));
  const Stratum cell = squareStratum(row, place, in_layer, layer_key, hash);
  const double w =
      (double(layer.begin) + unitFromBits(mixBits(hash), 0) * double(in_layer)) / double(count);

  Surfel surfel;
  surfel.flags = kSurfelSphere;
  surfel.position = glm::vec3(glm::dvec3(surface.origin) + cell.u * glm::dvec3(surface.edge_u) +
                              cell.v * glm::dvec3(surface.edge_v) + w * glm::dvec3(surface.edge_w));
  surfel.area = float(area);
  surfel.radius = float(std::sqrt(area * kPiInverse));
  addColor(surface.albedo, 0.25f * kSunIrradiance + 0.5f * kSkyIrradiance, hash, surfel);
  return surfel;
}

// The greatest number whose cube is at most `count`.
std::uint64_t cubeRoot(std::uint64_t count) {
  std::uint64_t root = 1;
  while ((root + 1) * (root + 1) * (root + 1) <= count) ++root;
  return root;
}

}  // namespace

std::uint64_t cellRows(const Surface& surface, std::uint64_t count) {
  if (surface.shape == SurfaceShape::kHaze) return cubeRoot(count);
  if (surface.shape != SurfaceShape::kBilinear) return stratumRows(count, 1);
  return stratumRows(count,
                     lengthOf(glm::dvec3(surface.edge_v)) / lengthOf(glm::dvec3(surface.edge_u)));
}

Surfel makeSurfaceSurfel(const Surface& surface, const SurfaceShare& share, std::uint64_t index) {
  const auto [key, count, rows, mean_area] = share;
  if (surface.shape == SurfaceShape::kCrown) {
    return crownSurfel(surface, key, index, count, mean_area);
  }
  if (surface.shape == SurfaceShape::kHaze) {
    return hazeSurfel(surface, key, index, count, rows, mean_area);
  }
  const std::uint64_t hash = hashOf(key, index);
  const Share row = shareOf(index, count, rows);
  const Stratum cell = squareStratum(row, index, count, key, hash);
  const double area = mean_area * double(count) * cell.du * cell.dv;
  return surface.shape == SurfaceShape::kHemisphere ? hemisphereSurfel(surface, cell, area, hash)
                                                    : bilinearSurfel(surface, cell, area, hash);
}

}  // namespace surfeit
