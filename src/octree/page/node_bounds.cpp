// Everything is in double and rounded outwards when it becomes a float or a byte. Sines come from
// differences of unit vectors: 1 - cos^2 of floats says nothing of angles below a milliradian.
#include "octree/page/node_bounds.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <limits>

#include "octree/page/surfel_group.h"

namespace surfeit {
namespace {

constexpr double kHalfTurn = 3.14159265358979323846;

// What users may lose by computing in floats: a part of the radius, and of a cosine.
constexpr double kPlaceMargin = 1e-6, kCosineMargin = 3e-7;

// The direction of a normal, to more digits than a unit vector of floats has; zero of zero.
glm::dvec3 directionOf(const glm::vec3& normal) {
  const glm::dvec3 n(normal);
  const double length_sq = glm::dot(n, n);
  return length_sq > 0 ? n / std::sqrt(length_sq) : n;
}

bool isZero(const glm::dvec3& v) { return v.x == 0 && v.y == 0 && v.z == 0; }

// Of two unit vectors whose difference has this length.
double angleOf(double chord) { return 2 * std::asin(std::min(chord / 2, 1.0)); }
double sineOf(double chord_sq) { return std::sqrt(std::max(chord_sq * (1 - chord_sq / 4), 0.0)); }

float roundedUp(double value) {
  return std::nextafter(float(value), std::numeric_limits<float>::infinity());
}

void setThickness(double thickness, Node& node) {
  node.thickness = std::min(roundedUp(thickness), node.radius);
}
void setAngle(double angle, LevelNode& node) {
  node.normal_angle = angle < kHalfTurn ? roundedUp(angle) : kUnknownAngle;
}

void forget(LevelNode& node) {
  node.node.forgetBounds();
  node.normal_angle = kUnknownAngle;
}

// Cosines of the codes: fine where angles are small, and no slack at all at 255.
const std::array<float, 256>& coneCosines() {
  static const std::array<float, 256> cosines = [] {
    std::array<float, 256> all;
    for (std::size_t code = 0; code < all.size(); ++code) {
      const double root = double(code) / 255;
      all[code] = float(std::cos(kHalfTurn * root * root));
    }
    return all;
  }();
  return cosines;
}

std::uint8_t coneCode(double angle) {
  const std::array<float, 256>& cosines = coneCosines();
  const double cosine = angle < kHalfTurn ? std::cos(angle) - kCosineMargin : -1;
  const auto code = std::lower_bound(cosines.begin(), cosines.end(), cosine,
                                     [](float of_code, double c) { return double(of_code) > c; });
  return static_cast<std::uint8_t>(std::min<std::ptrdiff_t>(code - cosines.begin(), 255));
}

// Not a number, where a damaged node has none: 255.
std::uint8_t thicknessCode(double thickness, double radius) {
  const double code = std::ceil(255 * (thickness / radius + kPlaceMargin));
  return code < 255 ? static_cast<std::uint8_t>(std::max(code, 0.0)) : 255;
}

}  // namespace

double supportOf(const Node& node, const glm::dvec3& direction) {
  const glm::dvec3 n = directionOf(node.normal);
  const double radius = double(node.radius), thickness = double(node.thickness);
  const double cosine = std::abs(glm::dot(n, direction));
  if (radius * cosine <= thickness) return radius;
  // On the rim, where slab and sphere meet
  const double rim = std::sqrt(std::max(radius * radius - thickness * thickness, 0.0));
  return thickness * cosine + rim * glm::length(glm::cross(n, direction));
}

// A disk reaches radius times the sine of its tilt out of a slab. Normals are of unit length within
// 1e-7, which kNormalLoss has room for.
void boundSurfels(std::span<const Surfel> surfels, LevelNode& leaf) {
  forget(leaf);
  Node& node = leaf.node;
  const glm::dvec3 n = directionOf(node.normal), centre(node.position);
  if (isZero(n)) return;
  double thickness = 0, most_chord_sq = 0;
  bool has_cone = true;
  for (const Surfel& surfel : surfels) {
    const glm::dvec3 difference = glm::dvec3(surfel.normal) - n;
    const double chord_sq = glm::dot(difference, difference);
    const double tilt = surfel.isSphere() ? 1 : std::min(sineOf(chord_sq) + kNormalLoss, 1.0);
    const double middle = std::abs(glm::dot(glm::dvec3(surfel.position) - centre, n));
    thickness = std::max(thickness, middle + positionLoss(surfel) +
                                        double(surfel.radius) * (1 + kRadiusLoss) * tilt);
    has_cone = has_cone && !surfel.isSphere() && !surfel.isTwoSided();
    most_chord_sq = std::max(most_chord_sq, chord_sq);
  }
  setThickness(thickness, node);
  if (has_cone) setAngle(angleOf(std::sqrt(most_chord_sq)) + kNormalLoss, leaf);
}

// What lies below a child lies in its sphere and its slab, and in its cone.
void boundChildren(std::span<const LevelNode> children, LevelNode& parent) {
  forget(parent);
  Node& node = parent.node;
  const glm::dvec3 n = directionOf(node.normal), centre(node.position);
  if (isZero(n)) return;
  double thickness = 0, angle = 0;
  for (const LevelNode& child : children) {
    const double middle = std::abs(glm::dot(glm::dvec3(child.node.position) - centre, n));
    thickness = std::max(thickness, middle + supportOf(child.node, n));
    const double turn = angleOf(glm::distance(directionOf(child.node.normal), n));
    angle = std::max(angle, turn + double(child.normal_angle));
  }
  setThickness(thickness, node);
  setAngle(angle, parent);
}

BoundCodes boundCodes(const LevelNode& level_node, const glm::vec3& position,
                      const glm::vec3& normal) {
  const Node& node = level_node.node;
  const glm::dvec3 n = directionOf(normal), before = directionOf(node.normal);
  if (isZero(n) || isZero(before)) return {};
  const double moved = std::abs(glm::dot(glm::dvec3(node.position) - glm::dvec3(position), n));
  const double angle = double(level_node.normal_angle) + angleOf(glm::distance(before, n));
  return {thicknessCode(supportOf(node, n) + moved, double(node.radius)), coneCode(angle)};
}

void setBounds(BoundCodes codes, Node& node) {
  node.forgetBounds();
  if (node.normal == glm::vec3(0)) return;
  if (codes.thickness < 255) node.thickness = node.radius * (float(codes.thickness) / 255);
  node.normal_cosine = coneCosines()[codes.cone];
}

}  // namespace surfeit
