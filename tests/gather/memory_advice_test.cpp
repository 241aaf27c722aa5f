// What the monitor and tune say about memory is true: a gather that follows it is not advised
// again.
#include "batch/memory_advice.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <glm/geometric.hpp>
#include <glm/vec4.hpp>
#include <mutex>
#include <random>
#include <string>
#include <vector>

#include "batch/gather_input.h"
#include "batch/gather_memory.h"
#include "gather/test_clouds.h"
#include "octree/read/scene_file.h"
#include "surfeit/bake.h"
#include "surfeit/tune.h"

namespace surfeit {
namespace {

// Balls of random places and sizes; receivers lie on them, in random order.
struct RandomBalls {
  Table surfels, receivers;

  RandomBalls(unsigned seed, int ball_count, int surfel_count, int receiver_count) : random_(seed) {
    surfels = floorAndSphere(1);
    receivers = receiversOf(0);
    std::vector<glm::vec4> balls;
    for (int i = 0; i < ball_count; ++i) {
      balls.emplace_back(8 * number(), 8 * number(), 8 * number(), 0.4f + 0.3f * number());
    }
    for (int i = 0; i < surfel_count; ++i) {
      const glm::vec4& ball = balls[static_cast<std::size_t>(i % ball_count)];
      const glm::vec3 n = direction(), p = glm::vec3(ball) + ball.w * n;
      const double area = 4 * 3.14159 * ball.w * ball.w * ball_count / surfel_count;
      surfels.rows.push_back(
          {p.x, p.y, p.z, n.x, n.y, n.z, std::sqrt(area / 2), area, 0.5, 0.4, 0.3});
    }
    for (int i = 0; i < receiver_count; ++i) {
      const glm::vec4& ball = balls[random_() % balls.size()];
      const glm::vec3 n = direction(), p = glm::vec3(ball) + ball.w * n;
      receivers.rows.push_back({p.x, p.y, p.z, n.x, n.y, n.z, double(i)});
    }
  }

 private:
  float number() { return std::uniform_real_distribution<float>(-1, 1)(random_); }
  glm::vec3 direction() {
    for (;;) {
      const glm::vec3 v(number(), number(), number());
      if (glm::length(v) > 0.1f && glm::length(v) < 1) return glm::normalize(v);
    }
  }
  std::mt19937 random_;
};

// The budget that was advised, in MiB; 0: none was.
class AdviceProgress : public Progress {
 public:
  void inform(const std::string& message) override {
    const std::size_t at = message.find("--memory ");
    if (message.find("would do") == std::string::npos || at == std::string::npos) return;
    const std::lock_guard lock(mutex_);
    advised_ = std::strtoull(message.c_str() + at + 9, nullptr, 10);
  }
  std::uint64_t advised() const { return advised_; }

 private:
  std::mutex mutex_;
  std::uint64_t advised_ = 0;
};

class MemoryAdvice : public testing::Test {
 protected:
  void makeScene(unsigned seed) {
    const RandomBalls balls(seed, 5 + static_cast<int>(seed) * 20, 60000, 2500);
    surfeit::makeScene(balls.surfels, scene_);
    writeTable(balls.receivers, receivers_);
    options_.quality.max_solid_angle = 0.2f;
    options_.quality.raster_resolution = 4;
    options_.threads = 2;
    options_.temporary_directory = directory_.file("");
  }
  std::uint64_t least() const {
    const Result<SceneFile> scene = SceneFile::open(scene_);
    const Result<GatherInput> input = GatherInput::open(receivers_);
    EXPECT_TRUE(scene.ok() && input.ok());
    return leastGatherMemory(*scene, gatherWork(input->receivers(), options_));
  }
  // What a gather in this budget advises.
  std::uint64_t adviceAt(std::uint64_t memory_bytes) {
    AdviceProgress progress;
    options_.memory_bytes = memory_bytes;
    const auto stats = gatherCloud(scene_, receivers_, result_, options_, progress);
    EXPECT_TRUE(stats.ok()) << stats.status().message();
    return progress.advised();
  }

