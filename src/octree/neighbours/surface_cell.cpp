#include "octree/neighbours/surface_cell.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <limits>
#include <numeric>
#include <optional>
#include <vector>

#include "core/spherical_harmonics.h"
#include "core/tangent_frame.h"

namespace surfeit {
namespace {

// Places on a line have this part of their variance, at most, across it.
constexpr float kLineFlatness = 1e-4f;
// Sheets are told apart by a gap between them: of half a spacing, or of a fifth where it is four
// times as wide as the own sheet is thick (two scans of one surface lie closer than that).
constexpr float kWideGap = 0.5f, kNarrowGap = 0.2f, kGapOverThickness = 4;
// What lies so close beside a place, in spacings, has no mirror image.
constexpr float kSharing = 0.05f;
// What lies so close beside a place, in spacings, shares its cell.
constexpr float kCoincident = 1e-3f;

// A plane is fitted again where what lies off it is more than this part of the spacing.
constexpr float kThick = 0.1f;
constexpr int kSheetPasses = 6;
// Of a slope from the place to a neighbour that is another sheet's, not its own.
constexpr float kSteep = 0.7f;
// Places that lie this far off their surface, in spacings, are noisy.
constexpr float kNoisy = 0.1f;
// At the edge of a surface cells are closed by other places of the edge, far outside: they reach
// farther than this, in distances of the places that cut them.
constexpr float kSpike = 2;
// What cuts from farther away lies flatter than this, root mean square, or all of it are strays.
constexpr float kLooseSlope = 0.3f;
// How far an open cell reaches, in units of the farthest neighbour.
constexpr float kOpen = 2;

struct Plane {
  glm::vec3 normal{0};
  float thickness = 0;  // root mean square of what lies off it
  float confidence = 0;
  bool is_line = false;  // the places lie on one: the plane is any through it
};

// Offsets of the neighbours in units of the farthest, as the vectorizer likes them, with weights.
struct Columns {
  std::vector<float> x, y, z, weight;

  void fill(std::span<const Neighbour> neighbours, float unit) {
    const std::size_t count = neighbours.size();
    for (std::vector<float>* column : {&x, &y, &z, &weight}) column->resize(count);
    for (std::size_t i = 0; i < count; ++i) {
      const glm::vec3 offset = neighbours[i].offset / unit;
      x[i] = offset.x, y[i] = offset.y, z[i] = offset.z, weight[i] = 1;
    }
  }

  // Cauchy's: what lies off the plane counts the less, the farther it does.
  void weigh(const glm::vec3& normal, float width) {
    const glm::vec3 across = normal / width;
    for (std::size_t i = 0; i < x.size(); ++i) {
      const float above = x[i] * across.x + y[i] * across.y + z[i] * across.z;
      weight[i] = 1 / (1 + above * above);
    }
  }
};

// The plane through the neighbours and the place itself, each with its weight.
Plane fitPlane(const Columns& at) {
  float sum = 1, x = 0, y = 0, z = 0, xx = 0, yy = 0, zz = 0, xy = 0, yz = 0, zx = 0;
  for (std::size_t i = 0; i < at.x.size(); ++i) {
    const float wx = at.weight[i] * at.x[i], wy = at.weight[i] * at.y[i],
                wz = at.weight[i] * at.z[i];
    sum += at.weight[i], x += wx, y += wy, z += wz;
    xx += wx * at.x[i], yy += wy * at.y[i], zz += wz * at.z[i];
    xy += wx * at.y[i], yz += wy * at.z[i], zx += wz * at.x[i];
  }
  Eigen::Matrix3f covariance;
  covariance << xx - x * x / sum, xy - x * y / sum, zx - z * x / sum,  //
      xy - x * y / sum, yy - y * y / sum, yz - y * z / sum,            //
      zx - z * x / sum, yz - y * z / sum, zz - z * z / sum;
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3f> solver;
  solver.computeDirect(covariance);
  const Eigen::Vector3f normal = solver.eigenvectors().col(0);
  Plane plane;
  plane.normal = {normal.x(), normal.y(), normal.z()};
  const float length = glm::length(plane.normal);
  plane.normal = length > 0.5f ? plane.normal / length : glm::vec3(0, 0, 1);
  plane.thickness = std::sqrt(std::max(solver.eigenvalues()(0), 0.f) / sum);
  const float all = solver.eigenvalues().sum();
  plane.confidence = all > 0 ? std::clamp(1 - 3 * solver.eigenvalues()(0) / all, 0.f, 1.f) : 0;
  plane.is_line = !(solver.eigenvalues()(1) > kLineFlatness * solver.eigenvalues()(2));
  return plane;
}

// The plane of the place's own sheet, where several lie close to each other: what lies off it
// counts the less, again and again. `spacing` and thickness are in units of the farthest.
Plane fitSheet(Columns& at, float spacing) {
  Plane plane = fitPlane(at);
  for (int pass = 0; pass < kSheetPasses && plane.thickness > kThick * spacing; ++pass) {
    at.weigh(plane.normal, kNarrowGap * spacing);
    const Plane again = fitPlane(at);
    plane.normal = again.normal;
    plane.is_line = again.is_line;
  }
  return plane;
}

// The quadric over a plane that fits the neighbours and the place best (jets of order 2: Cazals and
// Pouget 2005): places on one side alone do not turn it as they turn a plane.
struct Quadric {
  float slope_u = 0, slope_v = 0;  // at the place
  float noise = 0;                 // what lies off it, root mean square

