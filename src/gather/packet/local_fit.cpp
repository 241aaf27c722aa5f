#include "gather/packet/local_fit.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>

namespace surfeit {
namespace {

// Normals farther apart (cosine) are of different surfaces, or of one that bends too much here.
constexpr float kLeastCosine = 0.8f;
// So are receivers whose connection is this far from the surface (sine of the angle to it; chords
// of a sphere lie in it).
constexpr float kMostRise = 0.25f;

// Part of the mean squared distance of samples that is added along every axis. Where samples lie in
// a plane, or on a line, the fit is level across it; elsewhere slopes lose about a hundredth.
constexpr float kRidge = 0.002f;

bool resemble(const LocalReceiver& a, const LocalReceiver& b, const glm::vec3& offset,
              float distance_sq) {
  if (a.isSpherical() || b.isSpherical()) return a.isSpherical() == b.isSpherical();
  if (!(glm::dot(a.normal, b.normal) > kLeastCosine)) return false;
  const float rise = 0.5f * glm::dot(offset, a.normal + b.normal);
  return rise * rise <= kMostRise * kMostRise * distance_sq;
}

struct Neighbour {
  float distance_sq;
  std::uint16_t place;
  bool operator<(const Neighbour& other) const {
    return distance_sq != other.distance_sq ? distance_sq < other.distance_sq : place < other.place;
  }
};

// One more than are used: its distance is where weights reach zero.
constexpr std::size_t kNeighbours = LocalFit::kSamples + 1;

// The nearest samples that resemble, sorted.
std::size_t nearest(std::span<const FitPoint> points, std::uint32_t at,
                    std::span<const std::uint16_t> samples, std::uint32_t except,
                    std::array<Neighbour, kNeighbours>& found) {
  const LocalReceiver& receiver = points[at].receiver;
  std::size_t count = 0;
  for (const std::uint16_t place : samples) {
    if (place == except) continue;
    const LocalReceiver& sample = points[place].receiver;
    const glm::vec3 offset = sample.position - receiver.position;
    const Neighbour neighbour{glm::dot(offset, offset), place};
    if (count == kNeighbours && !(neighbour < found[count - 1])) continue;
    if (!resemble(receiver, sample, offset, neighbour.distance_sq)) continue;
    std::size_t i = count < kNeighbours ? count++ : count - 1;
    for (; i > 0 && neighbour < found[i - 1]; --i) found[i] = found[i - 1];
    found[i] = neighbour;
  }
  return count;
}

}  // namespace

LocalFit fitLocally(std::span<const FitPoint> points, std::uint32_t at,
                    std::span<const std::uint16_t> samples, std::uint32_t except) {
  LocalFit fit;
  std::array<Neighbour, kNeighbours> near;
  const std::size_t found = nearest(points, at, samples, except, near);
  if (found <= LocalFit::kLeastSamples) return fit;
  const float reach_sq = near[found - 1].distance_sq;
  if (!(reach_sq > 0)) return fit;

  // Offsets in units of the reach, and their weights, centre and spread
  const LocalReceiver& receiver = points[at].receiver;
  const float scale = 1 / std::sqrt(reach_sq);
  std::array<glm::vec3, LocalFit::kSamples> offsets;
  float sum = 0;
  glm::vec3 centre(0);
  for (std::size_t i = 0; i + 1 < found; ++i) {
    const float fade = 1 - near[i].distance_sq / reach_sq;
    offsets[i] = (points[near[i].place].receiver.position - receiver.position) * scale;
    fit.weights[i] = fade * fade;
    sum += fit.weights[i];
    centre += fit.weights[i] * offsets[i];
  }
  if (!(sum > 0)) return fit;
  centre /= sum;
  glm::mat3 spread(0);
  float trace = 0;
  for (std::size_t i = 0; i + 1 < found; ++i) {
    offsets[i] -= centre;
    spread += glm::outerProduct(fit.weights[i] * offsets[i], offsets[i]);
    trace += fit.weights[i] * glm::dot(offsets[i], offsets[i]);
  }
  if (!(trace > 0)) return fit;
  for (int axis = 0; axis < 3; ++axis) spread[axis][axis] += kRidge * trace;

  // The plane at the receiver, which lies at -centre
  const glm::vec3 slope = glm::inverse(spread) * -centre;
  fit.count = found - 1;
  glm::vec3 axis_sum(0), place_sum(0);
  for (std::size_t i = 0; i < fit.count; ++i) {
    fit.samples[i] = near[i].place;
    fit.weights[i] *= 1 / sum + glm::dot(slope, offsets[i]);
    fit.gain += std::abs(fit.weights[i]);
    axis_sum += fit.weights[i] * points[near[i].place].axis;
    place_sum += fit.weights[i] * (offsets[i] + centre);
  }
  fit.axis_error = glm::length(axis_sum - points[at].axis);
  fit.height_error = receiver.isSpherical() ? glm::length(place_sum)
                                            : std::abs(glm::dot(place_sum, receiver.normal));
  return fit;
}

}  // namespace surfeit
