#include "core/spherical_harmonics.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <glm/geometric.hpp>

namespace surfeit {
namespace {

// Integrates f over the sphere by a midpoint rule.
double integrateSphere(const std::function<double(glm::vec3)>& f) {
  const int rows = 400, columns = 800;
  double sum = 0;
  for (int j = 0; j < rows; ++j) {
    const double z = -1 + (j + 0.5) * 2 / rows, s = std::sqrt(1 - z * z);
    for (int i = 0; i < columns; ++i) {
      const double phi = (i + 0.5) * 2 * M_PI / columns;
      sum += f(glm::vec3(float(s * std::cos(phi)), float(s * std::sin(phi)), float(z)));
    }
  }
  return sum * 4 * M_PI / (rows * columns);
}

void expectProjection(const ZonalFactors& factors, const std::function<double(double)>& lobe) {
  const glm::vec3 n = glm::normalize(glm::vec3(0.3f, -0.5f, 0.8f));
  const ShCoefficients basis_n = shBasis(n);
  for (int i = 0; i < kShCount; ++i) {
    const double expected = integrateSphere(
        [&](glm::vec3 d) { return lobe(double(glm::dot(d, n))) * double(shBasis(d)[i]); });
    EXPECT_NEAR(factors[kShBand[i]] * basis_n[i], expected, 2e-4) << "coefficient " << i;
  }
}

TEST(SphericalHarmonics, BasisIsOrthonormal) {
  for (int a = 0; a < kShCount; ++a) {
    for (int b = a; b < kShCount; ++b) {
      const double dot = integrateSphere(
          [&](glm::vec3 d) { return double(shBasis(d)[a]) * double(shBasis(d)[b]); });
      EXPECT_NEAR(dot, a == b ? 1.0 : 0.0, 2e-4) << a << " " << b;
    }
  }
}

TEST(SphericalHarmonics, Band4IsOrthonormalAndApartFromBands0To2) {
  for (int a = 0; a < kShCount; ++a) {
    for (int b = 0; b < kShCount; ++b) {
      const double dot = integrateSphere(
          [&](glm::vec3 d) { return double(shBand4(d)[a]) * double(shBand4(d)[b]); });
      EXPECT_NEAR(dot, a == b ? 1.0 : 0.0, 2e-4) << a << " " << b;
      const double apart = integrateSphere(
          [&](glm::vec3 d) { return double(shBand4(d)[a]) * double(shBasis(d)[b]); });
      EXPECT_NEAR(apart, 0, 2e-4) << a << " " << b;
    }
  }
}

TEST(SphericalHarmonics, ZonalFactorsEqualTheIntegralsOfTheMemo) {
  expectProjection(kClampedCosine, [](double cosine) { return std::max(cosine, 0.0); });
  expectProjection(kAbsoluteCosine, [](double cosine) { return std::abs(cosine); });
  expectProjection(kConstant, [](double) { return 1.0; });
}

}  // namespace
}  // namespace surfeit