  // Neighbours count by their weight and, with `is_narrow`, the less, the farther they are.
  static Quadric fit(const Columns& at, const glm::vec3& normal, const TangentFrame& frame,
                     bool is_narrow) {
    constexpr int kTerms = 6;
    float sums[kTerms][kTerms] = {}, heights[kTerms] = {}, squares = 0;
    sums[0][0] = 1;  // the place itself
    for (std::size_t i = 0; i < at.x.size(); ++i) {
      const glm::vec3 p(at.x[i], at.y[i], at.z[i]);
      const float u = glm::dot(p, frame.tangent), v = glm::dot(p, frame.bitangent);
      const float h = glm::dot(p, normal), near = std::max(1 - glm::dot(p, p), 0.f);
      const float weight = at.weight[i] * (is_narrow ? near * near * near * near : 1.f);
      const float terms[kTerms] = {1, u, v, u * u, u * v, v * v};
      for (int r = 0; r < kTerms; ++r) {
        const float weighted = weight * terms[r];
        for (int c = 0; c < kTerms; ++c) sums[r][c] += weighted * terms[c];
        heights[r] += weighted * h;
      }
      squares += weight * h * h;
    }
    using Column = Eigen::Matrix<float, kTerms, 1>;
    Eigen::Matrix<float, kTerms, kTerms> matrix =
        Eigen::Map<const Eigen::Matrix<float, kTerms, kTerms>>(&sums[0][0]);
    matrix.diagonal().array() += 1e-6f * matrix.trace();
    const Eigen::Map<const Column> right(heights);
    const Column fit = matrix.ldlt().solve(right);
    return {fit[1], fit[2], std::sqrt(std::max(squares - fit.dot(right), 0.f) / sums[0][0])};
  }
};

// Of the surface at the place. Where there is no noise the nearest tell it best.
glm::vec3 normalAt(const Columns& at, const glm::vec3& normal, float spacing) {
  const TangentFrame frame(normal);
  Quadric quadric = Quadric::fit(at, normal, frame, false);
  if (quadric.noise < kNoisy * spacing) quadric = Quadric::fit(at, normal, frame, true);
  const glm::vec3 turned =
      normal - quadric.slope_u * frame.tangent - quadric.slope_v * frame.bitangent;
  const float length = glm::length(turned);
  return length > 0 && std::isfinite(length) ? turned / length : normal;
}

// A neighbour in the plane: beside the place, and above it.
struct Flat {
  glm::vec2 beside;
  float above;
};

// Drops what lies above (`side` 1) or below (-1) the first gap on that side. What lies only far
// beside the place may belong to a slope: a sheet that goes has something steeply above the place.
void dropSheet(float side, float spacing, float thickness, std::vector<Flat>& flat,
               std::vector<float>& heights) {
  heights.clear();
  for (const Flat& n : flat) {
    if (side * n.above > 0) heights.push_back(side * n.above);
  }
  std::sort(heights.begin(), heights.end());
  float below = 0, limit = 0;
  for (const float height : heights) {
    const float gap = height - below;
    if (gap > kWideGap * spacing ||
        (gap > kNarrowGap * spacing && gap > kGapOverThickness * thickness)) {
      limit = height;
      break;
    }
    below = height;
  }
  if (limit == 0) return;
  const auto is_beyond = [&](const Flat& n) { return side * n.above >= limit; };
  const bool is_sheet = std::any_of(flat.begin(), flat.end(), [&](const Flat& n) {
    return is_beyond(n) && std::abs(n.above) > kSteep * glm::length(n.beside);
  });
  const auto beyond = std::count_if(flat.begin(), flat.end(), is_beyond);
  // A few places are strays of their surface, not a sheet
  const std::ptrdiff_t fewest = std::ptrdiff_t(flat.size()) / 6;
  if (is_sheet && beyond >= fewest && std::ptrdiff_t(flat.size()) - beyond >= fewest) {
    std::erase_if(flat, is_beyond);
  }
}

// Whether anything lies so high that there may be a gap below it.
bool mayBeSheets(const std::vector<Flat>& flat, float spacing) {
  return std::any_of(flat.begin(), flat.end(),
                     [&](const Flat& n) { return std::abs(n.above) > kNarrowGap * spacing; });
}

// How thick the own sheet is: a quarter of the neighbours lie nearer to the plane.
float thicknessOf(const std::vector<Flat>& flat, std::vector<float>& heights) {
  heights.clear();
  for (const Flat& n : flat) heights.push_back(std::abs(n.above));
  const auto middle = heights.begin() + std::ptrdiff_t(heights.size() / 4);
  std::nth_element(heights.begin(), middle, heights.end());
  return heights.empty() ? 0 : *middle;
}

// The median of how far each neighbour is from the third of the others, since scans come in pairs.
float spacingAmong(std::span<const Neighbour> neighbours, std::vector<float>& nearest) {
  nearest.clear();
  for (const Neighbour& a : neighbours) {
    float least[3];
    std::fill(std::begin(least), std::end(least), std::numeric_limits<float>::infinity());
    for (const Neighbour& b : neighbours) {
      const float distance = glm::length(a.offset - b.offset);
      if (&a == &b || distance >= least[2]) continue;
      least[2] = distance;
      if (least[2] < least[1]) std::swap(least[1], least[2]);
      if (least[1] < least[0]) std::swap(least[0], least[1]);
    }
    nearest.push_back(least[2]);
  }
  const auto middle = nearest.begin() + std::ptrdiff_t(nearest.size() / 2);
  std::nth_element(nearest.begin(), middle, nearest.end());
  return *middle;
}

// A convex polygon around the place, cut by the lines halfway to its neighbours.
class Cell {
 public:
  explicit Cell(float reach) : reach_sq_(2 * reach * reach) {
    count_ = 4;
    corners_ = {{{-reach, -reach}, {reach, -reach}, {reach, reach}, {-reach, reach}}};
  }

