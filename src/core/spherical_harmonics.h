// Real spherical harmonics: the 9 of bands 0 to 2, with surfels projected onto them (memo 3.2), and
// the 9 of band 4.
//
// Order of the coefficients: Y00, Y1-1, Y10, Y11, Y2-2, Y2-1, Y20, Y21, Y22.
#pragma once

#include <array>
#include <glm/vec3.hpp>

namespace surfeit {

inline constexpr int kShCount = 9;
using ShCoefficients = std::array<float, kShCount>;

inline constexpr float kShY00 = 0.282094792f;

// Values of the 9 basis functions in unit direction d.
inline ShCoefficients shBasis(const glm::vec3& d) {
  return {kShY00,
          0.488602512f * d.y,
          0.488602512f * d.z,
          0.488602512f * d.x,
          1.092548431f * d.x * d.y,
          1.092548431f * d.y * d.z,
          0.315391565f * (3 * d.z * d.z - 1),
          1.092548431f * d.x * d.z,
          0.546274215f * (d.x * d.x - d.y * d.y)};
}

// Values of the 9 basis functions of band 4 in unit direction d: Y4-4 to Y44.
inline ShCoefficients shBand4(const glm::vec3& d) {
  const float xx = d.x * d.x, yy = d.y * d.y, zz = d.z * d.z;
  return {2.503342942f * d.x * d.y * (xx - yy),         1.770130769f * d.y * d.z * (3 * xx - yy),
          0.946174696f * d.x * d.y * (7 * zz - 1),      0.669046544f * d.y * d.z * (7 * zz - 3),
          0.105785547f * (zz * (35 * zz - 30) + 3),     0.669046544f * d.x * d.z * (7 * zz - 3),
          0.473087348f * (xx - yy) * (7 * zz - 1),      1.770130769f * d.x * d.z * (xx - 3 * yy),
          0.625835735f * (xx * (xx - 6 * yy) + yy * yy)};
}

// Zonal factors that turn Y_lm(n) into the coefficients of a lobe around n: band 0, 1, 2. A
// surfel is such a lobe, so no integration is needed (course, "Point Clustering").
using ZonalFactors = std::array<float, 3>;
inline constexpr float kPi = 3.14159265358979f;
// One-sided disk: max(d . n, 0) has factors pi, 2 pi / 3, pi / 4.
inline constexpr ZonalFactors kClampedCosine = {kPi, 2 * kPi / 3, kPi / 4};
// Two-sided disk: |d . n| has even bands only (memo 7.5).
inline constexpr ZonalFactors kAbsoluteCosine = {2 * kPi, 0, kPi / 2};
// Sphere: 1 in every direction.
inline constexpr ZonalFactors kConstant = {4 * kPi, 0, 0};

// Band of coefficient i.
inline constexpr std::array<int, kShCount> kShBand = {0, 1, 1, 1, 2, 2, 2, 2, 2};

// Value of the expansion in unit direction d, or of its band 4.
inline float shEvaluate(const ShCoefficients& coefficients, const ShCoefficients& basis) {
  float sum = 0;
  for (int i = 0; i < kShCount; ++i) sum += coefficients[i] * basis[i];
  return sum;
}

}  // namespace surfeit
