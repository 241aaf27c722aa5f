#include "octree/build/hidden_surfels.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <limits>
#include <utility>
#include <vector>

#include "core/spherical_harmonics.h"
#include "core/symmetric_matrix.h"
#include "core/thread_scratch.h"
#include "octree/node/area_sums.h"
#include "octree/node/facet_sums.h"
#include "octree/node/hidden_layers.h"

namespace surfeit {
namespace {

// Fewer places tell nothing: by chance, heights of six surfels of a rough surface look like sheets
// 1 time in 25, of twelve 1 time in 1000.
constexpr std::size_t kFewestPlaces = 12;
constexpr std::size_t kMostSheets = 6;
// Sheets are looked for where so much of the area lies behind the rest.
constexpr float kLeastHidden = 0.125f;
// Of its outline, a sheet without gaps fills so much: as Fidelity::least_filled.
constexpr float kLeastFilled = 0.7f;
// Directions of a cell in which sheets are looked for: a room has six.
constexpr std::size_t kMostFacings = 8;

struct Height {
  float height;
  std::uint32_t surfel;
  float area = 0;
  glm::vec2 aside{0};  // its place along the sheets
  bool operator<(const Height& other) const { return height > other.height; }  // front first
};

// Sorted heights as sheets with clear gaps between them, as many as there are.
class HeightGaps {
 public:
  explicit HeightGaps(std::span<const Height> heights) : heights_(heights) {
    std::array<std::size_t, kMostSheets - 1> gaps{};  // the widest first
    std::size_t gap_count = 0;
    for (std::size_t i = 1; i < heights.size(); ++i) {
      std::size_t at = gap_count;
      while (at > 0 && gapBefore(gaps[at - 1]) < gapBefore(i)) --at;
      if (at == gaps.size()) continue;
      gap_count = std::min(gap_count + 1, gaps.size());
      std::copy_backward(gaps.begin() + std::ptrdiff_t(at),
                         gaps.begin() + std::ptrdiff_t(gap_count) - 1,
                         gaps.begin() + std::ptrdiff_t(gap_count));
      gaps[at] = i;
    }
    ends_[0] = heights.size();
    for (std::size_t count = gap_count; count > 0 && count_ == 1; --count) {
      divide(std::span(gaps).first(count));
    }
  }

  std::size_t count() const { return count_; }
  std::span<const Height> at(std::size_t i) const {
    const std::size_t begin = i == 0 ? 0 : ends_[i - 1];
    return heights_.subspan(begin, ends_[i] - begin);
  }

 private:
  float gapBefore(std::size_t i) const { return heights_[i - 1].height - heights_[i].height; }

  // By these gaps, the narrowest last, if all are clear.
  void divide(std::span<const std::size_t> gaps) {
    std::array<std::size_t, kMostSheets> ends{};
    for (std::size_t i = 0; i < gaps.size(); ++i) {
      std::size_t at = i;
      for (; at > 0 && ends[at - 1] > gaps[i]; --at) ends[at] = ends[at - 1];
      ends[at] = gaps[i];
    }
    ends[gaps.size()] = heights_.size();
    const float narrowest = gapBefore(gaps.back());
    for (std::size_t i = 0, begin = 0; i <= gaps.size(); begin = ends[i++]) {
      const float thickness = heights_[begin].height - heights_[ends[i] - 1].height;
      if (!(narrowest > kClearGap * thickness)) return;
    }
    ends_ = ends;
    count_ = gaps.size() + 1;
  }

  const std::span<const Height> heights_;
  std::array<std::size_t, kMostSheets> ends_{};
  std::size_t count_ = 1;
};

// That of surfels which face about alike.
struct Direction {
  glm::vec3 normal{0};
  bool is_two_sided = false;