  // Keeps what is nearer to the place than to `other`.
  bool cut(const glm::vec2& other) {
    const float limit = 0.5f * glm::dot(other, other);
    if (limit * 0.5f >= reach_sq_) return false;  // (|other| / 2)^2
    std::array<glm::vec2, kMostCorners> kept;
    std::size_t kept_count = 0;
    bool is_cut = false;
    for (std::size_t i = 0; i < count_; ++i) {
      const glm::vec2 &from = corners_[i], &to = corners_[i + 1 == count_ ? 0 : i + 1];
      const float before = glm::dot(from, other) - limit, after = glm::dot(to, other) - limit;
      if (before <= 0) {
        kept[kept_count++] = from;
      } else {
        is_cut = true;
      }
      if ((before <= 0) != (after <= 0) && kept_count < kMostCorners) {
        kept[kept_count++] = from + before / (before - after) * (to - from);
      }
      if (kept_count + 1 >= kMostCorners) break;
    }
    if (!is_cut || kept_count < 3) return false;
    corners_ = kept;
    count_ = kept_count;
    reach_sq_ = 0;
    for (std::size_t i = 0; i < count_; ++i) {
      reach_sq_ = std::max(reach_sq_, glm::dot(corners_[i], corners_[i]));
    }
    return true;
  }

