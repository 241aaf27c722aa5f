// Surfels of a caller: the same scene as through a file, and the same rules.
#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <vector>

#include "octree/test_scenes.h"
#include "surfeit/surfel_source.h"

namespace surfeit {
namespace {

using testing::HasSubstr;

class IndexSurfelsTest : public SceneTest {
 protected:
  Result<IndexStats> indexProvided(SurfelProvider& provider, const std::string& name,
                                   bool strict = false) {
    IndexOptions options;
    options.memory_bytes = 64 << 20;
    options.threads = 2;
    options.strict = strict;
    return indexSurfels(provider, path(name), options, notes_);
  }

  class Notes : public Progress {
   public:
    void note(const std::string& message) override { text += message + "\n"; }
    std::string text;
  };
  Notes notes_;
};

TEST_F(IndexSurfelsTest, GivesTheSceneOfTheSameCloud) {
  for (const std::size_t count : {1u, 500u, 60'000u}) {
    const std::vector<Surfel> cloud = randomCloud(count);
    const std::string by_file = index(cloud, kAllChannels, IndexOptions());
    SurfelSpan span(cloud.data(), cloud.size(), kAllChannels);
    const Result<IndexStats> stats = indexProvided(span, "provided.sft");
    ASSERT_TRUE(stats.ok()) << stats.status().message();
    EXPECT_EQ(stats->surfels, count);
    std::ifstream file(by_file, std::ios::binary);
    const std::string expected((std::istreambuf_iterator<char>(file)), {});
    EXPECT_TRUE(contents("provided.sft") == expected) << count;
  }
}

TEST_F(IndexSurfelsTest, CountsFromTheProvidersOrigin) {
  const std::vector<Surfel> cloud = randomCloud(1000);
  const glm::dvec3 origin(5e5, -4e6, 100);
  SurfelSpan span(cloud.data(), cloud.size(), kAllChannels, origin);
  ASSERT_TRUE(indexProvided(span, "moved.sft").ok());
  const Result<SceneInfo> info = readSceneInfo(path("moved.sft"));
  ASSERT_TRUE(info.ok());
  SurfelSpan home(cloud.data(), cloud.size(), kAllChannels);
  ASSERT_TRUE(indexProvided(home, "home.sft").ok());
  const Result<SceneInfo> expected = readSceneInfo(path("home.sft"));
  ASSERT_TRUE(expected.ok());
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_NEAR(info->min[axis], expected->min[axis] + origin[axis], 1e-6);
    EXPECT_NEAR(info->max[axis], expected->max[axis] + origin[axis], 1e-6);
  }
}

TEST_F(IndexSurfelsTest, InvalidOnesAreSkippedAndTold) {
  std::vector<Surfel> cloud = randomCloud(100);
  cloud[17].position.x = std::numeric_limits<float>::quiet_NaN();
  cloud[40].radius = -1;
  SurfelSpan span(cloud.data(), cloud.size(), kAllChannels);
  const Result<IndexStats> stats = indexProvided(span, "skipped.sft");
  ASSERT_TRUE(stats.ok());
  EXPECT_EQ(stats->surfels, 98u);
  EXPECT_EQ(stats->skipped_records, 2u);
  EXPECT_THAT(notes_.text, HasSubstr("record 17"));
  const Status strict = indexProvided(span, "strict.sft", true).status();
  EXPECT_EQ(strict.code(), StatusCode::kCorruption);
  EXPECT_THAT(strict.message(), HasSubstr("record 17"));
}

TEST_F(IndexSurfelsTest, FailuresOfTheProviderEndTheJob) {
  class Broken : public SurfelSpan {
   public:
    using SurfelSpan::SurfelSpan;
    Status read(std::uint64_t first, std::size_t count, Surfel* surfels) override {
      if (first + count > 20'000) return Status::ioError("the host took its surfels back");
      return SurfelSpan::read(first, count, surfels);
    }
  };
  const std::vector<Surfel> cloud = randomCloud(30'000);
  Broken broken(cloud.data(), cloud.size(), kAllChannels);
  const Status status = indexProvided(broken, "broken.sft").status();
  EXPECT_EQ(status.code(), StatusCode::kIoError);
  EXPECT_THAT(status.message(), HasSubstr("took its surfels back"));
  EXPECT_FALSE(std::filesystem::exists(path("broken.sft")));
  SurfelSpan none(cloud.data(), 0, kAllChannels);
  EXPECT_FALSE(indexProvided(none, "none.sft").ok());
}

// What surfels lack is found as for clouds.
TEST_F(IndexSurfelsTest, MissingSizesAreFoundFromTheNeighbours) {
  std::vector<Surfel> cloud;
  for (int i = 0; i < 40 * 40; ++i) {
    Surfel surfel;
    surfel.position = {float(i % 40) / 40, 0, float(i / 40) / 40};
    surfel.normal = {0, 1, 0};
    cloud.push_back(surfel);
  }
  SurfelSpan span(cloud.data(), cloud.size(), {.normal = true});
  ASSERT_TRUE(indexProvided(span, "sized.sft").ok());
  const Result<ReadScene> scene = readScene(path("sized.sft"));
  ASSERT_TRUE(scene.ok());
  double area = 0;
  for (const Surfel& surfel : scene->surfels) area += double(surfel.area);
  EXPECT_NEAR(area, 1, .05);
}

}  // namespace
}  // namespace surfeit
