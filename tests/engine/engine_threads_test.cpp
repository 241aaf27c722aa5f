// Callers' threads, each with a gatherer of its own, and gatherAll with the library's.
#include <thread>
#include <vector>

#include "engine/engine_scenes.h"

namespace surfeit {
namespace {

constexpr int kThreads = 16;

class EngineThreadsTest : public EngineTest {};

// Caches that hold a part of the scene, so that threads take pages from each other.
TEST_F(EngineThreadsTest, CallersThreadsDoNotDisturbEachOther) {
  const std::string path = sceneFile(5), other_path = sceneFile(2);
  const std::vector<Receiver> receivers = manyOf(receiversOf(makeRandomScene(5)), 512);
  Engine alone = makeEngine();
  Gatherer expected_gatherer =
      valueOrFail(alone.gatherer(valueOrFail(alone.open(path)), bleedingSettings()));
  const std::vector<GatherResult> expected = gatherAt(expected_gatherer, receivers);

  Engine engine = makeEngine(56 * kMiB, kThreads);
  const Scene scene = valueOrFail(engine.open(path));
  Gatherer first = valueOrFail(engine.gatherer(scene, bleedingSettings()));
  std::vector<std::jthread> threads;
  for (int i = 0; i < kThreads; ++i) {
    threads.emplace_back([&, i] {
      Gatherer own = i % 2 == 0 ? valueOrFail(first.another())
                                : valueOrFail(engine.gatherer(scene, bleedingSettings()));
      for (int round = 0; round < 2; ++round) {
        EXPECT_TRUE(haveSameBytes(gatherAt(own, receivers), expected)) << i;
        if (i % 4 == 0) own.pause();
        if (i % 4 == 1) {  // scenes come and go beside it
          const Result<Scene> other = engine.open(other_path);
          EXPECT_TRUE(other.ok()) << other.status().message();
        }
        engine.statistics();
      }
    });
  }
  threads.clear();
  EXPECT_EQ(engine.statistics().gatherers, 1u);
  EXPECT_EQ(engine.statistics().receivers, std::uint64_t{2} * kThreads * receivers.size());
}

// It is refused, not raced: a callback asks for a second call within the first.
TEST_F(EngineThreadsTest, TwoCallsAtOnceOnOneGathererAreRefused) {
  Engine engine = makeEngine();
  const Scene scene = valueOrFail(engine.open(sceneFile(5)));
  Gatherer gatherer = valueOrFail(engine.gatherer(scene, bleedingSettings()));
  class CallsAgain : public Progress {
   public:
    explicit CallsAgain(Gatherer& gatherer) : gatherer_(gatherer) {}
    bool isCancelled() const override {
      const Receiver receiver;
      GatherResult result;
      code = gatherer_.gather(&receiver, 1, &result).code();
      return false;
    }
    mutable StatusCode code = StatusCode::kOk;

   private:
    Gatherer& gatherer_;
  };
  const CallsAgain again(gatherer);
  const Receiver receiver;
  GatherResult result;
  EXPECT_TRUE(gatherer.gather(&receiver, 1, &result, &again).ok());
  EXPECT_EQ(again.code, StatusCode::kInvalidArgument);
  EXPECT_TRUE(gatherer.gather(&receiver, 1, &result).ok());
}

TEST_F(EngineThreadsTest, AllAtOnceIsTheSameForAnyThreads) {
  Engine engine = makeEngine(64 * kMiB, 4);
  const Scene scene = valueOrFail(engine.open(sceneFile(5)));
  const std::vector<Receiver> receivers = manyOf(receiversOf(makeRandomScene(5)), 10'000);
  std::vector<GatherResult> by_one(receivers.size()), by_four(receivers.size());
  Progress progress;
  for (auto* results : {&by_one, &by_four}) {
    const Status status =
        engine.gatherAll({Instance{scene, {}}}, bleedingSettings(), receivers.data(),
                         receivers.size(), results->data(), progress, results == &by_one ? 1 : 4);
    ASSERT_TRUE(status.ok()) << status.message();
  }
  EXPECT_TRUE(haveSameBytes(by_one, by_four));
  Gatherer gatherer = valueOrFail(engine.gatherer(scene, bleedingSettings()));
  const Difference difference = differenceOf(by_one, gatherAt(gatherer, receivers));
  EXPECT_LT(difference.mean_occlusion, .002);
}

// The same receiver again and again.
class RepeatedReceiver : public ReceiverArray {
 public:
  explicit RepeatedReceiver(std::size_t count) : count_(count) {}
  std::size_t count() const override { return count_; }
  Receiver receiver(std::size_t) const override { return {}; }
  void setResult(std::size_t, const GatherResult&) override {}

 private:
  const std::size_t count_;
};

struct Stopped : Progress {
  bool isCancelled() const override { return true; }
};

TEST_F(EngineThreadsTest, TheOrderOfReceiversIsOfTheBudget) {
  RepeatedReceiver receivers(1 << 21);  // an order of 24 MiB
  for (const std::uint64_t memory : {24 * kMiB, 64 * kMiB}) {
    Engine engine = makeEngine(memory, 1);
    const Scene scene = valueOrFail(engine.open(sceneFile(5)));
    Gatherer gatherer = valueOrFail(engine.gatherer(scene, bleedingSettings()));
    const std::uint64_t held = engine.statistics().held_bytes;
    Stopped stopped;
    const Status status = gatherer.gatherAll(receivers, stopped);
    if (memory == 24 * kMiB) {
      EXPECT_EQ(status.code(), StatusCode::kBudgetTooSmall);
      EXPECT_NE(status.message().find("order of 2097152 receivers"), std::string::npos)
          << status.message();
    } else {
      EXPECT_EQ(status.code(), StatusCode::kInterrupted) << status.message();
    }
    EXPECT_EQ(engine.statistics().held_bytes, held);
  }
}

}  // namespace
}  // namespace surfeit