  float reach() const { return std::sqrt(reach_sq_); }
  // Whether what is nearer to a corner than the place is lies within `radius` of there: only that
  // cuts the cell.
  bool mayCut(const glm::vec2& there, float radius) const {
    for (std::size_t i = 0; i < count_; ++i) {
      if (glm::length(there - corners_[i]) < glm::length(corners_[i]) + radius) return true;
    }
    return false;
  }
  bool wouldCut(const glm::vec2& there) const { return mayCut(there, -kTouching); }
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
  // The mean squared distance from the place.
  float meanSquare() const {
    float sum = 0;
    for (std::size_t i = 0; i < count_; ++i) {
      const glm::vec2 &a = corners_[i], &b = corners_[i + 1 == count_ ? 0 : i + 1];
      sum += (a.x * b.y - a.y * b.x) * (glm::dot(a, a) + glm::dot(a, b) + glm::dot(b, b));
    }
    return sum / (12 * area());
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
  std::array<glm::vec2, kMostCorners> corners_;
  std::size_t count_;
  float reach_sq_;  // of the farthest corner
};

}  // namespace

struct SurfaceCells::Scratch {
  std::vector<Flat> flat;
  Columns columns;
  std::vector<float> heights;
  std::vector<glm::vec2> cutters;
  std::vector<float> slopes_sq;  // of those from farther away

  // Of the cell in the making. Lengths are in units of the farthest neighbour: fourth powers of
  // them must stay finite.
  float unit = 1, spacing = 1, sharers = 1;
  Plane plane;
  glm::vec3 own_normal{0}, normal{0}, surface_normal{0};
  std::optional<TangentFrame> frame;
  Cell polygon{kOpen};

  Flat flatten(const glm::vec3& place) const {
    const glm::vec3 offset = place / unit;
    return {{glm::dot(offset, frame->tangent), glm::dot(offset, frame->bitangent)},
            glm::dot(offset, normal)};
  }
  // Not on the other side of something thin.
  bool mayShareSheet(const Neighbour& n) const { return glm::dot(n.normal, own_normal) >= 0; }

