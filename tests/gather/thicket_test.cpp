// A rough node of loose pieces hides of its outline as much as pieces do that lie in it at random.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "gather/rules/contribution.h"

namespace surfeit {
namespace {

// A ball of radius 1 that is full of leaves is as wide as the ball, and hides what is spread in
// that at random.
TEST(RoughNode, OfAThicketCoversItsOutlineInPart) {
  Node node{};
  node.radius = 1;
  node.forgetBounds();
  node.area = 4 * kPi;
  node.covariance = {{.2f, .2f, .2f, 0, 0, 0}};
  node.rough.sh[0][kAreaKind] = node.area / (2 * kShY00);  // of two-sided pieces
  const glm::vec3 direction = {0, 0, 1};
  for (const float shown : {.1f, 1.f, 10.f}) {
    node.flags = kNodeLoose;
    node.surfel_count = 1;
    EXPECT_NEAR(roughCover(node, direction, shown).opacity, std::min(1.f, shown / kPi), .01f);
    node.surfel_count = 2;
    const float missed = std::max(0.f, 1 - shown / (2 * kPi));
    EXPECT_NEAR(roughCover(node, direction, shown).opacity, 1 - missed * missed, .01f);
    node.surfel_count = 1000;
    const RoughCover leaves = roughCover(node, direction, shown);
    EXPECT_NEAR(leaves.area, kPi, .02f);
    EXPECT_NEAR(leaves.opacity, 1 - std::exp(-shown / kPi), .01f);
    node.flags = 0;
    const RoughCover surface = roughCover(node, direction, shown);
    EXPECT_NEAR(surface.area, std::min(shown, .8f * kPi), .03f);
    EXPECT_EQ(surface.opacity, 1);
  }
  node.flags = kNodeLoose;  // few leaves before a wall
  node.rough.sh[0][kAreaKind] = .6f * node.area / (2 * kShY00);
  EXPECT_EQ(roughCover(node, direction, 1).opacity, 1);
}

}  // namespace
}  // namespace surfeit
