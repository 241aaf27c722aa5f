#include "gather/light/environment_grid.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "core/assert.h"

namespace surfeit {
namespace {

constexpr double kQuarter = kTurn / 4;

// An azimuth in [0, 2 pi).
double wrapped(double azimuth) {
  const double turns = azimuth / kTurn;
  const double rest = (turns - std::floor(turns)) * kTurn;
  return rest < kTurn ? rest : 0;
}

int cellOf(double place, int count) { return std::clamp(int(std::floor(place)), 0, count - 1); }

// Means over a slice of the height of great circles, h = k cos(t) / sqrt(1 - k^2 sin^2(t)) with the
// slice's azimuths t counted from that of the highest point and its height k. The integral is
// asin(k sin(t)).
struct CircleMean {
  double sin_begin, sin_end, width;

  double operator()(double k) const {
    return (std::asin(k * sin_end) - std::asin(k * sin_begin)) / width;
  }
};

// Angle of a point of the first quadrant as its part of the quadrant, to 1e-5: atan as Abramowitz
// and Stegun 4.4.47 has it, in a fifth of the time of std::atan2, which was a quarter of a lookup.
float quarterPart(float x, float y) {
  const float larger = std::max(x, y), ratio = larger > 0 ? std::min(x, y) / larger : 0;
  const float sq = ratio * ratio;
  const float angle =
      ratio *
      (0.9998660f + sq * (-0.3302995f + sq * (0.1801410f + sq * (-0.0851330f + sq * 0.0208351f))));
  const float part = angle * float(1 / kQuarter);
  return y > x ? 1 - part : part;
}

// Appends, so that ends never rise: where borders cross within a slice, their means may.
void append(double end, std::size_t cell, std::vector<MeridianCut>& cuts) {
  cuts.push_back({cuts.empty() ? std::min(end, 1.0) : std::min(end, cuts.back().end), cell});
}

// Azimuths in all quadrants, of an angle in the first.
void appendToQuadrants(double angle, std::vector<double>& breaks) {
  for (int quadrant = 0; quadrant < 4; ++quadrant) breaks.push_back(angle + quadrant * kQuarter);
}

void appendUniform(int count, std::vector<double>& breaks) {
  for (int i = 0; i < count; ++i) breaks.push_back(i * kTurn / count);
}

}  // namespace

LatLongGrid::LatLongGrid(int width, int height) : width_(width), height_(height) {
  for (int row = 1; row <= height; ++row) row_ends_.push_back(heightAt(row, height));
}

double LatLongGrid::heightAt(double row, int height) {
  return row >= height ? -1 : std::cos(row * (kTurn / 2) / height);
}

std::size_t LatLongGrid::cellCount() const { return std::size_t(width_) * std::size_t(height_); }

void LatLongGrid::appendBreaks(std::vector<double>& breaks) const {
  for (int column = 0; column < width_; ++column) {
    breaks.push_back(wrapped(kTurn / 2 - column * kTurn / width_));
  }
}

void LatLongGrid::cut(double begin, double end, std::vector<MeridianCut>& cuts) const {
  const double from_left = wrapped(kTurn / 2 - (begin + end) / 2);
  std::size_t cell = std::size_t(cellOf(from_left / kTurn * width_, width_));
  for (const double row_end : row_ends_) {
    cuts.push_back({row_end, cell});
    cell += std::size_t(width_);
  }
}

// The axis whose side face the slice crosses and the other one of the horizontal two, both with the
// signs and sizes of their components at the middle of the slice.
struct CubeGrid::Slice {
  struct Axis {
    bool is_negative;
    double cosine;  // to the axis with its sign
    CircleMean mean;
  };
  Axis axes[2];
  int dominant;

