// Clouds of bare positions with strays: all but a few positions lie in one cell of the curve.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <fstream>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "index/notes/stray_note.h"
#include "octree/build/curve_sort.h"
#include "octree/test_scenes.h"
#include "surfeit/cloud_info.h"
#include "surfeit/process.h"

namespace surfeit {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;

constexpr float kFarAway = 1e11f;

class KeepInformed : public Progress {
 public:
  void inform(const std::string& message) override { messages.push_back(message); }
  std::vector<std::string> messages;
};

// Cancelled a while after work began.
class CancelLater : public Progress {
 public:
  explicit CancelLater(std::chrono::milliseconds after)
      : when_(std::chrono::steady_clock::now() + after) {}
  bool isCancelled() const override {
    if (std::chrono::steady_clock::now() < when_) return false;
    double none = 0;
    cpu_when_.compare_exchange_strong(none, processCpuSeconds());
    return true;
  }
  // Processor time since the job was told.
  double secondsSince() const { return processCpuSeconds() - cpu_when_; }

 private:
  const std::chrono::steady_clock::time_point when_;
  mutable std::atomic<double> cpu_when_{0};
};

class StrayTest : public SceneTest {
 protected:
  // Places in the unit square, then one far away.
  static std::vector<Surfel> square(std::size_t count, bool has_stray) {
    std::mt19937 random(11);
    std::uniform_real_distribution<float> unit(0, 1);
    std::vector<Surfel> surfels(count);
    for (Surfel& surfel : surfels) surfel.position = {unit(random), unit(random), 0};
    if (has_stray) surfels.emplace_back().position = {kFarAway, 0, 0};
    return surfels;
  }
  // A cloud's file, and the processor seconds that indexing it takes.
  double secondsToIndex(std::size_t count, bool has_stray, const std::string& name) {
    writeCloud(path(name + ".ply"), square(count, has_stray), CloudChannels{});
    const double before = processCpuSeconds();
    indexFiles({path(name + ".ply")}, path(name + ".sft"));
    return processCpuSeconds() - before;
  }
  double areaOf(const std::string& name) {
    const Result<ReadScene> scene = readScene(path(name + ".sft"));
    EXPECT_TRUE(scene.ok()) << scene.status().message();
    double sum = 0;
    for (const Surfel& surfel : scene->surfels) {
      if (surfel.position.x < 2) sum += double(surfel.area);
    }
    return sum;
  }
};

TEST_F(StrayTest, SizesAreThoseWithoutTheStray) {
  secondsToIndex(20000, false, "plain");
  secondsToIndex(20000, true, "stray");
  EXPECT_NEAR(areaOf("plain"), 1, .03);
  EXPECT_NEAR(areaOf("stray"), 1, .03);
  EXPECT_TRUE(findingsOf(path("stray.sft")).empty());
}

// The square of the size would take 16 times as long.
TEST_F(StrayTest, TimeGrowsAsTheSizeDoes) {
  const double few = secondsToIndex(10000, true, "few");
  const double many = secondsToIndex(40000, true, "many");
  EXPECT_LT(many, 10 * few) << few << " s, then " << many;
}

TEST_F(StrayTest, CancelledSearchesEndAtOnce) {
  writeCloud(path("cloud.ply"), square(1000000, true), CloudChannels{});
  CancelLater progress(std::chrono::milliseconds(800));
  IndexOptions options;
  options.threads = 1;
  const Status status =
      indexClouds({path("cloud.ply")}, path("cloud.sft"), options, progress).status();
  EXPECT_EQ(status.code(), StatusCode::kInterrupted) << status.message();
  EXPECT_LT(progress.secondsSince(), 0.5);  // of more than 2 in all
}

TEST_F(StrayTest, StraysAreToldWithWhatLeavesThemOut) {
  writeCloud(path("stray.ply"), square(2000, true), CloudChannels{});
  KeepInformed progress;
  ASSERT_TRUE(indexClouds({path("stray.ply")}, path("stray.sft"), {}, progress).ok());
  const auto told = AllOf(HasSubstr("strays: "), HasSubstr("--crop -"));
  EXPECT_THAT(progress.messages, Contains(told));
  Progress quiet;
  const Result<CloudInfo> info = readCloudInfo(path("stray.ply"), {}, quiet);
  ASSERT_TRUE(info.ok()) << info.status().message();
  EXPECT_THAT(info->notes, Contains(told));
  secondsToIndex(2000, false, "plain");
  const Result<CloudInfo> plain = readCloudInfo(path("plain.ply"), {}, quiet);
  ASSERT_TRUE(plain.ok());
  EXPECT_THAT(plain->notes, testing::Not(Contains(told)));
}

TEST(ContentOrder, WordsCompareAsContentDoes) {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> few(-2, 2);
  std::vector<Surfel> surfels = randomCloud(60);
  for (Surfel& surfel : surfels) {
    for (int axis = 0; axis < 3; ++axis) {
      surfel.position[axis] = float(int(few(random))) * (random() % 2 == 0 ? 1e11f : 1e-11f);
    }
  }
  for (const Surfel& a : surfels) {
    for (const Surfel& b : surfels) {
      bool is_less = false;
      for (int word = 0; word < kContentWords; ++word) {
        const std::uint64_t at_a = contentWord(a, word), at_b = contentWord(b, word);
        if (at_a == at_b) continue;
        is_less = at_a < at_b;
        break;
      }
      EXPECT_EQ(contentLess(a, b), is_less);
    }
  }
}

// A scanner's point at 0 beside a cloud on a map.
TEST_F(StrayTest, DigitsThatAStrayTakesAreTold) {
  std::string text = "0 0 0\n";
  for (int i = 0; i < 2000; ++i) {
    text += fmt::format("{:.4f} {:.4f} 100\n", 500000 + .01 * (i % 50), 5000000 + .01 * (i / 50));
  }
  std::ofstream(path("map.xyz")) << text;
  class Notes : public Progress {
   public:
    void note(const std::string& message) override { notes.push_back(message); }
    std::vector<std::string> notes;
  } told, untold;
  IndexOptions options;
  ASSERT_TRUE(indexClouds({path("map.xyz")}, path("map.sft"), options, told).ok());
  EXPECT_THAT(told.notes, Contains(AllOf(HasSubstr("positions are rounded to 0.5"),
                                         HasSubstr("--origin 500000,5000000,100"))));
  options.origin = glm::dvec3(500000, 5000000, 100);
  ASSERT_TRUE(indexClouds({path("map.xyz")}, path("near.sft"), options, untold).ok());
  EXPECT_THAT(untold.notes, testing::Not(Contains(HasSubstr("rounded"))));
}

}  // namespace
}  // namespace surfeit
