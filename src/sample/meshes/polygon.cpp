#include "sample/meshes/polygon.h"

#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>

namespace surfeit {
namespace {

// Twice the signed area of a triangle.
double turn(const glm::dvec2& a, const glm::dvec2& b, const glm::dvec2& c) {
  return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

// The sum of all triangles of the first corner: across the polygon, twice its area long.
glm::dvec3 acrossPolygon(std::span<const glm::dvec3> corners) {
  glm::dvec3 sum(0);
  for (std::size_t i = 2; i < corners.size(); ++i) {
    sum += glm::cross(corners[i - 1] - corners[0], corners[i] - corners[0]);
  }
  return sum;
}

// Seen along the axis that the polygon faces most; counter-clockwise.
std::vector<glm::dvec2> flatten(std::span<const glm::dvec3> corners, const glm::dvec3& across) {
  int axis = 0;
  for (int i = 1; i < 3; ++i) {
    if (std::abs(across[i]) > std::abs(across[axis])) axis = i;
  }
  const int first = (axis + 1) % 3, second = (axis + 2) % 3;
  const double side = across[axis] < 0 ? -1 : 1;
  std::vector<glm::dvec2> flat;
  flat.reserve(corners.size());
  for (const glm::dvec3& corner : corners) flat.emplace_back(side * corner[first], corner[second]);
  return flat;
}

// Cuts ears off until nothing is left.
class EarCutter {
 public:
  EarCutter(std::vector<glm::dvec2> corners, std::vector<glm::uvec3>& triangles)
      : corners_(std::move(corners)), triangles_(triangles) {
    const std::uint32_t count = std::uint32_t(corners_.size());
    for (std::uint32_t i = 0; i < count; ++i) {
      next_.push_back((i + 1) % count);
      previous_.push_back((i + count - 1) % count);
    }
  }

  bool cutAll() {
    std::size_t left = corners_.size(), refused = 0;
    bool is_simple = true;
    for (std::uint32_t at = 0; left > 2;) {
      // Who goes round without an ear, or looks at all corners too often, takes what there is
      const bool is_forced = refused == left || tests_ > kMostTests;
      if (!is_forced && !isEar(at)) {
        at = next_[at];
        ++refused;
        continue;
      }
      is_simple = is_simple && !is_forced;
      at = cutOff(at);
      --left;
      refused = 0;
    }
    return is_simple;
  }

 private:
  // Half a second's work, which simple polygons of ten thousand corners do not need.
  static constexpr std::uint64_t kMostTests = std::uint64_t{1} << 28;

  // May the triangle of a corner and its neighbours go? Without area it may: nothing is lost.
  bool isEar(std::uint32_t at) {
    const std::uint32_t from = previous_[at], to = next_[at];
    const glm::dvec2 &a = corners_[from], &b = corners_[at], &c = corners_[to];
    const double area = turn(a, b, c);
    if (!(area > 0)) return area == 0;
    for (std::uint32_t i = next_[to]; i != from; i = next_[i]) {
      ++tests_;
      const glm::dvec2& p = corners_[i];
      if (p == a || p == b || p == c) continue;  // edges may touch
      if (turn(a, b, p) >= 0 && turn(b, c, p) >= 0 && turn(c, a, p) >= 0) return false;
    }
    return true;
  }

  // Returns the corner to go on with: the one after the next, so that ears are taken all around.
  std::uint32_t cutOff(std::uint32_t at) {
    const std::uint32_t from = previous_[at], to = next_[at];
    if (turn(corners_[from], corners_[at], corners_[to]) != 0)
      triangles_.emplace_back(from, at, to);
    next_[from] = to;
    previous_[to] = from;
    return next_[to];
  }

  std::vector<glm::dvec2> corners_;
  std::vector<glm::uvec3>& triangles_;
  std::vector<std::uint32_t> next_, previous_;
  std::uint64_t tests_ = 0;
};

}  // namespace

bool cutPolygon(std::span<const glm::dvec3> corners, std::vector<glm::uvec3>& triangles) {
  const glm::dvec3 across = acrossPolygon(corners);
  bool is_fan = true;
  for (std::size_t i = 2; i < corners.size() && is_fan; ++i) {
    const glm::dvec3 part = glm::cross(corners[i - 1] - corners[0], corners[i] - corners[0]);
    is_fan = glm::dot(part, across) >= 0;
  }
  if (is_fan) {
    for (std::uint32_t i = 2; i < corners.size(); ++i) triangles.emplace_back(0, i - 1, i);
    return true;
  }
  return EarCutter(flatten(corners, across), triangles).cutAll();
}

}  // namespace surfeit
