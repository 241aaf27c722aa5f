// tests/golden/v1.sft stays readable, with the same contents, in every version to come. Set
// SURFEIT_UPDATE_GOLDEN=1 to write it anew: only while version 1 has never been released.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <xxhash.h>
#include <zstd.h>

#include <cmath>
#include <cstdlib>

#include "octree/test_scenes.h"

namespace surfeit {
namespace {

// Of what v1.sft decodes to.
constexpr std::uint64_t kSurfelHash = 12531938469041694647ull;
constexpr std::uint64_t kNodeHash = 8909698455433171338ull;
// The zstd that compressed it: another one may store the same payloads in other bytes.
constexpr unsigned kZstdVersion = 10504;

const std::string kGolden = SURFEIT_TEST_SOURCE_DIR "/golden/v1.sft";

// Surfels of all kinds by operations that IEEE 754 defines to the last bit.
std::vector<Surfel> goldenCloud() {
  std::vector<Surfel> cloud;
  for (int i = 0; i < 300; ++i) {
    const float t = float(i) / 300;
    Surfel surfel;
    surfel.position = {t, t * t, float(i * 37 % 300) / 300};
    glm::vec3 normal(0.5f - t, 1, t);
    surfel.normal = normal / std::sqrt(glm::dot(normal, normal));
    surfel.radius = 0.01f + 0.05f * t;
    surfel.area = 2 * surfel.radius * surfel.radius;
    surfel.radiosity = {t, 1 - t, 100 * t * t};
    surfel.albedo = {0.5f, t, 1};
    if (i % 10 == 3) surfel.flags = kSurfelTwoSided;
    if (i % 10 == 7) {
      surfel.flags = kSurfelSphere;
      surfel.normal = glm::vec3(0);
    }
    cloud.push_back(surfel);
  }
  return cloud;
}

using GoldenTest = SceneTest;

TEST_F(GoldenTest, VersionOneDecodesToTheSameContents) {
  const char* update = std::getenv("SURFEIT_UPDATE_GOLDEN");
  if (update != nullptr && std::string(update) == "1") {
    writeBytes(kGolden, bytesOf(index(goldenCloud())));
  }
  EXPECT_THAT(findingsOf(kGolden), testing::IsEmpty());
  const Result<ReadScene> scene = readScene(kGolden);
  ASSERT_TRUE(scene.ok()) << scene.status().message();
  ASSERT_EQ(scene->surfels.size(), 300u);
  std::uint64_t node_hash = 0;
  for (const auto& [node, first] : scene->nodes) {
    // In the order of the file, kind by kind
    Node stored = node;
    float* coefficient = &stored.sh[0][0];
    for (int kind = 0; kind < kNodeShKinds; ++kind) {
      for (const float value : node.coefficients(kind)) *coefficient++ = value;
    }
    node_hash = XXH3_64bits_withSeed(&stored, sizeof stored, node_hash);
  }
  EXPECT_EQ(XXH3_64bits(scene->surfels.data(), scene->surfels.size() * sizeof(Surfel)),
            kSurfelHash);
  EXPECT_EQ(node_hash, kNodeHash);
}

TEST_F(GoldenTest, IndexingWritesTheSameFile) {
  const std::string scene = index(goldenCloud());
  if (ZSTD_versionNumber() != kZstdVersion) {
    GTEST_SKIP() << "zstd " << ZSTD_versionNumber() << " may compress otherwise than "
                 << kZstdVersion;
  }
  EXPECT_TRUE(bytesOf(scene) == bytesOf(kGolden));
}

}  // namespace
}  // namespace surfeit
