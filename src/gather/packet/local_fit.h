// A function known at samples, at a receiver between them: by the plane through the values of the
// nearest samples that best fits them (moving least squares). Exact for what is linear, however
// samples lie; memo 7.7 has the bilinear counterpart on grids.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "gather/rules/gather_rules.h"
#include "gather/rules/receiver.h"

namespace surfeit {

// The value at the receiver is the sum of weight * value over the samples; weights sum to 1.
struct LocalFit {
  // Samples nearest to the receiver that a fit draws from.
  static constexpr std::size_t kSamples = 10;
  static constexpr std::size_t kLeastSamples = 4;

  std::size_t count = 0;  // 0: there are too few samples that resemble the receiver
  std::array<std::uint16_t, kSamples> samples;  // places
  std::array<float, kSamples> weights;
  float gain = 0;  // sum of absolute weights: 1 between the samples, more outside of them
  // How far the samples, so weighed, are from being the receiver itself: their axis
  // (GatherRules' lobeAxis) from its own, and their place from its own along the normal in parts of
  // the distance of samples. Both are 0 where receivers lie on a plane.
  float axis_error = 0, height_error = 0;
};

// A receiver and the axis of its lobe.
struct FitPoint {
  LocalReceiver receiver;
  glm::vec3 axis{0};
};

inline constexpr std::uint32_t kNoPlace = ~std::uint32_t{0};

// Fits at points[at] from points at `samples`, nearest ones first where `at` is, but for `except`.
// `samples` may hold any that do not resemble it: they are left out.
LocalFit fitLocally(std::span<const FitPoint> points, std::uint32_t at,
                    std::span<const std::uint16_t> samples, std::uint32_t except = kNoPlace);

}  // namespace surfeit
