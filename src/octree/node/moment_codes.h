// Fractions, and covariances, in bytes: how pages hold the moments of nodes and of their facets.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "core/symmetric_matrix.h"

namespace surfeit {

// 0..1, and -1..1 with 0 exact, as a byte. What is outside, and NaN, becomes an end.
inline std::uint8_t fractionCode(float value) {
  return static_cast<std::uint8_t>(255 * std::clamp(value > 0 ? value : 0, 0.f, 1.f) + 0.5f);
}
inline float fractionOf(std::uint8_t code) { return float(code) * (1.f / 255); }
inline std::uint8_t signedFractionCode(float value) {
  return static_cast<std::uint8_t>(127 * std::clamp(value > -1 ? value : -1, -1.f, 1.f) + 128.5f);
}
inline float signedFractionOf(std::uint8_t code) { return float(int{code} - 128) * (1.f / 127); }

// Floats in -limit..limit as 16-bit integers; limit itself is not stored.
inline std::int16_t signedCode(float value, float limit) {
  const float scaled = value * (32767 / limit);
  const float above = scaled > -32767 ? scaled : -32767;  // NaN too
  const float clamped = above < 32767 ? above : 32767;
  return static_cast<std::int16_t>(static_cast<std::int32_t>(clamped + 32768.5f) - 32768);
}

// A covariance within a sphere: the root of its trace over the radius, its entries over the trace;
// zz follows from the others.
using CovarianceCodes = std::array<std::uint8_t, SymmetricMatrix::kEntries>;

// Off the diagonal an entry is no more than half of the trace.
inline constexpr float kMostShear = 0.5f;

inline CovarianceCodes covarianceCodes(const SymmetricMatrix& covariance, float radius) {
  const float trace = covariance.trace();
  CovarianceCodes codes;
  codes[0] = fractionCode(std::sqrt(trace) / radius);
  for (std::size_t k = 0; k < 2; ++k) {
    codes[1 + k] = fractionCode(covariance.entries[k] / trace);
  }
  for (std::size_t k = 3; k < codes.size(); ++k) {
    codes[k] = signedFractionCode(covariance.entries[k] / (kMostShear * trace));
  }
  return codes;
}

// The root of its trace.
inline float deviationOf(const CovarianceCodes& codes, float radius) {
  return radius * fractionOf(codes[0]);
}
inline SymmetricMatrix covarianceOf(const CovarianceCodes& codes, float radius) {
  const float deviation = deviationOf(codes, radius), trace = deviation * deviation;
  const float xx = fractionOf(codes[1]), yy = fractionOf(codes[2]);
  SymmetricMatrix covariance;
  covariance.entries = {trace * xx, trace * yy, trace * std::max(0.f, 1 - xx - yy), 0, 0, 0};
  for (std::size_t k = 3; k < codes.size(); ++k) {
    covariance.entries[k] = trace * kMostShear * signedFractionOf(codes[k]);
  }
  return covariance;
}

}  // namespace surfeit