  void begin(std::span<const Neighbour> neighbours, const glm::vec3& given_normal);
  void flattenAll(std::span<const Neighbour> neighbours);
  float usualCutter();
  SurfaceCell cell() const;
};

SurfaceCells::SurfaceCells() : scratch_(std::make_unique<Scratch>()) {}
SurfaceCells::SurfaceCells(SurfaceCells&&) noexcept = default;
SurfaceCells& SurfaceCells::operator=(SurfaceCells&&) noexcept = default;
SurfaceCells::~SurfaceCells() = default;

void SurfaceCells::Scratch::begin(std::span<const Neighbour> neighbours,
                                  const glm::vec3& given_normal) {
  unit = glm::length(neighbours.back().offset);
  spacing = std::sqrt(kPi / float(neighbours.size() + 1));
  columns.fill(neighbours, unit);
  plane = fitSheet(columns, spacing);
  own_normal = given_normal;
  normal = own_normal != glm::vec3(0) ? own_normal : plane.normal;
  surface_normal = plane.is_line ? plane.normal : normalAt(columns, plane.normal, spacing);
  frame.emplace(normal);
  polygon = Cell(kOpen);
  sharers = 1;
  cutters.clear();
  slopes_sq.clear();
}

// Of the place's own sheet.
void SurfaceCells::Scratch::flattenAll(std::span<const Neighbour> neighbours) {
  flat.clear();
  for (const Neighbour& n : neighbours) {
    if (mayShareSheet(n)) flat.push_back(flatten(n.offset));
  }
  if (!mayBeSheets(flat, spacing)) return;
  const float thickness = thicknessOf(flat, heights);
  dropSheet(1, spacing, thickness, flat, heights);
  dropSheet(-1, spacing, thickness, flat, heights);
}

SurfaceCell SurfaceCells::cellOf(std::span<const Neighbour> neighbours, float reach,
                                 const glm::vec3& normal) {
  Scratch& at = *scratch_;
  at.cutters.clear();
  if (neighbours.empty()) return {};
  at.begin(neighbours, normal);
  at.flattenAll(neighbours);
  for (const Flat& n : at.flat) {
    if (glm::length(n.beside) < kCoincident * at.spacing) {
      ++at.sharers;
    } else if (at.polygon.cut(n.beside)) {
      at.cutters.push_back(n.beside);
    }
  }
  SurfaceCell cell = at.cell();
  // Where all places are known, what is open reaches farther than any of them
  cell.is_settled =
      !at.cutters.empty() && 2 * at.polygon.reach() <= std::min(reach / at.unit, kOpen);
  return cell;
}

float SurfaceCells::reach() const { return 2 * scratch_->polygon.reach() * scratch_->unit; }

bool SurfaceCells::isOpen() const {
  const Scratch& at = *scratch_;
  const bool has_plane = !at.plane.is_line || at.own_normal != glm::vec3(0);
  return !at.cutters.empty() && has_plane;
}

bool SurfaceCells::mayCut(const glm::vec3& centre, float radius) const {
  return scratch_->polygon.mayCut(scratch_->flatten(centre).beside, radius / scratch_->unit);
}

bool SurfaceCells::wouldCut(const Neighbour& place) const {
  const Scratch& at = *scratch_;
  const Flat flat = at.flatten(place.offset);
  return at.mayShareSheet(place) && std::abs(flat.above) < kSteep * glm::length(flat.beside) &&
         at.polygon.wouldCut(flat.beside);
}

bool SurfaceCells::cut(const Neighbour& place) {
  Scratch& at = *scratch_;
  const Flat flat = at.flatten(place.offset);
  if (!at.polygon.cut(flat.beside)) return false;
  at.cutters.push_back(flat.beside);
  const float slope = flat.above / glm::length(flat.beside);
  at.slopes_sq.push_back(slope * slope);
  return true;
}

SurfaceCell SurfaceCells::closed(std::span<const Neighbour> neighbours) {
  Scratch& at = *scratch_;
  const float slopes_sq = std::accumulate(at.slopes_sq.begin(), at.slopes_sq.end(), 0.f);
  const bool is_loose = slopes_sq > kLooseSlope * kLooseSlope * float(at.slopes_sq.size());
  const bool is_open = !at.cutters.empty() && (at.polygon.touches(kOpen) || is_loose ||
                                               at.polygon.reach() > kSpike * at.usualCutter());
  if (is_open) {
    // One close by shares the cell rather than telling its size
    for (const glm::vec2& cutter : at.cutters) {
      if (glm::length(cutter) > kSharing * at.spacing) at.polygon.cut(-cutter);
    }
  }
  SurfaceCell cell = at.cell();
  cell.is_settled = !is_open;
  if (is_open) cell.neighbour_spacing = spacingAmong(neighbours, at.heights);
  return cell;
}

float SurfaceCells::Scratch::usualCutter() {
  heights.clear();
  for (const glm::vec2& cutter : cutters) heights.push_back(glm::length(cutter));
  const auto middle = heights.begin() + std::ptrdiff_t(heights.size() * 3 / 4);
  std::nth_element(heights.begin(), middle, heights.end());
  return *middle;
}

SurfaceCell SurfaceCells::Scratch::cell() const {
  SurfaceCell cell;
  cell.normal = surface_normal;
  cell.confidence = plane.confidence;
  cell.is_line = plane.is_line;
  cell.thickness = plane.thickness / spacing;
  if (cutters.empty()) return cell;
  // Of a line all that is known is a width: the piece is a square of it
  const bool is_strip = plane.is_line && polygon.touches(kOpen);
  const float width = is_strip ? polygon.width(glm::normalize(cutters[0])) : 0;
  const float area = is_strip ? width * width : polygon.area();
  cell.area = area / sharers * unit * unit;
  // A disk's mean squared distance from its middle is half of its radius squared, a square's a
  // sixth of its side squared
  const float mean_square = is_strip ? width * width / 6 : polygon.meanSquare();
  cell.radius = std::sqrt(2 * mean_square) * unit;
  return cell;
}

}  // namespace surfeit
