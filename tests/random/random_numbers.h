// Numbers by chance, the same on every machine: a counter through the hash of core/square_strata.h.
#pragma once

#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include "core/square_strata.h"

namespace surfeit {

// Plain data; copies go on independently and alike. A function must draw one number per statement,
// since the order of arguments is the compiler's.
class RandomNumbers {
 public:
  explicit RandomNumbers(std::uint64_t seed) : key_(mixBits(seed + 0x5eed)) {}

  // Of an independent sequence.
  RandomNumbers fork(std::uint64_t number) const { return RandomNumbers(hashOf(key_, ~number)); }

  std::uint64_t bits() { return hashOf(key_, count_++); }
  double unit() { return double(bits() >> 11) * 0x1p-53; }  // in [0, 1)
  double between(double begin, double end) { return begin + (end - begin) * unit(); }
  // Every factor is as likely, 0 < begin <= end.
  double logBetween(double begin, double end) { return begin * std::pow(end / begin, unit()); }
  int below(int count) { return int(unit() * count); }
  int intBetween(int first, int last) { return first + below(last - first + 1); }
  bool chance(double probability) { return unit() < probability; }

  // Of mean 0 and variance 1, bell-shaped within 3.5.
  double bell() {
    double sum = 0;
    for (int i = 0; i < 4; ++i) sum += unit();
    return (sum - 2) * std::sqrt(3.0);
  }

  // Even in the ball of radius 1, and on it.
  glm::dvec3 inBall() {
    glm::dvec3 place;
    do {
      for (int axis = 0; axis < 3; ++axis) place[axis] = between(-1, 1);
    } while (glm::dot(place, place) >= 1);
    return place;
  }
  glm::dvec3 direction() {
    glm::dvec3 place;
    do {
      place = inBall();
    } while (glm::dot(place, place) < .01);
    return glm::normalize(place);
  }
  glm::dvec3 color(double least, double most) {
    glm::dvec3 color;
    for (int channel = 0; channel < 3; ++channel) color[channel] = between(least, most);
    return color;
  }

 private:
  std::uint64_t key_;
  std::uint64_t count_ = 0;
};

}  // namespace surfeit
