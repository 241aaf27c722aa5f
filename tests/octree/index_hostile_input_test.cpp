// Indexing clouds that are damaged, that change while they are read, and whose shape is the worst
// for an indexer.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "octree/spilling_index_test.h"

namespace surfeit {
namespace {

using testing::AnyOf;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr std::size_t kManySurfels = kOneBucket + 5000;
constexpr int kMostReads = 5000;  // more than any run here makes

class IndexHostileInputTest : public SpillingIndexTest {
 protected:
  // Something happens to the cloud before its read number `first`, first + stride, ...: the outcome
  // is the right scene, or an error that names the cloud and leaves what was there. Returns how
  // often it was an error.
  int actBeforeReads(const std::function<void()>& action, int first, int stride) {
    const std::string cloud = contents("in/cloud.ply");
    int errors = 0;
    for (int number = first; number < kMostReads; number += stride) {
      SCOPED_TRACE(testing::Message() << "read " << number);
      write("in/cloud.ply", cloud);
      write("out/scene.sft", "old");
      std::atomic<int> reads{0};
      const CallFilter input_reads = readsBelow(path("in"));
      ActAtCall act([&](const CallInfo& info) { return input_reads(info) && ++reads == number; },
                    action);
      Status status;
      {
        const Faults faults({&act});
        status = tryIndex().status();
      }
      errors += status.ok() ? 0 : 1;
      checkOutcome(status);
      if (!act.hasActed() || HasFailure()) return errors;
    }
    ADD_FAILURE() << "the reads come to no end";
    return errors;
  }

  void checkOutcome(const Status& status) {
    const std::string scene = contents("out/scene.sft");
    if (status.ok()) {
      EXPECT_TRUE(scene == expected_ || scene == also_expected_);
    } else {
      EXPECT_THAT(status.message(), AnyOf(HasSubstr("cloud.ply"), HasSubstr("input changed")));
      EXPECT_EQ(scene, "old");
    }
    EXPECT_THAT(filesIn("temp"), IsEmpty());
  }

  // How often the cloud is read from when nothing happens.
  int countReads() {
    CountCalls reads(readsBelow(path("in")));
    const Faults faults({&reads});
    EXPECT_TRUE(tryIndex().ok());
    return reads.count();
  }

  std::string also_expected_;  // the scene of what the cloud may have become before it was opened

