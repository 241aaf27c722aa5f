// Random scenes judged batch by batch, and failures made smaller.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <glm/geometric.hpp>
#include <numeric>
#include <string>
#include <vector>

#include "random/indexed_scene.h"
#include "random/random_limits.h"
#include "random/random_scene.h"
#include "random/random_scene_files.h"
#include "random/result_differences.h"
#include "surfeit/bake.h"

namespace surfeit {

// Options that suit a scene.
using SceneOptionsOf = std::function<GatherOptions(const RandomScene&)>;

// The gather by default along the curve, against the exact one of each receiver. Fails the test
// where either fails.
inline ResultDifferences fastAgainstExact(const RandomScene& scene, GatherOptions options) {
  if (scene.surfels.empty()) return {};
  const auto indexed = IndexedScene::make(scene.surfels);
  EXPECT_TRUE(indexed.ok()) << indexed.status().message();
  if (!indexed.ok()) return {};
  const std::vector<LocalReceiver> receivers = scene.plainReceivers();
  const auto fast = (*indexed)->gatherTogether(receivers, GatherRules(options));
  options.quality.max_solid_angle = 0;
  const auto exact = (*indexed)->gatherAlone(receivers, GatherRules(options));
  EXPECT_TRUE(fast.ok() && exact.ok());
  return fast.ok() && exact.ok() ? differencesOf(*fast, *exact) : ResultDifferences{};
}

// Leaves out one ingredient after the other, as long as the scene still fails. The set of those
// that the failure needs.
inline std::uint64_t neededIngredients(const RandomScene& scene,
                                       const std::function<bool(const RandomScene&)>& fails) {
  std::uint64_t kept = (std::uint64_t{1} << scene.ingredients.size()) - 1;
  for (bool shrinks = true; shrinks;) {
    shrinks = false;
    for (std::size_t i = 0; i < scene.ingredients.size(); ++i) {
      const std::uint64_t fewer = kept & ~(std::uint64_t{1} << i);
      if (fewer == kept || fewer == 0 || !fails(scene.only(fewer))) continue;
      kept = fewer;
      shrinks = true;
    }
  }
  return kept;
}

// What to type to see a failure.
inline std::string reproduction(const RandomScene& scene, std::uint64_t kept, bool has_opacities) {
  std::string numbers;
  for (std::size_t i = 0; i < scene.ingredients.size(); ++i) {
    if ((kept >> i & 1) != 0) numbers += (numbers.empty() ? "" : ",") + std::to_string(i);
  }
  return scene.only(kept).describe() + "random_scenes --seeds " + std::to_string(scene.seed) +
         " --ingredients " + numbers + (has_opacities ? " --opacities" : "") +
         " --describe --write DIRECTORY\n";
}

// The first scenes from a seed on that are quick to gather exactly.
inline std::vector<std::uint64_t> smallScenes(std::uint64_t first, std::size_t count) {
  constexpr std::size_t kMostSurfels = 6000;
  std::vector<std::uint64_t> seeds;
  for (; seeds.size() < count; ++first) {
    if (makeRandomScene(first).surfels.size() <= kMostSurfels) seeds.push_back(first);
  }
  return seeds;
}

inline std::vector<std::uint64_t> allScenes(std::uint64_t first, std::size_t count) {
  std::vector<std::uint64_t> seeds(count);
  std::iota(seeds.begin(), seeds.end(), first);
  return seeds;
}

// Who turns the back to the eye has no mirrored view above the horizon.
inline void dropTurnedAway(RandomScene& scene, const GatherOptions& options) {
  if (options.mode != GatherMode::kGlossy || std::isnan(options.eye.x)) return;
  std::erase_if(scene.receivers, [&](const RandomReceiver& one) {
    const LocalReceiver& receiver = one.receiver;
    return !(glm::dot(glm::vec3(options.eye) - receiver.position, receiver.normal) > 0);
  });
}

inline void expectFidelity(const std::vector<std::uint64_t>& seeds, const char* name,
                           const SceneOptionsOf& optionsOf, const FidelityLimits& limits,
                           bool has_opacities = false) {
  std::vector<double> rms, light;
  double worst = 0;
  for (const std::uint64_t seed : seeds) {
    RandomScene scene = makeRandomScene(seed);
    if (has_opacities) scene = scene.withOpacities();
    dropTurnedAway(scene, optionsOf(scene));
    const auto fails = [&](const ResultDifferences& found) {
      return !(found.rms <= limits.rms) || !(found.worst <= limits.worst);
    };
    const ResultDifferences found = fastAgainstExact(scene, optionsOf(scene));
    rms.push_back(found.rms);
    light.push_back(found.irradiance_rms);
    worst = std::max(worst, found.worst);
    if (!fails(found)) continue;
    const std::uint64_t needed = neededIngredients(scene, [&](const RandomScene& fewer) {
      return fails(fastAgainstExact(fewer, optionsOf(scene)));
    });
    ADD_FAILURE() << name << ": rms " << found.rms << ", worst " << found.worst << " at receiver "
                  << found.worst_receiver << '\n'
                  << reproduction(scene, needed, has_opacities);
  }
  const auto above = [&](double limit) {
    return int(std::count_if(rms.begin(), rms.end(), [=](double one) { return one > limit; }));
  };
  std::printf("%s %d..: rms median %.4f, most %.4f, worst %.4f, above .01 %d, .02 %d; light %.4f\n",
              name, int(seeds.front()), quantile(rms, .5), quantile(rms, 1), worst,
              above(kUsualRms), above(kLargeRms), quantile(light, .5));
  const double batches = std::max(1., double(seeds.size()) / 25);
  EXPECT_LE(above(kUsualRms), limits.above_usual * batches) << name;
  EXPECT_LE(above(kLargeRms), limits.above_large * batches) << name;
  EXPECT_LE(quantile(light, .5), limits.median_light) << name;
}

}  // namespace surfeit
