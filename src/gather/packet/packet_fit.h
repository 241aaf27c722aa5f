// Results as a function of place and direction, fitted to the receivers of some packets: of second
// order in the position and of first order in the axis of the lobe. docs/many_gathers.md,
// "Interpolation".
#pragma once

#include <array>
#include <cstddef>
#include <glm/vec3.hpp>

#include "gather/rules/receiver.h"

namespace surfeit {

// A receiver and the axis of its lobe, in parts of the lobe's width.
struct FitPoint {
  glm::vec3 position{0}, axis{0};
};

// One thread at a time.
class PacketFit {
 public:
  // Starts over about a point. What is `reach` away is 1 away. Values have `channels` floats, at
  // most kResultFloats.
  void begin(const FitPoint& about, float reach, std::size_t channels);
  void add(const FitPoint& sample, float weight, const float* values);
  // False where there are no samples.
  bool solve();

  // Variance of the fit there, over that of the mean of all samples.
  double leverage(const FitPoint& point) const;
  void value(const FitPoint& point, float* values) const;

 private:
  static constexpr std::size_t kTerms = 13;
  static constexpr std::size_t kLanes = 16;  // whole vectors
  using Terms = std::array<float, kLanes>;
  Terms termsOf(const FitPoint& point) const;

  FitPoint about_;
  float scale_ = 1, weight_ = 0;
  std::size_t channels_ = 0;
  std::array<Terms, kTerms> moments_;                    // weighted sums of products of terms
  std::array<Terms, kResultFloats> products_;            // and of terms with values
  std::array<std::array<double, kTerms>, kTerms> root_;  // Cholesky's, below the diagonal
  std::array<Terms, kResultFloats> factors_;
};

}  // namespace surfeit