  // Within 10 degrees, those with two sides to either side.
  bool holds(const Surfel& surfel) const {
    if (surfel.isTwoSided() != is_two_sided) return false;
    const float cosine = glm::dot(normal, surfel.normal);
    return (cosine > 0 || is_two_sided) && cosine * cosine > float(kAlikeCosineSq);
  }
  float sideOf(const Surfel& surfel) const {
    return glm::dot(normal, surfel.normal) < 0 ? -1.f : 1.f;
  }
};

// The surfels of a cell and around it that face in one direction.
class Facing {
 public:
  // Heights are found in `members`.
  Facing(std::span<Surfel> surfels, std::size_t own, const Direction& direction,
         std::vector<Height>& members)
      : surfels_(surfels),
        own_(own),
        direction_(direction),
        heights_(members),
        origin_(surfels[members.front().surfel].position) {}
  void mark();

 private:
  struct Sheet {
    std::span<const Height> heights;
    AreaSums sums;
    bool is_filled = false;  // it has no gaps
  };
  bool findNormal();
  bool isPiled() const;
  void findHeights();
  std::size_t placeCount() const;
  float outlineOf(const SymmetricMatrix& spread) const;
  float widthOf(const AreaSums& sums) const;
  Sheet sheetOf(std::span<const Height> heights) const;
  static bool covers(const Sheet& sheet, const Sheet& own, const Height& of);
  bool areLayers(const Sheet& a, const Sheet& b) const;
  void hide(const Sheet& sheet, const Sheet& by, bool is_behind);

