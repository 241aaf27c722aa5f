// What is loose in a rough node hides of its outline what pieces do that lie in it at random.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "gather/rules/contribution.h"
#include "gather/rules/fidelity.h"

namespace surfeit {
namespace {

// A ball of radius 1 that is full of leaves is as wide as the ball, and hides what is spread in
// that at random; half of it being surface, it is half way to what a surface covers.
TEST(RoughNode, OfAThicketCoversItsOutlineInPart) {
  Node node{};
  node.radius = 1;
  node.forgetBounds();
  node.area = 4 * kPi;
  node.covariance = {{.2f, .2f, .2f, 0, 0, 0}};
  const glm::vec3 direction = {0, 0, 1};
  for (const float shown : {.1f, 1.f, 10.f}) {
    node.surfel_count = 1;
    const float alone = roughCover(node, direction, shown, 1).opacity;
    EXPECT_NEAR(alone, std::min(1.f, shown / kPi), .01f);
    node.surfel_count = 2;
    const float missed = std::max(0.f, 1 - shown / (2 * kPi));
    EXPECT_NEAR(roughCover(node, direction, shown, 1).opacity, 1 - missed * missed, .01f);
    node.surfel_count = 1000;
    const RoughCover leaves = roughCover(node, direction, shown, 1);
    EXPECT_NEAR(leaves.area, kPi, .02f);
    EXPECT_NEAR(leaves.opacity, 1 - std::exp(-shown / kPi), .01f);
    const RoughCover surface = roughCover(node, direction, shown, 0);
    EXPECT_NEAR(surface.area, std::min(shown, kFidelity.filled_outline * .8f * kPi), .03f);
    EXPECT_EQ(surface.opacity, 1);
    const RoughCover half = roughCover(node, direction, shown, .5f);
    EXPECT_NEAR(half.area, (leaves.area + surface.area) / 2, 1e-5f);
    EXPECT_NEAR(half.area * half.opacity, (leaves.area * leaves.opacity + surface.area) / 2, 1e-5f);
  }
}

}  // namespace
}  // namespace surfeit