  TestDirectory directory_;
  const std::string scene_ = directory_.file("scene.sft");
  const std::string receivers_ = directory_.file("receivers.ply");
  const std::string result_ = directory_.file("result.ply");
  GatherOptions options_;
};

TEST_F(MemoryAdvice, IsOfAGatherThatReadsPagesAgain) {
  makeScene(2);
  options_.order = ReceiverOrder::kInput;  // balls in turn: hardly a page is used twice in a row
  const std::uint64_t advised = adviceAt(least());
  EXPECT_GT(advised << 20, least());
  EXPECT_EQ(adviceAt(std::uint64_t{1} << 30), 0u);
}

// Look-ups of which many come back after any number of other pages.
MissRatioCurve randomCurve(std::mt19937& random, std::uint32_t pages) {
  const auto number = [&](double from, double to) {
    return std::uniform_real_distribution<double>(from, to)(random);
  };
  std::vector<double> reuses(pages);
  double lookups = pages;
  const double scale = std::pow(double(pages), number(0, 1));
  for (std::size_t i = 0; i < reuses.size(); ++i) {
    reuses[i] = number(0, 1) < 0.8 ? number(0, 4000) * std::exp(-double(i) / scale) : 0;
    lookups += reuses[i];
  }
  return {1, reuses, double(pages), lookups};
}

TEST_F(MemoryAdvice, WhoFollowsItIsNotAdvisedAgain) {
  makeScene(1);
  const Result<SceneFile> scene = SceneFile::open(scene_);
  const Result<GatherInput> input = GatherInput::open(receivers_);
  ASSERT_TRUE(scene.ok() && input.ok());
  const GatherWork work = gatherWork(input->receivers(), options_);
  const std::uint64_t least_memory = leastGatherMemory(*scene, work);
  const std::uint64_t all = memoryForCaches(*scene, work, PagedOctree::unlimitedCacheBytes(*scene));
  int advised_count = 0;
  for (unsigned seed = 0; seed < 400; ++seed) {
    std::mt19937 random(seed);
    const auto power = [&](double from, double to) {
      return std::pow(10, std::uniform_real_distribution<double>(from, to)(random));
    };
    GatherLoads loads{randomCurve(random, scene->nodePageCount()),
                      randomCurve(random, scene->surfelPageCount()), power(-6, -2), power(-6, -2)};
    const double working = power(-1, 3);
    const std::uint64_t budget = least_memory + random() % (all - least_memory);
    const auto advice =
        adviseMemory(*scene, *planGatherMemory(*scene, budget, work), loads, working);
    if (!advice) continue;
    ++advised_count;
    EXPECT_GT(advice->memory_bytes, budget);
    EXPECT_GT(advice->part_of_time, 0);
    EXPECT_LT(advice->part_of_time, 1);

    // The next gather works as before or faster, and loads up to nearly twice as long
    const auto plan = planGatherMemory(*scene, advice->memory_bytes, work);
    ASSERT_TRUE(plan.ok());
    for (const double slower : {0.5, 1.0, 1.9}) {
      GatherLoads next = loads;
      next.node_load_seconds *= slower;
      next.surfel_load_seconds *= slower;
      for (const double faster : {1.0, 2.0, kStarvedWork}) {
        EXPECT_FALSE(adviseMemory(*scene, *plan, next, working / faster)) << "seed " << seed;
      }
    }
  }
  EXPECT_GE(advised_count, 50);  // else nothing was tested
}

TEST_F(MemoryAdvice, WhatTuneRecommendsIsWithinItsMargin) {
  makeScene(4);
  TuneOptions tune;
  tune.gather = options_;
  tune.gather.memory_bytes = std::uint64_t{256} << 20;
  tune.sample_receivers = 0;
  Progress progress;
  const auto report = tuneGather(scene_, receivers_, tune, progress);
  ASSERT_TRUE(report.ok()) << report.status().message();
  const double best = report->curve.back().predicted.seconds;  // all in memory
  EXPECT_LE(report->recommended.predicted.seconds, (1 + kTuneTimeMargin) * best * 1.001);
}

// A gather that is advised with less (IsOfAGatherThatReadsPagesAgain).
TEST_F(MemoryAdvice, AGatherAtWhatTuneRecommendsIsNotAdvised) {
  makeScene(2);
  options_.order = ReceiverOrder::kInput;
  TuneOptions tune;
  tune.gather = options_;
  tune.gather.memory_bytes = std::uint64_t{256} << 20;
  tune.sample_receivers = 0;
  Progress progress;
  const auto report = tuneGather(scene_, receivers_, tune, progress);
  ASSERT_TRUE(report.ok()) << report.status().message();
  const std::uint64_t recommended = report->recommended.memory_bytes;
  EXPECT_GT(recommended, least());
  // Loads cost other times in each run: on a machine that others use, one gather of three will do
  std::uint64_t advised = adviceAt(recommended);
  for (int again = 0; advised > 0 && again < 2; ++again) advised = adviceAt(recommended);
  EXPECT_EQ(advised, 0u) << "MiB, recommended " << recommended;
}

TEST_F(MemoryAdvice, TheLeastBudgetForCachesSpendsSoMuchOnThem) {
  makeScene(1);
  const Result<SceneFile> scene = SceneFile::open(scene_);
  const Result<GatherInput> input = GatherInput::open(receivers_);
  ASSERT_TRUE(scene.ok() && input.ok());
  const GatherWork work = gatherWork(input->receivers(), options_);
  for (const std::uint64_t caches : {std::uint64_t{2} << 20, std::uint64_t{5} << 20}) {
    const std::uint64_t budget = memoryForCaches(*scene, work, caches);
    EXPECT_GE(planGatherMemory(*scene, budget, work)->cache_bytes, caches);
    EXPECT_LT(planGatherMemory(*scene, budget - 1, work)->cache_bytes, caches);
  }
}

}  // namespace
}  // namespace surfeit