  const std::span<Surfel> surfels_;
  const std::size_t own_;  // so many are the cell's, the others lie around it
  const Direction& direction_;
  std::vector<Height>& heights_;
  const glm::vec3 origin_;
  glm::vec3 normal_{0};
};

bool Facing::findNormal() {
  const float first = surfels_[heights_.front().surfel].area;
  for (const Height& each : heights_) {
    const Surfel& surfel = surfels_[each.surfel];
    normal_ += surfel.area / first * direction_.sideOf(surfel) * surfel.normal;
  }
  const float length = glm::length(normal_);
  if (!(length > 0)) return false;
  normal_ /= length;
  return true;
}

// Whether some lie behind others: side by side, they have an outline as large as their area.
bool Facing::isPiled() const {
  float area = 0;
  glm::vec3 mean(0);
  std::array<float, SymmetricMatrix::kEntries> second{};
  // In units of the first surfel: a cloud may be of any scale
  const float first = surfels_[heights_.front().surfel].area, unit = 1 / std::sqrt(first);
  for (const Height& each : heights_) {
    const Surfel& surfel = surfels_[each.surfel];
    const glm::vec3 x = unit * (surfel.position - origin_), n = surfel.normal;
    const float a = surfel.area / first, spread = a * a / (4 * kPi);
    area += a;
    mean += a * x;
    second[0] += a * x.x * x.x + spread * (1 - n.x * n.x);
    second[1] += a * x.y * x.y + spread * (1 - n.y * n.y);
    second[2] += a * x.z * x.z + spread * (1 - n.z * n.z);
    second[3] += a * x.x * x.y - spread * n.x * n.y;
    second[4] += a * x.x * x.z - spread * n.x * n.z;
    second[5] += a * x.y * x.z - spread * n.y * n.z;
  }
  SymmetricMatrix spread;
  for (std::size_t i = 0; i < second.size(); ++i) {
    const int row = SymmetricMatrix::kRow[i], column = SymmetricMatrix::kColumn[i];
    spread.entries[i] = second[i] / area - mean[row] / area * (mean[column] / area);
  }
  return area - outlineOf(spread) > kLeastHidden * area;
}

// Above a sheet that is bent as the normals tell: in the plane across the mean normal slopes change
// evenly. Sheets behind each other are bent alike, and the gaps between them stay.
void Facing::findHeights() {
  const glm::dvec3 w(normal_);
  const glm::dvec3 u = glm::normalize(
      glm::cross(w, std::abs(w.x) < 0.5 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0)));
  const glm::dvec3 v = glm::cross(w, u);
  glm::dvec3 mean(0);
  for (const Height& each : heights_) mean += glm::dvec3(surfels_[each.surfel].position - origin_);
  mean /= double(heights_.size());
  double uu = 0, uv = 0, vv = 0;
  glm::dvec2 slope(0), slope_by_u(0), slope_by_v(0);
  for (const Height& each : heights_) {
    const Surfel& surfel = surfels_[each.surfel];
    const glm::dvec3 at = glm::dvec3(surfel.position - origin_) - mean, n(surfel.normal);
    const double x = glm::dot(at, u), y = glm::dot(at, v);
    const glm::dvec2 one = glm::dvec2(glm::dot(n, u), glm::dot(n, v)) / -glm::dot(n, w);
    uu += x * x;
    uv += x * y;
    vv += y * y;
    slope += one;
    slope_by_u += x * one;
    slope_by_v += y * one;
  }
  slope /= double(heights_.size());
  const double determinant = uu * vv - uv * uv;
  glm::dvec2 by_u(0), by_v(0);
  if (determinant > 1e-6 * uu * vv) {
    by_u = (vv * slope_by_u - uv * slope_by_v) / determinant;
    by_v = (uu * slope_by_v - uv * slope_by_u) / determinant;
  }
  const double twist = 0.5 * (by_u.y + by_v.x);
  for (Height& each : heights_) {
    const glm::dvec3 at = glm::dvec3(surfels_[each.surfel].position - origin_) - mean;
    const double x = glm::dot(at, u), y = glm::dot(at, v);
    const double bend = 0.5 * (by_u.x * x * x + by_v.y * y * y) + twist * x * y;
    each.area = surfels_[each.surfel].area;
    each.aside = {x, y};
    each.height = float(glm::dot(at, w) - slope.x * x - slope.y * y - bend);
  }
}

// Surfels at one place follow each other.
std::size_t Facing::placeCount() const {
  std::size_t count = 1;
  for (std::size_t i = 1; i < heights_.size(); ++i) {
    count += surfels_[heights_[i - 1].surfel].position != surfels_[heights_[i].surfel].position;
  }
  return count;
}

// Of the ellipse that spreads as they do, along the normal.
float Facing::outlineOf(const SymmetricMatrix& spread) const {
  // Products of lengths may be zero or infinite
  const float trace = spread.trace();
  if (!(trace >= std::numeric_limits<float>::min())) return 0;
  const float minor = quadraticForm(adjugate((1 / trace) * spread), normal_);
  return 4 * kPi * trace * std::sqrt(std::max(0.f, minor));
}

// Of a rectangle that spreads as they do, along its shorter side.
float Facing::widthOf(const AreaSums& sums) const {
  const SymmetricMatrix spread = sums.covariance();
  // The lesser principal moment across the normal, from the sum and the product of both
  const float half = 0.5f * (spread.trace() - quadraticForm(spread, normal_));
  const float root = outlineOf(spread) / (4 * kPi), part = root / half;
  return std::sqrt(12 * half * (1 - std::sqrt(std::max(0.f, 1 - part * part))));
}

Facing::Sheet Facing::sheetOf(std::span<const Height> heights) const {
  const double origin[3] = {double(origin_.x), double(origin_.y), double(origin_.z)};
  Sheet sheet{heights, {}, false};
  for (const Height& each : heights) sheet.sums.add(AreaSums(surfels_[each.surfel], origin));
  sheet.is_filled = float(sheet.sums.area) >= kLeastFilled * outlineOf(sheet.sums.covariance());
  return sheet;
}

// Of their places along the normal.
float asideSq(const Height& a, const Height& b) {
  const glm::vec2 offset = a.aside - b.aside;
  return glm::dot(offset, offset);
}

// Of the surfels of a sheet that lie so near to a line along the normal.
float areaAround(const Height& surfel, float distance, std::span<const Height> sheet) {
  float area = 0;
  for (const Height& other : sheet) {
    if (asideSq(surfel, other) <= distance * distance) area += other.area;
  }
  return area;
}

// Whether a surfel of a sheet lies right behind or before the surfel.
bool isCovered(const Height& surfel, std::span<const Height> by) {
  constexpr float kCellSq = 0.75f * 0.75f;  // half of its diagonal is .71
  return std::any_of(by.begin(), by.end(), [&](const Height& other) {
    return asideSq(surfel, other) <= kCellSq * other.area;
  });
}

// Whether another sheet lies close before or behind a surfel of one. One without gaps, however
// scattered its surfels are, has half as much area around it at least, which is what there is at an
// edge. As far from the edge as the sheets are apart, it has to go on, for who looks aslant sees
// below the edge.
bool Facing::covers(const Sheet& sheet, const Sheet& own, const Height& of) {
  const float gap = std::min(std::abs(sheet.heights.front().height - of.height),
                             std::abs(sheet.heights.back().height - of.height));
  if (!(gap <= kClosestLayers * std::sqrt(of.area))) return false;
  const auto has = [&](float distance, float part) {
    return areaAround(of, distance, sheet.heights) >= part * areaAround(of, distance, own.heights);
  };
  const float near = 3 * std::sqrt(std::max(sheet.heights.front().area, of.area));
  if (!(sheet.is_filled && has(near, 0.5f)) && !isCovered(of, sheet.heights)) return false;
  return 2 * gap < near || has(2 * gap, 0.8f);
}

void Facing::mark() {
  if (placeCount() < kFewestPlaces || !findNormal()) return;
  if (!isPiled()) return;
  findHeights();
  std::sort(heights_.begin(), heights_.end());
  const HeightGaps gaps(heights_);
  std::array<Sheet, kMostSheets> sheets;
  for (std::size_t i = 0; i < gaps.count(); ++i) sheets[i] = sheetOf(gaps.at(i));
  for (std::size_t i = 0; i < gaps.count(); ++i) {
    for (std::size_t k = i + 1; k < gaps.count(); ++k) {
      const Sheet &front = sheets[i], &back = sheets[k];
      if (!areLayers(front, back)) continue;
      hide(back, front, true);
      if (direction_.is_two_sided) hide(front, back, false);
    }
  }
}

// Whether most of the smaller of two sheets lies behind or before the other. And whether both are
// at least twice as wide as the gap between them: who looks aslant sees between narrow ones.
bool Facing::areLayers(const Sheet& a, const Sheet& b) const {
  AreaSums both = a.sums;
  both.add(b.sums);
  const double hidden = both.area - double(outlineOf(both.covariance()));
  if (!(hidden > 0.5 * std::min(a.sums.area, b.sums.area))) return false;
  const float gap = a.heights.back().height - b.heights.front().height;
  return std::min(widthOf(a.sums), widthOf(b.sums)) > 2 * gap;
}

// Marks the surfels of a sheet that lie behind (or before) another one; what is translucent hides
// nothing.
void Facing::hide(const Sheet& sheet, const Sheet& by, bool is_behind) {
  const auto& covered = by.sums.covered;
  if (std::min({covered[0], covered[1], covered[2]}) < by.sums.area) return;
  for (const Height& each : sheet.heights) {
    if (each.surfel >= own_) continue;
    Surfel& surfel = surfels_[each.surfel];
    if (!covers(by, sheet, each)) continue;
    const bool is_front = is_behind == (direction_.sideOf(surfel) > 0);
    surfel.flags |= is_front ? kSurfelHiddenFront : kSurfelHiddenBack;
  }
}

}  // namespace

void markHidden(std::span<Surfel> surfels, std::size_t own) {
  std::array<std::vector<Height>, kMostFacings>& members =
      threadScratch<std::array<std::vector<Height>, kMostFacings>>([] {});
  std::array<Direction, kMostFacings> directions;
  std::size_t count = 0;
  for (std::size_t i = 0; i < surfels.size(); ++i) {
    if (surfels[i].isSphere()) continue;
    std::size_t at = 0;
    while (at < count && !directions[at].holds(surfels[i])) ++at;
    if (at == kMostFacings) continue;
    if (at == count) {
      directions[count++] = {surfels[i].normal, surfels[i].isTwoSided()};
      members[at].clear();
    }
    members[at].push_back({0, std::uint32_t(i)});
  }
  for (std::size_t at = 0; at < count; ++at) {
    const bool has_own = members[at].front().surfel < own;
    if (has_own) Facing(surfels, own, directions[at], members[at]).mark();
  }
}

}  // namespace surfeit
