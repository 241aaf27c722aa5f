#include "octree/page/scene_header.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <tuple>
#include <vector>

namespace surfeit {
namespace {

using testing::HasSubstr;

constexpr std::uint32_t kNodePages = 3, kSurfelPages = 4;

SceneHeader rightHeader() {
  SceneHeader header;
  header.surfel_count = 100;
  header.node_count = 20;
  header.leaf_capacity = 16;
  header.node_group_capacity = 128;
  header.surfel_group_capacity = 512;
  header.flatness_limit = 0.97f;
  header.bounds = {glm::vec3(0), glm::vec3(1)};
  for (std::size_t level = 1; level < std::size(header.level_first_page); ++level) {
    header.level_first_page[level] = level == 1 ? 1 : kNodePages;
  }
  return header;
}

struct WrongField {
  const char* told;
  std::function<void(SceneHeader&)> edit;
};

TEST(SceneHeader, EveryFieldOutOfRangeIsRefusedByName) {
  ASSERT_TRUE(decodeSceneHeader(encodeSceneHeader(rightHeader()), kNodePages, kSurfelPages).ok());
  constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const std::vector<WrongField> edits = {
      {"bounds", [](SceneHeader& h) { h.bounds.min.y = -INFINITY; }},
      {"bounds", [](SceneHeader& h) { h.bounds.max.z = INFINITY; }},
      {"bounds", [](SceneHeader& h) { h.bounds.min.x = kNaN; }},
      {"bounds", [](SceneHeader& h) { h.bounds.max.x = kNaN; }},
      {"bounds", [](SceneHeader& h) { h.bounds.min.x = 2; }},
      {"root cube origin", [](SceneHeader& h) { h.cube.origin[2] = kInfinity; }},
      {"origin", [](SceneHeader& h) { h.origin.y = 2e12; }},
      {"origin", [](SceneHeader& h) { h.origin.x = double(kNaN); }},
      {"root cube size", [](SceneHeader& h) { h.cube.size = kInfinity; }},
      {"root cube size", [](SceneHeader& h) { h.cube.size = 0; }},
      {"flatness limit", [](SceneHeader& h) { h.flatness_limit = 1.5f; }},
      {"flatness limit", [](SceneHeader& h) { h.flatness_limit = -.5f; }},
      {"leaf capacity", [](SceneHeader& h) { h.leaf_capacity = 0; }},
      {"node group capacity", [](SceneHeader& h) { h.node_group_capacity = 7; }},
      {"node group capacity", [](SceneHeader& h) { h.node_group_capacity = 4097; }},
      {"surfel group capacity", [](SceneHeader& h) { h.surfel_group_capacity = 0; }},
      {"surfel group capacity", [](SceneHeader& h) { h.surfel_group_capacity = 16385; }},
      {"surfel count", [](SceneHeader& h) { h.surfel_count = kSurfelPages - 1; }},
      {"surfel count", [](SceneHeader& h) { h.surfel_count = kSurfelPages * 512 + 1; }},
      {"node count", [](SceneHeader& h) { h.node_count = kNodePages - 1; }},
      {"node count", [](SceneHeader& h) { h.node_count = kNodePages * 128 + 1; }},
      {"level table", [](SceneHeader& h) { h.level_first_page[0] = 1; }},
      {"level table", [](SceneHeader& h) { h.level_first_page[1] = 2; }},
      {"level table", [](SceneHeader& h) { h.level_first_page[kCurveLevels + 1] = 4; }},
      {"level table", [](SceneHeader& h) { h.level_first_page[5] = 2; }}};
  for (std::size_t i = 0; i < edits.size(); ++i) {
    SceneHeader header = rightHeader();
    edits[i].edit(header);
    const Result<SceneHeader> decoded =
        decodeSceneHeader(encodeSceneHeader(header), kNodePages, kSurfelPages);
    ASSERT_FALSE(decoded.ok()) << i << ": " << edits[i].told;
    EXPECT_EQ(decoded.status().code(), StatusCode::kCorruption);
    EXPECT_THAT(decoded.status().message(), HasSubstr(edits[i].told)) << i;
  }
}

TEST(SceneHeader, UnknownBitsAreRefused) {
  const std::vector<std::byte> right = encodeSceneHeader(rightHeader());
  constexpr std::size_t kFeatures = 0, kChannels = 4;
  for (int bit = 0; bit < 32; ++bit) {
    for (const auto& [at, known, told] :
         {std::tuple{kFeatures, 9, "feature bits"}, std::tuple{kChannels, 9, "channel bits"}}) {
      std::vector<std::byte> fields = right;
      fields[at + std::size_t(bit / 8)] |= std::byte(1 << bit % 8);
      const Result<SceneHeader> decoded = decodeSceneHeader(fields, kNodePages, kSurfelPages);
      // Without opacity there is no tint, bit 9 of the channels
      EXPECT_EQ(decoded.ok(), bit < known) << told << ' ' << bit;
      if (decoded.ok()) continue;
      EXPECT_THAT(decoded.status().message(), HasSubstr(told));
    }
  }
}

TEST(SceneHeader, TintsAreOfWhatHasOpacity) {
  SceneHeader header = rightHeader();
  header.channels.opacity = header.channels.tint = true;
  const Result<SceneHeader> decoded =
      decodeSceneHeader(encodeSceneHeader(header), kNodePages, kSurfelPages);
  ASSERT_TRUE(decoded.ok()) << decoded.status().message();
  EXPECT_TRUE(decoded->channels.tint);
  EXPECT_TRUE(decoded->pageForm().has_tints);
  header.channels.opacity = false;
  EXPECT_THAT(
      decodeSceneHeader(encodeSceneHeader(header), kNodePages, kSurfelPages).status().message(),
      HasSubstr("channel bits"));
}

}  // namespace
}  // namespace surfeit
