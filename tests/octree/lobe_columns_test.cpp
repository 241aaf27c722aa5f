// Lobes on their way to pages of surfels and back.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstddef>
#include <span>
#include <vector>

#include "octree/node/lobe.h"
#include "octree/page/surfel_group.h"
#include "octree/test_scenes.h"

namespace surfeit {
namespace {

using testing::HasSubstr;

constexpr PageForm kExactForm = {.full_precision = true, .has_albedo = true};
constexpr PageForm kLobedForm = {.full_precision = true, .has_albedo = true, .has_lobes = true};

class LobePages : public testing::Test {
 protected:
  LobePages() {
    for (std::size_t i = 0; i < surfels_.size(); ++i) {
      radiosity_.push_back(surfels_[i].radiosity);
      lobes_.push_back(i % 3 == 0
                           ? Lobe()
                           : Lobe::encode(random_.point(), random_.unit() * random_.direction()));
    }
    encodeSurfelGroup(surfels_, kExactForm, plain_);
    EXPECT_TRUE(replaceSurfelRadiosity(plain_, kExactForm, radiosity_, lobed_, lobes_).ok());
  }

  TestRandom random_{3};
  std::vector<Surfel> surfels_ = randomCloud(300);
  std::vector<glm::vec3> radiosity_;
  std::vector<Lobe> lobes_;
  std::vector<std::byte> plain_, lobed_;
};

TEST_F(LobePages, HoldLobesBesideTheSurfels) {
  std::vector<Surfel> found(512);
  std::vector<Lobe> lobes(512);
  const auto count = decodeSurfelGroup(lobed_, kLobedForm, found, lobes);
  ASSERT_TRUE(count.ok()) << count.status().message();
  ASSERT_EQ(*count, 300u);
  lobes.resize(300);
  EXPECT_EQ(lobes, lobes_);
  for (std::size_t i = 0; i < 300; ++i) EXPECT_EQ(found[i].radiosity, radiosity_[i]);
  // Nobody need ask for them
  EXPECT_TRUE(decodeSurfelGroup(lobed_, kLobedForm, found).ok());
}

TEST_F(LobePages, LeaveThemOutToTheByte) {
  std::vector<std::byte> replaced;
  ASSERT_TRUE(replaceSurfelRadiosity(lobed_, kLobedForm, radiosity_, replaced).ok());
  EXPECT_EQ(replaced, plain_);
}

TEST_F(LobePages, DecodeRejectsEveryTruncation) {
  std::vector<Surfel> found(512);
  for (std::size_t size = 0; size < lobed_.size(); ++size) {
    ASSERT_FALSE(decodeSurfelGroup(std::span(lobed_).first(size), kLobedForm, found).ok()) << size;
  }
}

TEST_F(LobePages, NoMeanOfUnitVectorsIsLongerThanOne) {
  lobes_[7].mean = {32767, 3000, 0};
  ASSERT_TRUE(replaceSurfelRadiosity(plain_, kExactForm, radiosity_, lobed_, lobes_).ok());
  std::vector<Surfel> found(512);
  const auto count = decodeSurfelGroup(lobed_, kLobedForm, found);
  ASSERT_FALSE(count.ok());
  EXPECT_THAT(count.status().message(), HasSubstr("lobes"));
}

TEST(LobeSums, AreThoseOfTheParts) {
  TestRandom random(5);
  Node node{};
  node.flags = kNodeFlat;
  node.normal = {0, 0, 1};
  node.flatness = 1;
  PieceSums all{}, halves[2] = {};
  for (int i = 0; i < 100; ++i) {
    Surfel surfel = surfelAt(random.point(), {0, 0, 1}, .1f, random);
    const Lobe lobe = Lobe::encode(random.point(), random.direction() * .7f);
    addToPiece(node, surfel, lobe, all);
    addToPiece(node, surfel, lobe, halves[i % 2]);
  }
  PieceSums sum{};
  for (const PieceSums& half : halves) addToPieces(node, node, half, sum);
  EXPECT_EQ(lobesOf(node, sum)[0], lobesOf(node, all)[0]);
  EXPECT_FALSE(lobesOf(node, all)[0].isEven());
  // What has two sides, or none, sends evenly
  node.flags = kNodeFlat | kNodeTwoSided;
  EXPECT_TRUE(lobesOf(node, all)[0].isEven());
  node.flags = 0;
  EXPECT_TRUE(lobesOf(node, all)[0].isEven());
}

// Of pieces that face the same way, a surfel's lobe is of the one that is as opaque.
TEST(LobeSums, ArePartedByOpacity) {
  TestRandom random(7);
  Node node{};
  node.facet_count = 3;
  const float opacities[] = {1, .7f, .3f};
  for (std::size_t k = 0; k < 3; ++k) {
    node.facets[k] = {};
    node.facets[k].normal = {0, 0, 32767};
    node.facets[k].transparency = transparencyOf(double(opacities[k]));
  }
  for (std::size_t k = 0; k < 3; ++k) {
    Surfel surfel = surfelAt(random.point(), {0, 0, 1}, .1f, random);
    surfel.setOpacity(opacities[k], opacities[k], opacities[k]);
    PieceSums sums{};
    addToPiece(node, surfel, Lobe::encode(glm::vec3(1), {0, 0, .7f}), sums);
    for (std::size_t piece = 0; piece < 3; ++piece) {
      EXPECT_EQ(lobesOf(node, sums)[piece].isEven(), piece != k) << piece;
    }
  }
}

}  // namespace
}  // namespace surfeit
