#include "cloud/exr/exr_positions.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

namespace surfeit {
namespace {

constexpr float kMaxDepth = 1e30f;

glm::dvec3 valueAt(const float* const (&values)[3], std::size_t x) {
  return {double(values[0][x]), double(values[1][x]), double(values[2][x])};
}

// How far apart half floats lie at a value.
double halfStep(double value) {
  constexpr int kFractionBits = 10, kLeastExponent = -14;
  int exponent = 0;
  std::frexp(value, &exponent);
  return std::ldexp(1, std::max(exponent - 1, kLeastExponent) - kFractionBits);
}

}  // namespace

bool ExrScanLine::isSet(std::size_t x) const {
  if (alpha != nullptr && !(alpha[x] > 0)) return false;
  if (depth != nullptr && !(std::isfinite(depth[x]) && depth[x] < kMaxDepth)) return false;
  const glm::dvec3 place = valueAt(position, x);
  if (!std::isfinite(place.x) || !std::isfinite(place.y) || !std::isfinite(place.z)) return false;
  const bool has_normal = normal[0] != nullptr && valueAt(normal, x) != glm::dvec3(0);
  return place != glm::dvec3(0) || has_normal;
}

void ExrPositions::look(const ExrScanLine& line) {
  for (std::size_t x = 0; x < line.width; ++x) {
    if (!line.isSet(x)) continue;
    ++set_;
    const glm::dvec3 place = valueAt(line.position, x);
    largest_ = std::max({largest_, std::abs(place.x), std::abs(place.y), std::abs(place.z)});
    if (line.isPartlyCovered(x)) {
      ++partly_covered_;
      vote(line, x);
    } else if (x > 0 && line.isSet(x - 1) && !line.isPartlyCovered(x - 1)) {
      const double step = glm::distance(place, valueAt(line.position, x - 1));
      step_sum_ += step;
      if (step > 0) ++steps_;
    }
  }
}

void ExrPositions::vote(const ExrScanLine& line, std::size_t x) {
  const double alpha = double(line.alpha[x]);
  // By how much dividing is wrong, and by how much leaving
  double divided = 0, kept = 0;
  if (line.normal[0] != nullptr) {
    const double length = glm::length(valueAt(line.normal, x));
    divided = std::abs(length / alpha - 1);
    kept = std::abs(length - 1);
  } else {
    const glm::dvec3 place = valueAt(line.position, x);
    for (const std::size_t beside : {x - 1, x + 1}) {  // the one before the first is past the last
      if (beside >= line.width || !line.isSet(beside) || line.isPartlyCovered(beside)) continue;
      const glm::dvec3 neighbour = valueAt(line.position, beside);
      divided += glm::distance(place / alpha, neighbour);
      kept += glm::distance(place, neighbour);
    }
  }
  for_division_ += divided < kept ? 1 : 0;
  against_division_ += kept < divided ? 1 : 0;
}

ExrPositions::Edges ExrPositions::edges() const {
  if (for_division_ > against_division_) return Edges::kDivide;
  // Where nothing is covered as a whole, alpha is not that of edges
  const bool has_edges = partly_covered_ > 0 && partly_covered_ < set_;
  return against_division_ > for_division_ || !has_edges ? Edges::kKeep : Edges::kLeaveOut;
}

std::optional<std::string> ExrPositions::noteOfHalf() const {
  const double step = halfStep(largest_);
  const double spacing = steps_ > 0 ? step_sum_ / double(steps_) : 0;
  if (step <= 1e-3 * spacing) return std::nullopt;
  return fmt::format(
      "positions are stored in 16 bits, which stand up to {:.2g} apart here, beside pixels {} "
      "apart: render them in 32 bits",
      step, steps_ > 0 ? fmt::format("{:.2g}", spacing) : "no distance");
}

std::vector<std::string> ExrPositions::notes(bool are_half) const {
  std::vector<std::string> notes;
  if (are_half) {
    if (std::optional<std::string> note = noteOfHalf()) notes.push_back(std::move(*note));
  }
  const std::string pixels =
      fmt::format("{} of {} pixels are covered in part", partly_covered_, set_);
  if (edges() == Edges::kDivide) {
    notes.push_back(pixels +
                    " and hold positions times alpha: positions and normals are divided by it, "
                    "other channels are not");
  } else if (edges() == Edges::kLeaveOut) {
    notes.push_back(pixels +
                    ", and nothing tells whether they hold positions times alpha: left out (passes "
                    "without alpha, or with normals, keep them)");
  } else if (partly_covered_ > 0 && partly_covered_ == set_ && against_division_ == 0) {
    notes.push_back(
        "all pixels are covered in part: positions are taken as not multiplied by alpha");
  }
  return notes;
}

}  // namespace surfeit
