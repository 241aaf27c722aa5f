// The gain of a lobe towards a direction (gather/rules/lobe_light.h).
#include <gtest/gtest.h>

#include <cmath>

#include "gather/rules/lobe_light.h"

namespace surfeit {
namespace {

// The mean over the hemisphere, weighted by the cosine.
TEST(LobeGain, IsOneOnTheMeanAndNeverNegative) {
  constexpr int kSteps = 400;
  for (const float length : {0.f, .2f, .5f, .8f, .9f, .97f, .995f}) {
    for (const float degrees : {0.f, 30.f, 60.f, 75.f}) {
      const float angle = degrees * 3.14159265f / 180;
      const glm::vec3 mean = length * glm::vec3(std::sin(angle), 0, std::cos(angle));
      const LobeLight lobe(Lobe::encode({1, 1, 1}, mean), {0, 0, 1});
      double sum = 0;
      for (int i = 0; i < kSteps; ++i) {
        // Even steps of the squared cosine weigh by it
        const float z = std::sqrt((float(i) + .5f) / kSteps), s = std::sqrt(1 - z * z);
        for (int k = 0; k < kSteps; ++k) {
          const float phi = 2 * 3.14159265f * (float(k) + .5f) / kSteps;
          const float gain = lobe.gain({s * std::cos(phi), s * std::sin(phi), z}, 0);
          ASSERT_GE(gain, 0);
          sum += double(gain);
        }
      }
      EXPECT_NEAR(sum / (kSteps * kSteps), 1, .02) << length << " at " << degrees;
    }
  }
}

TEST(LobeGain, LeavesNothingBelowZero) {
  const LobeLight lobe(Lobe::encode({1, .5f, 0}, {0, 0, .99f}), {0, 0, 1});
  const glm::vec3 behind = lobe.part({1, 0, 0}, 0);
  EXPECT_GE(behind.r, 0);
  EXPECT_LT(behind.r, 1e-3f);
  EXPECT_NEAR(behind.g, .5f, 5e-3f);
  EXPECT_EQ(behind.b, 1);
  EXPECT_GT(lobe.part({0, 0, 1}, 0).r, 10);
}

}  // namespace
}  // namespace surfeit