  Slice(double begin, double end) {
    const double middle = (begin + end) / 2;
    const double cosines[2] = {std::cos(middle), std::sin(middle)};
    for (int i = 0; i < 2; ++i) {
      const bool is_negative = cosines[i] < 0;
      const double top = i * kQuarter + (is_negative ? kTurn / 2 : 0);
      axes[i] = {is_negative,
                 std::abs(cosines[i]),
                 {std::sin(begin - top), std::sin(end - top), end - begin}};
    }
    dominant = axes[0].cosine >= axes[1].cosine ? 0 : 1;
  }
};

double CubeGrid::solidAngle(int resolution, int row, int column) {
  const auto corner = [&](int i, int j) {
    const double u = -1 + 2.0 * i / resolution, v = -1 + 2.0 * j / resolution;
    return std::atan2(u * v, std::sqrt(u * u + v * v + 1));
  };
  return corner(column + 1, row + 1) - corner(column, row + 1) - corner(column + 1, row) +
         corner(column, row);
}

std::size_t CubeGrid::cellCount() const {
  return std::size_t(6) * std::size_t(resolution_) * std::size_t(resolution_);
}

// All azimuths at which lines of the upper face cross each other or its edge; in fine grids, which
// have too many of them, those at the edge and three between.
void CubeGrid::appendBreaks(std::vector<double>& breaks) const {
  appendUniform(8, breaks);
  const int count = (resolution_ + 1) / 2;  // the last is the edge of the face, 1
  if (resolution_ > kExactResolution) appendUniform(16 * resolution_, breaks);
  for (int i = 0; i < count; ++i) {
    const int first = resolution_ <= kExactResolution ? 0 : count - 1;
    for (int j = first; j < count; ++j) {
      appendToQuadrants(std::atan2(line(i), line(j)), breaks);
      appendToQuadrants(std::atan2(line(j), line(i)), breaks);
    }
  }
}

void CubeGrid::cut(double begin, double end, std::vector<MeridianCut>& cuts) const {
  const Slice slice(begin, end);
  const std::size_t first = cuts.size();
  cutUpperFace(slice, cuts);
  const std::size_t upper = cuts.size() - first;
  cutSideFace(slice, cuts);

  // The lower face mirrors the upper one, from its edge to its middle
  const std::size_t to_lower = std::size_t(resolution_) * std::size_t(resolution_);
  for (std::size_t i = upper; i-- > 0;) {
    append(i > 0 ? -cuts[first + i - 1].end : -1, cuts[first + i].cell + to_lower, cuts);
  }
}

// From the middle of the face outwards; u and v grow in proportion.
void CubeGrid::cutUpperFace(const Slice& slice, std::vector<MeridianCut>& cuts) const {
  int passed[2] = {0, 0};  // lines of the two coordinates
  const auto coordinate = [&](int i) {
    return std::size_t(slice.axes[i].is_negative ? (resolution_ + 1) / 2 - 1 - passed[i]
                                                 : resolution_ / 2 + passed[i]);
  };
  const std::size_t n = std::size_t(resolution_);
  for (;;) {
    const std::size_t cell = (4 * n + coordinate(1)) * n + coordinate(0);
    const double next[2] = {line(passed[0]) / slice.axes[0].cosine,
                            line(passed[1]) / slice.axes[1].cosine};
    const int i =
        next[slice.dominant] <= next[1 - slice.dominant] ? slice.dominant : 1 - slice.dominant;
    const double u = line(passed[i]);
    append(slice.axes[i].mean(1 / std::sqrt(1 + u * u)), cell, cuts);
    if (i == slice.dominant && ++passed[i] == (resolution_ + 1) / 2) return;
    if (i != slice.dominant) ++passed[i];
  }
}

void CubeGrid::cutSideFace(const Slice& slice, std::vector<MeridianCut>& cuts) const {
  const Slice::Axis &axis = slice.axes[slice.dominant], &other = slice.axes[1 - slice.dominant];
  const double slope = other.cosine / axis.cosine * (other.is_negative ? -1 : 1);
  const std::size_t n = std::size_t(resolution_);
  const std::size_t across = std::size_t(cellOf((slope + 1) / 2 * resolution_, resolution_));
  const std::size_t face = std::size_t(2 * slice.dominant + (axis.is_negative ? 1 : 0));
  for (int k = resolution_ - 1; k >= 0; --k) {
    // Coordinates are those of the next two axes: the height is v on faces of the first axis, u on
    // those of the second
    const std::size_t up = std::size_t(k);
    const std::size_t cell =
        (face * n + (slice.dominant == 0 ? up : across)) * n + (slice.dominant == 0 ? across : up);
    const double w = -1 + 2.0 * k / resolution_;
    append(axis.mean(w / std::sqrt(1 + w * w)), cell, cuts);
  }
}

SquareGrid::Point SquareGrid::project(const glm::vec3& direction) {
  // From the distance to the pole, since 1 - |h| would lose its digits near it
  const float x = std::abs(direction.x), y = std::abs(direction.y);
  const float radius = std::sqrt((x * x + y * y) / (1 + std::abs(direction.z)));
  const float part = quarterPart(x, y);
  float to_y = radius * part, to_x = radius - to_y;
  if (direction.z < 0) {
    const float mirrored = 1 - to_y;
    to_y = 1 - to_x;
    to_x = mirrored;
  }
  return {std::copysign(to_x, direction.x), std::copysign(to_y, direction.y)};
}

std::size_t SquareGrid::cellCount() const {
  return std::size_t(resolution_) * std::size_t(resolution_);
}

// Eight slices for every cell along the equator: 16 resolution are 4 quadrants of resolution / 2.
// Where borders cross within a slice, areas err by some thousandths of a cell.
void SquareGrid::appendBreaks(std::vector<double>& breaks) const {
  appendUniform(16 * resolution_, breaks);
}

// In a quadrant, p and q are |x| and |y| for even ones and the other way round for odd ones, so
// that with the azimuth's part f, p = r (1 - f) and q = r f, r^2 = 1 - h; below the equator p = 1 -
// r f, q = 1 - r (1 - f), r^2 = 1 + h. The mean of 1 / f^2 over a slice is 1 / (f_begin f_end).
void SquareGrid::cut(double begin, double end, std::vector<MeridianCut>& cuts) const {
  const double middle = (begin + end) / 2;
  const int quadrant = cellOf(middle / kQuarter, 4);
  const double f = middle / kQuarter - quadrant;
  const double f_begin = begin / kQuarter - quadrant, f_end = end / kQuarter - quadrant;
  const double mean_q = std::max(f_begin * f_end, 1e-300);
  const double mean_p = std::max((1 - f_begin) * (1 - f_end), 1e-300);

  const int half = resolution_ / 2;
  const bool swaps = quadrant % 2 != 0;
  const bool x_is_negative = quadrant == 1 || quadrant == 2, y_is_negative = quadrant >= 2;
  const auto cell = [&](int p, int q) {
    const int x = swaps ? q : p, y = swaps ? p : q;
    return std::size_t(y_is_negative ? half - 1 - y : half + y) * std::size_t(resolution_) +
           std::size_t(x_is_negative ? half - 1 - x : half + x);
  };
  // Height of a line of one coordinate that grows like r `part` above the equator
  const auto height = [&](int passed, double part, double mean_part, double mean_other) {
    const double place = double(passed + 1) / half;
    return place < part ? 1 - place * place / mean_part
                        : -1 + (1 - place) * (1 - place) / mean_other;
  };

  int p = 0, q = 0;
  while (p < half - 1 || q < half - 1) {
    const double p_height = p < half - 1 ? height(p, 1 - f, mean_p, mean_q) : -2;
    const double q_height = q < half - 1 ? height(q, f, mean_q, mean_p) : -2;
    append(std::max(p_height, q_height), cell(p, q), cuts);
    (p_height >= q_height ? p : q) += 1;
  }
  append(-1, cell(p, q), cuts);
}

std::vector<glm::dvec4> overlay(const SphereGrid& from, std::span<const glm::vec3> values,
                                double rotation, const SphereGrid& to) {
  SURFEIT_CHECK(values.size() == from.cellCount());
  std::vector<double> breaks;
  from.appendBreaks(breaks);
  for (double& azimuth : breaks) azimuth += rotation;
  to.appendBreaks(breaks);
  appendUniform(1024, breaks);
  for (double& azimuth : breaks) azimuth = wrapped(azimuth);
  std::sort(breaks.begin(), breaks.end());

  std::vector<glm::dvec4> sums(to.cellCount(), glm::dvec4(0));
  std::vector<MeridianCut> from_cuts, to_cuts;
  for (std::size_t i = 0; i < breaks.size(); ++i) {
    const double begin = breaks[i], end = i + 1 < breaks.size() ? breaks[i + 1] : kTurn;
    if (end - begin < 1e-9) {
      // Too thin to tell on which side of a break it lies: its area goes to the next slice
      if (i + 1 < breaks.size()) breaks[i + 1] = begin;
      continue;
    }
    from_cuts.clear();
    to_cuts.clear();
    const double turned = wrapped((begin + end) / 2 - rotation);
    from.cut(turned - (end - begin) / 2, turned + (end - begin) / 2, from_cuts);
    to.cut(begin, end, to_cuts);

    // Both from the top: the next piece ends where the first of the two cells does
    double height = 1;
    for (std::size_t f = 0, t = 0; f < from_cuts.size() && t < to_cuts.size();) {
      const double piece_end = std::max(from_cuts[f].end, to_cuts[t].end);
      const double solid_angle = (height - piece_end) * (end - begin);
      const glm::dvec3 value = values[from_cuts[f].cell];
      sums[to_cuts[t].cell] += glm::dvec4(solid_angle * value, solid_angle);
      height = piece_end;
      if (from_cuts[f].end >= piece_end) ++f;
      if (to_cuts[t].end >= piece_end) ++t;
    }
  }
  return sums;
}

}  // namespace surfeit
