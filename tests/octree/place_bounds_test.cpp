#include "octree/neighbours/place_bounds.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <random>

namespace surfeit {
namespace {

class PlaceBoundsTest : public testing::Test {
 protected:
  glm::vec3 direction() {
    std::normal_distribution<float> any;
    return glm::normalize(glm::vec3(any(random_), any(random_), any(random_)));
  }

  std::mt19937 random_{1};
};

TEST_F(PlaceBoundsTest, TheGreatestCosineIsThatOfTheNearestNormalOfTheCone) {
  for (const float angle : {0.f, .1f, .7f, 1.5f, 2.4f, 3.f}) {
    PlaceBounds bounds;
    bounds.normal = direction(), bounds.normal_cosine = std::cos(angle);
    for (int i = 0; i < 200; ++i) {
      const glm::vec3 from = direction();
      const float between = std::acos(std::clamp(glm::dot(from, bounds.normal), -1.f, 1.f));
      EXPECT_NEAR(bounds.mostCosine(from), std::cos(std::max(0.f, between - angle)), 1e-3f);
      const glm::vec3 normal = direction();
      if (glm::dot(normal, bounds.normal) < bounds.normal_cosine) continue;
      EXPECT_GE(bounds.mostCosine(from), glm::dot(normal, from) - 1e-5f);
    }
  }
}

TEST_F(PlaceBoundsTest, WithoutAConeAnyNormalMayBeThere) {
  for (int i = 0; i < 20; ++i) EXPECT_EQ(PlaceBounds().mostCosine(direction()), 1);
}

}  // namespace
}  // namespace surfeit
