// Scenes that are made to deceive: every checksum is right.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <string>
#include <vector>

#include "octree/scene_damage.h"
#include "octree/test_scenes.h"
#include "surfeit/scene.h"

namespace surfeit {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;

class HostileSceneFileTest : public SceneTest {
 protected:
  std::string fullScene(std::size_t count) {
    IndexOptions options;
    options.leaf_capacity = 4;
    options.full_precision = true;
    return index(randomCloud(count), kAllChannels, options);
  }
  std::vector<std::string> findingsAfterNodes(
      const std::string& scene, std::uint32_t page,
      const std::function<void(std::vector<LevelNode>&)>& edit) {
    const Status status = editNodes(scene, path("edited.sft"), page, edit);
    EXPECT_TRUE(status.ok()) << status.message();
    return findingsOf(path("edited.sft"));
  }
  std::vector<std::string> findingsAfterSurfels(
      const std::string& scene, const std::function<void(std::vector<Surfel>&)>& edit) {
    const Status status = editSurfels(scene, path("edited.sft"), 0, edit);
    EXPECT_TRUE(status.ok()) << status.message();
    return findingsOf(path("edited.sft"));
  }
};

// Each leaf of the last page refers to all surfels: a walk would meet millions.
TEST_F(HostileSceneFileTest, LeavesThatShareAllSurfelsAreNotWalked) {
  constexpr std::size_t kSurfels = 60000;
  const std::string scene = fullScene(kSurfels);
  const Result<SceneInfo> info = readSceneInfo(scene);
  ASSERT_TRUE(info.ok());
  const auto share = [&](std::vector<LevelNode>& nodes) {
    for (LevelNode& node : nodes) {
      if (!node.node.isLeaf()) continue;
      node.node.page = node.node.first = 0;
      node.node.surfel_count = kSurfels;
    }
  };
  EXPECT_THAT(findingsAfterNodes(scene, info->node_pages - 1, share),
              Contains(HasSubstr("references form no tree")));
}

TEST_F(HostileSceneFileTest, LightThatIsNotThatBelowIsFound) {
  const std::string scene = fullScene(400);
  EXPECT_THAT(findingsAfterNodes(scene, 0, [](auto&) {}), IsEmpty());
  for (int color = 0; color < 3; ++color) {
    for (const float times : {0.f, .9f, 1.1f, 1e6f}) {
      EXPECT_THAT(
          findingsAfterNodes(scene, 0, [&](auto& n) { n[0].node.radiosity[color] *= times; }),
          Contains(HasSubstr("radiosity")));
    }
  }
}

TEST_F(HostileSceneFileTest, LightBeyondTheLimitIsDamage) {
  const std::string scene = fullScene(40);
  for (const float radiosity : {1.1e12f, 3.4e38f}) {
    EXPECT_THAT(findingsAfterSurfels(scene, [&](auto& s) { s[3].radiosity.y = radiosity; }),
                Contains(HasSubstr("damaged field radiosity")));
    EXPECT_THAT(findingsAfterNodes(scene, 0, [&](auto& n) { n[0].node.radiosity.z = radiosity; }),
                Contains(HasSubstr("damaged field radiosity")));
  }
}

TEST_F(HostileSceneFileTest, SurfelsOutsideTheHeadersBoundsAreFound) {
  const std::string scene = fullScene(400);
  constexpr std::size_t kGreatestX = 52;  // of the scene fields
  const Status status = rewriteScene(scene, path("edited.sft"), {}, [&](auto& fields) {
    float greatest;
    std::memcpy(&greatest, fields.data() + kGreatestX - 12, sizeof greatest);  // the least
    std::memcpy(fields.data() + kGreatestX, &greatest, sizeof greatest);
  });
  ASSERT_TRUE(status.ok()) << status.message();
  EXPECT_THAT(findingsOf(path("edited.sft")), Contains(HasSubstr("the header's bounds")));
}

TEST_F(HostileSceneFileTest, ThreadsOfVerifyAreCharged) {
  const std::string scene = fullScene(400);
  Progress quiet;
  const Status status = verifyScene(scene, 1024, quiet, std::uint64_t{64} << 20).status();
  EXPECT_EQ(status.code(), StatusCode::kBudgetTooSmall);
  EXPECT_THAT(status.message(), HasSubstr("1024 threads"));
}

}  // namespace
}  // namespace surfeit