  // Indexes without a temporary file too, and with fewer threads: the same scene.
  void expectSameSceneInMemory() {
    IndexOptions options;
    options.threads = 1;
    const Result<IndexStats> stats =
        indexClouds({path("in/cloud.ply")}, path("memory.sft"), options, progress_);
    ASSERT_TRUE(stats.ok()) << stats.status().message();
    EXPECT_TRUE(contents("memory.sft") == expected_);
  }
};

// Small clouds are read once; of larger ones a sample is read first, by many reads that are alike.
constexpr struct {
  std::size_t surfels;
  int stride;
} kReadings[] = {{5000, 1}, {40000, 211}};

TEST_F(IndexHostileInputTest, CloudRemovedWhileItIsReadGivesTheSceneOrAnError) {
  for (const auto& [surfels, stride] : kReadings) {
    makeScene(randomCloud(surfels));
    actBeforeReads([&] { std::filesystem::remove(path("in/cloud.ply")); }, 1, stride);
  }
}

TEST_F(IndexHostileInputTest, CloudCutWhileItIsReadIsRefused) {
  for (const auto& [surfels, stride] : kReadings) {
    makeScene(randomCloud(surfels));
    const std::uint64_t size = contents("in/cloud.ply").size();
    for (const std::uint64_t left : {size / 2, size - 1, std::uint64_t{0}}) {
      const int errors = actBeforeReads(
          [&] { std::filesystem::resize_file(path("in/cloud.ply"), left); }, 1, stride);
      EXPECT_GT(errors, 1);
    }
  }
}

TEST_F(IndexHostileInputTest, CloudReplacedBetweenTwoPassesIsNoticed) {
  // The sample misses the outlier, without which the curve is another: all is read again
  std::vector<Surfel> cloud = randomCloud(140'000), other = randomCloud(140'000, 2);
  cloud[70'000].position = other[70'000].position = {100, 0, 0};
  makeScene(other);
  also_expected_ = expected_;
  std::filesystem::rename(path("in/cloud.ply"), path("other.ply"));
  makeScene(cloud);
  const auto replace = [&] {
    std::filesystem::copy_file(path("other.ply"), path("new.ply"));
    std::filesystem::rename(path("new.ply"), path("in/cloud.ply"));
  };
  const int passes = 2 * static_cast<int>(contents("in/cloud.ply").size() >> 18);
  EXPECT_GT(actBeforeReads(replace, countReads() - passes - 10, 5), 0);
}

TEST_F(IndexHostileInputTest, CutCloudsAreRefusedWithTheirCounts) {
  for (const std::size_t count : {100u, 9000u}) {
    writeCloud(path("in/cloud.ply"), randomCloud(count));
    const std::uint64_t size = contents("in/cloud.ply").size();
    for (const double part : {0.77, 0.5, 0.9999}) {
      writeCloud(path("in/cloud.ply"), randomCloud(count));
      std::filesystem::resize_file(path("in/cloud.ply"),
                                   static_cast<std::uint64_t>(double(size) * part));
      const Status status = tryIndex().status();
      EXPECT_EQ(status.code(), StatusCode::kCorruption);
      EXPECT_THAT(status.message(), HasSubstr("cloud.ply"));
      EXPECT_THAT(status.message(), HasSubstr(std::to_string(count)));
      EXPECT_THAT(filesIn("out"), IsEmpty());
    }
  }
}

TEST_F(IndexHostileInputTest, FarOutliersDoNotChangeWhatTheRestBecomes) {
  for (const float distance : {1e2f, 1e5f, 1e9f, 9e11f}) {
    SCOPED_TRACE(distance);
    std::vector<Surfel> cloud = randomCloud(kManySurfels);
    cloud[12345].position = {distance, -distance, distance};
    makeScene(cloud);
    expectSameSceneInMemory();
  }
}

TEST_F(IndexHostileInputTest, RepeatedSurfelsAreAllKept) {
  for (const std::size_t different : {std::size_t{1}, std::size_t{2}, kManySurfels / 2}) {
    SCOPED_TRACE(different);
    std::vector<Surfel> cloud = randomCloud(kManySurfels);
    for (std::size_t i = different; i < cloud.size(); ++i) cloud[i] = cloud[i % different];
    makeScene(cloud);
    expectSameSceneInMemory();
  }
}

TEST_F(IndexHostileInputTest, RepeatedPositionsAreAllKept) {
  std::vector<Surfel> cloud = randomCloud(kManySurfels);
  for (std::size_t i = 0; i < cloud.size(); ++i) cloud[i].position = cloud[i % 2].position;
  makeScene(cloud);
  expectSameSceneInMemory();
  // Only the last word of the content differs
  for (Surfel& surfel : cloud) {
    const glm::vec3 albedo = surfel.albedo;
    surfel = cloud[0];
    surfel.albedo = albedo;
  }
  makeScene(cloud);
  expectSameSceneInMemory();
}

TEST_F(IndexHostileInputTest, DegenerateShapesMakeSoundScenes) {
  std::vector<Surfel> line = randomCloud(kManySurfels);
  for (Surfel& surfel : line) surfel.position.y = surfel.position.z = 0;
  for (const std::vector<Surfel>& cloud :
       {line, moved(randomCloud(kManySurfels), 1, glm::vec3(1e9f)),
        moved(randomCloud(kManySurfels), 1e9f, glm::vec3(-1e9f)),
        moved(randomCloud(kManySurfels), 1e-9f, {}),
        moved(randomCloud(kManySurfels), 1e-9f, glm::vec3(1e-9f)), planeCloud(200, 1e-3f)}) {
    makeScene(cloud);
    expectSameSceneInMemory();
  }
}

TEST_F(IndexHostileInputTest, PointsWithoutSizesOfTheWorstShapesMakeSoundScenes) {
  std::vector<Surfel> outlier = randomCloud(10000), equal(10000);
  outlier[7].position = glm::vec3(1e9f);
  for (const std::vector<Surfel>& cloud : {outlier, equal}) {
    makeScene(cloud, kPositionsOnly);
    expectSameSceneInMemory();
  }
}

TEST_F(IndexHostileInputTest, SurfelsOnAGridMoveByNoMoreThanAThousandthOfTheirRadius) {
  // One millimetre apart, a kilometre away from the origin in one direction
  std::vector<Surfel> cloud = planeCloud(150, 1e-3f);
  for (Surfel& surfel : cloud) surfel.position.z = 1000;
  makeScene(cloud);
  const Result<ReadScene> scene = readScene(path("out/scene.sft"));
  ASSERT_TRUE(scene.ok());
  const auto byPlace = [](const Surfel& a, const Surfel& b) {
    const glm::vec3 p = glm::round(a.position * 1e3f), q = glm::round(b.position * 1e3f);
    return std::pair(p.y, p.x) < std::pair(q.y, q.x);
  };
  std::vector<Surfel> stored = scene->surfels;
  for (Surfel& surfel : stored) {
    surfel.position = glm::vec3(glm::dvec3(surfel.position) + scene->header.origin);
  }
  std::sort(stored.begin(), stored.end(), byPlace);
  ASSERT_EQ(stored.size(), cloud.size());
  double shift = 0;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    ASSERT_LE(glm::length(stored[i].position - cloud[i].position), 1.01e-3f * cloud[i].radius);
    shift += double(stored[i].position.x - cloud[i].position.x);
  }
  // Rounded, not cut: errors of both signs
  EXPECT_LT(std::abs(shift) / double(cloud.size()), 1e-4 * double(cloud[0].radius));
}

TEST_F(IndexHostileInputTest, PartsInAnyOrderMakeTheSameScene) {
  std::vector<Surfel> cloud = randomCloud(70000);
  for (std::size_t i = 0; i < 17000; ++i) cloud[i * 4] = cloud[i];
  makeScene(cloud);
  std::shuffle(cloud.begin(), cloud.end(), std::mt19937(3));
  std::vector<std::string> parts;
  for (std::size_t k = 0; k < 5; ++k) {
    parts.push_back(path("in/part" + std::to_string(k) + ".ply"));
    writeCloud(parts.back(), std::span(cloud).subspan(k * 14000, 14000));
  }
  for (const int threads : {1, 2, 5}) {
    options_.threads = threads;
    std::rotate(parts.begin(), parts.begin() + 2, parts.end());
    const Result<IndexStats> stats = indexClouds(parts, path("out/parts.sft"), options_, progress_);
    ASSERT_TRUE(stats.ok()) << stats.status().message();
    EXPECT_TRUE(contents("out/parts.sft") == expected_);
  }
}

}  // namespace
}  // namespace surfeit
