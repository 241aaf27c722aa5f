// Gatherers allocate nothing once they are warm, and every allocation may fail. A program of its
// own, as it replaces operator new.
#include <optional>
#include <vector>

#include "engine/engine_scenes.h"
#include "failing_allocations.h"

namespace surfeit {
namespace {

class EngineAllocationTest : public EngineTest {};

TEST_F(EngineAllocationTest, WarmCallsAllocateNothing) {
  const std::vector<Receiver> receivers = manyOf(receiversOf(makeRandomScene(5)), 600);
  Engine engine = makeEngine();
  const Scene scene = valueOrFail(engine.open(sceneFile(5)));
  Transform moved;
  moved.m[3] = 1000;
  const std::vector<Instance> several = {{scene, {}}, {scene, moved}};
  for (const bool has_several : {false, true}) {
    for (const float max_variation : {0.f, .02f}) {
      GatherSettings settings = bleedingSettings();
      settings.quality.max_variation = max_variation;
      Gatherer gatherer = valueOrFail(has_several ? engine.gatherer(several, settings)
                                                  : engine.gatherer(scene, settings));
      std::vector<GatherResult> results(receivers.size());
      const auto gather = [&](std::size_t size) {
        for (std::size_t begin = 0; begin < receivers.size(); begin += size) {
          const std::size_t count = std::min(size, receivers.size() - begin);
          if (!gatherer.gather(&receivers[begin], count, &results[begin]).ok()) return false;
        }
        return true;
      };
      constexpr long kPlenty = 1'000'000'000;
      EXPECT_TRUE(gather(receivers.size()) && gather(256) && gather(1));
      allocations_until_failure = kPlenty;
      EXPECT_TRUE(gather(receivers.size()) && gather(256) && gather(1));
      const long used = kPlenty - allocations_until_failure;
      allocations_until_failure = -1;
      EXPECT_EQ(used, 0) << has_several << ' ' << max_variation;
    }
  }
}

// As a caller sees it: a Status, and an engine that works as before.
TEST_F(EngineAllocationTest, EveryAllocationMayFail) {
  const std::string path_of_scene = sceneFile(5);
  const std::vector<Receiver> receivers = manyOf(receiversOf(makeRandomScene(5)), 64);
  Engine engine = makeEngine();
  const Scene home = valueOrFail(engine.open(path_of_scene));
  Gatherer warm = valueOrFail(engine.gatherer(home, bleedingSettings()));
  const std::vector<GatherResult> expected = gatherAt(warm, receivers);
  const EngineStatistics before = engine.statistics();
  std::vector<GatherResult> results(receivers.size());
  bool all_ok = false;
  Transform moved;
  moved.m[3] = 1000;
  std::vector<Instance> instances = {{home, {}}, {home, moved}};
  const GatherSettings settings = bleedingSettings();
  for (long count = 0; !all_ok; count = count < 100 ? count + 1 : count + count / 7) {
    const FailingAllocations failing(count, false);
    all_ok = [&] {
      const Result<Scene> scene = engine.open(path_of_scene);
      if (!scene.ok()) return false;
      instances[1].scene = *scene;
      Result<Gatherer> gatherer = engine.gatherer(instances, settings);
      if (!gatherer.ok()) return false;
      return gatherer->gather(receivers.data(), receivers.size(), results.data()).ok() &&
             !has_failed;
    }();
    instances[1].scene = home;
    ASSERT_LT(count, 1'000'000);
  }
  EXPECT_EQ(engine.statistics().held_bytes, before.held_bytes);
  EXPECT_EQ(engine.statistics().scenes, 1u);
  EXPECT_EQ(engine.statistics().gatherers, 1u);
  EXPECT_TRUE(haveSameBytes(expected, gatherAt(warm, receivers)));
}

}  // namespace
}  // namespace surfeit
