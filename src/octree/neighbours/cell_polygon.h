// A convex polygon around a place: its cell among its neighbours in a plane.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <span>

namespace surfeit {

// A cell so many times as long as wide is a rectangle. Disks along the line of a scan would
// overlap, and leave gaps between the lines; rectangles of random places would leave gaps at the
// corners of their cells. (Occlusion one spacing before random places with 2, 2.5 and 3: .0074,
// .0051, .0048 rms; before rows 3:1 as disks .016.)
inline constexpr float kLongCell = 2.5f;

// Of a cell: its middle, from its place, and means over it, of places (u, v) from its middle.
struct CellMoments {
  glm::vec2 middle{0};
  float square = 0;      // u^2 + v^2
  float difference = 0;  // u^2 - v^2
  float product = 0;     // u v

  // The same of means of places from the place.
  static CellMoments fromPlace(const glm::vec2& middle, float square, float difference,
                               float product) {
    const float uu = middle.x * middle.x, vv = middle.y * middle.y;
    return {middle, std::max(square - (uu + vv), 0.f), difference - (uu - vv),
            product - middle.x * middle.y};
  }

  // Of the rectangle with this area and these moments, if it is long; else zero.
  glm::vec2 longSide(float area) const {
    const float apart = std::hypot(difference, 2 * product);
    const float along = std::sqrt(0.5f * std::max(square + apart, 0.f));
    const float across = std::sqrt(0.5f * std::max(square - apart, 0.f));
    if (!(along > kLongCell * across && across > 0)) return glm::vec2(0);
    const float angle = 0.5f * std::atan2(2 * product, difference);
    return std::sqrt(along / across * area) * glm::vec2(std::cos(angle), std::sin(angle));
  }
};

// Around the origin, cut by the lines halfway to neighbours.
class CellPolygon {
 public:
  // A square with corners at (+-size, +-size).
  void begin(float size) {
    count_ = 4;
    reach_sq_ = 2 * size * size;
    corners_[0] = {-size, -size}, corners_[1] = {size, -size};
    corners_[2] = {size, size}, corners_[3] = {-size, size};
  }

  // Keeps what is nearer to the place than to `other`.
  bool cut(const glm::vec2& other) {
    const float limit = 0.5f * glm::dot(other, other);
    if (limit * 0.5f >= reach_sq_) return false;  // (|other| / 2)^2
    float beyond[kMostCorners];
    float farthest = 0;
    for (std::size_t i = 0; i < count_; ++i) {
      beyond[i] = glm::dot(corners_[i], other) - limit;
      farthest = std::max(farthest, beyond[i]);
    }
    if (farthest <= 0 || count_ + 1 >= kMostCorners) return false;
    return keepWithin(beyond);
  }

  std::span<const glm::vec2> corners() const { return std::span(corners_).first(count_); }
  // Whether of the places that cut each corner one is at least as far from the place as the corner.
  // Where the surface ends they lie on either side of the place, and the corner lies farther away.
  bool isSurroundedBy(std::span<const glm::vec2> cutters) const {
    constexpr float kRounding = 1e-3f;
    return std::all_of(
        corners_.begin(), corners_.begin() + std::ptrdiff_t(count_), [&](const glm::vec2& corner) {
          return std::any_of(cutters.begin(), cutters.end(), [&](const glm::vec2& cutter) {
            const float square = glm::dot(cutter, cutter);
            return glm::dot(corner, cutter) > (0.5f - kRounding) * square &&
                   square >= glm::dot(corner, corner);
          });
        });
  }
  float reach() const { return std::sqrt(reach_sq_); }
  float reachSq() const { return reach_sq_; }
  // Whether what is nearer to a corner than the place is lies within `radius` of there: only that
  // cuts the cell.
  bool mayCut(const glm::vec2& there, float radius) const {
    for (std::size_t i = 0; i < count_; ++i) {
      if (glm::length(there - corners_[i]) < glm::length(corners_[i]) + radius) return true;
    }
    return false;
  }
  bool wouldCut(const glm::vec2& there) const { return mayCut(there, -kTouching); }
  // Whether the halfway line to `other` is one of its sides, or goes through a corner.
  bool isOnSide(const glm::vec2& other) const {
    const float limit = (0.5f - kTouching) * glm::dot(other, other);
    return std::any_of(corners_.begin(), corners_.begin() + std::ptrdiff_t(count_),
                       [&](const glm::vec2& corner) { return glm::dot(corner, other) > limit; });
  }
  // Whether any side of the first square is left, which had corners at (+-size, +-size).
  bool touches(float size) const {
    for (std::size_t i = 0; i < count_; ++i) {
      const glm::vec2& corner = corners_[i];
      if (std::max(std::abs(corner.x), std::abs(corner.y)) > size * (1 - kTouching)) return true;
    }
    return false;
  }
  float area() const {
    float twice = 0;
    for (std::size_t i = 0; i < count_; ++i) {
      const glm::vec2 &a = corners_[i], &b = corners_[i + 1 == count_ ? 0 : i + 1];
      twice += a.x * b.y - a.y * b.x;
    }
    return 0.5f * twice;
  }
  CellMoments moments() const {
    float square = 0, difference = 0, product = 0;
    glm::vec2 middle(0);
    for (std::size_t i = 0; i < count_; ++i) {
      const glm::vec2 &a = corners_[i], &b = corners_[i + 1 == count_ ? 0 : i + 1];
      const float cross = a.x * b.y - a.y * b.x;
      const float xx = a.x * a.x + a.x * b.x + b.x * b.x;
      const float yy = a.y * a.y + a.y * b.y + b.y * b.y;
      middle += cross * (a + b);
      square += cross * (xx + yy);
      difference += cross * (xx - yy);
      product += cross * (a.x * a.y + 0.5f * (a.x * b.y + b.x * a.y) + b.x * b.y);
    }
    const float scale = 1 / (12 * area());
    return CellMoments::fromPlace(2 * scale * middle, scale * square, scale * difference,
                                  scale * product);
  }
  // Its width along a direction of unit length.
  float width(const glm::vec2& direction) const {
    float low = 0, high = 0;
    for (std::size_t i = 0; i < count_; ++i) {
      const float at = glm::dot(corners_[i], direction);
      low = std::min(low, at), high = std::max(high, at);
    }
    return high - low;
  }

 private:
  static constexpr float kTouching = 1e-4f;
  static constexpr std::size_t kMostCorners = 64;

  // Keeps the part with corners that are not beyond.
  bool keepWithin(const float* beyond) {
    std::array<glm::vec2, kMostCorners> kept;
    std::size_t kept_count = 0;
    float reach_sq = 0;
    const auto keep = [&](const glm::vec2& corner) {
      kept[kept_count++] = corner;
      reach_sq = std::max(reach_sq, glm::dot(corner, corner));
    };
    for (std::size_t i = 0; i < count_; ++i) {
      const std::size_t next = i + 1 == count_ ? 0 : i + 1;
      if (beyond[i] <= 0) keep(corners_[i]);
      if ((beyond[i] <= 0) != (beyond[next] <= 0) && kept_count < kMostCorners) {
        const float part = beyond[i] / (beyond[i] - beyond[next]);
        keep(corners_[i] + part * (corners_[next] - corners_[i]));
      }
    }
    if (kept_count < 3) return false;
    std::copy_n(kept.begin(), kept_count, corners_.begin());
    count_ = kept_count;
    reach_sq_ = reach_sq;
    return true;
  }

  std::array<glm::vec2, kMostCorners> corners_;
  std::size_t count_ = 0;
  float reach_sq_ = 0;  // of the farthest corner
};

}  // namespace surfeit
