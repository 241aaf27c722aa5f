// What receivers see of a patch with a lobe (gather/packet/packet_lobe-inl.h).
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "gather/packet/packet_kernel.h"
#include "gather/rules/lobe_light.h"

namespace surfeit {
namespace {

// The radiosity of a small white patch at the origin, facing up, as it is seen in these directions.
std::vector<glm::vec3> seenOf(const LobeLight& lobe, std::span<const glm::vec3> directions) {
  Patch patch;
  patch.normal = {0, 0, 1};
  patch.radiosity = glm::vec3(1);
  std::vector<glm::vec3> seen;
  for (std::size_t begin = 0; begin < directions.size(); begin += kPacketReceivers) {
    const auto some =
        directions.subspan(begin, std::min(kPacketReceivers, directions.size() - begin));
    PacketLanes lanes{};
    for (std::size_t i = 0; i < some.size(); ++i) {
      lanes.x[i] = some[i].x;
      lanes.y[i] = some[i].y;
      lanes.z[i] = some[i].z;
    }
    PacketLights lights;
    fastestPacketKernel().seeLobe(lanes, some.size(), patch, lobe, lights);
    for (std::size_t i = 0; i < some.size(); ++i) {
      seen.emplace_back(lights.colors[0][i], lights.colors[1][i], lights.colors[2][i]);
    }
  }
  return seen;
}

// The mean over the hemisphere, weighted by the cosine.
TEST(LobeGain, IsOneOnTheMeanAndNeverNegative) {
  constexpr int kSteps = 400;
  std::vector<glm::vec3> directions;
  for (int i = 0; i < kSteps; ++i) {
    // Even steps of the squared cosine weigh by it
    const float z = std::sqrt((float(i) + .5f) / kSteps), s = std::sqrt(1 - z * z);
    for (int k = 0; k < kSteps; ++k) {
      const float phi = 2 * 3.14159265f * (float(k) + .5f) / kSteps;
      directions.emplace_back(s * std::cos(phi), s * std::sin(phi), z);
    }
  }
  for (const float length : {0.f, .2f, .5f, .8f, .9f, .97f, .995f}) {
    for (const float degrees : {0.f, 30.f, 60.f, 75.f}) {
      const float angle = degrees * 3.14159265f / 180;
      const glm::vec3 mean = length * glm::vec3(std::sin(angle), 0, std::cos(angle));
      const LobeLight lobe(Lobe::encode({1, 1, 1}, mean), {0, 0, 1});
      double sum = 0;
      for (const glm::vec3& seen : seenOf(lobe, directions)) {
        ASSERT_GE(seen.r, 0);
        sum += double(seen.r);
      }
      EXPECT_NEAR(sum / double(directions.size()), 1, .02) << length << " at " << degrees;
    }
  }
}

TEST(LobeGain, LeavesNothingBelowZero) {
  const LobeLight lobe(Lobe::encode({1, .5f, 0}, {0, 0, .99f}), {0, 0, 1});
  const std::vector<glm::vec3> seen = seenOf(lobe, std::vector<glm::vec3>{{1, 0, 0}, {0, 0, 1}});
  EXPECT_GE(seen[0].r, 0);
  EXPECT_LT(seen[0].r, 1e-3f);
  EXPECT_NEAR(seen[0].g, .5f, 5e-3f);
  EXPECT_EQ(seen[0].b, 1);
  EXPECT_GT(seen[1].r, 10);
}

}  // namespace
}  // namespace surfeit
