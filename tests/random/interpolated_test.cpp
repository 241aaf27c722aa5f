// What is interpolated on scenes by chance, held to the gather at every receiver: the max variation
// bounds the error at 99 of 100 receivers, and what is gathered has the bytes of the gather.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <glm/geometric.hpp>
#include <random>
#include <span>
#include <utility>
#include <vector>

#include "gather/packet/group_gatherer.h"
#include "random/indexed_scene.h"
#include "random/random_scene.h"

namespace surfeit {
namespace {

// Along the curve: the surfels, and `finer` places near each, as cameras and bakes have them.
std::vector<LocalReceiver> finerReceivers(const RandomScene& scene, const IndexedScene& indexed,
                                          int finer, std::size_t most) {
  std::mt19937 random(std::uint32_t(scene.seed));
  std::uniform_real_distribution<float> uniform(-0.5f, 0.5f);
  std::vector<std::pair<CurveKey, LocalReceiver>> order;
  for (const Surfel& surfel : scene.surfels) {
    const glm::vec3 normal = surfel.normal;
    const glm::vec3 across =
        glm::cross(normal, std::abs(normal.x) < 0.6f ? glm::vec3(1, 0, 0) : glm::vec3(0, 1, 0));
    const glm::vec3 u = normal == glm::vec3(0) ? across : glm::normalize(across);
    const float side = std::sqrt(surfel.area);
    for (int i = 0; i < finer; ++i) {
      LocalReceiver receiver{surfel.position, normal};
      if (i > 0) {
        receiver.position += side * (uniform(random) * u + uniform(random) * glm::cross(normal, u));
      }
      order.emplace_back(indexed.keyOf(receiver.position), receiver);
    }
  }
  std::stable_sort(order.begin(), order.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<LocalReceiver> receivers;
  for (const auto& [key, receiver] : order) {
    if (receivers.size() < most) receivers.push_back(receiver);
  }
  return receivers;
}

float brightest(const glm::vec3& rgb) { return std::max({rgb.x, rgb.y, rgb.z}); }

struct Counts {
  std::size_t receivers = 0, interpolated = 0, beyond = 0;
  double share(std::size_t count) const { return double(count) / double(receivers); }
};

// Of one group. Lights are relative to the brightest of the cluster.
void count(std::span<const GatherResult> exact, std::span<const GatherResult> found,
           float variation, Counts& counts) {
  for (std::size_t begin = 0; begin < exact.size(); begin += kClusterReceivers) {
    const std::size_t end = std::min(begin + kClusterReceivers, exact.size());
    float scale = 0;
    for (std::size_t i = begin; i < end; ++i) {
      scale = std::max(scale, brightest(exact[i].irradiance));
    }
    for (std::size_t i = begin; i < end; ++i) {
      const float occlusion = std::abs(exact[i].occlusion - found[i].occlusion);
      const float light = brightest(glm::abs(exact[i].irradiance - found[i].irradiance));
      counts.beyond += occlusion > variation || light > variation * scale;
    }
  }
}

constexpr float kVariations[] = {0.02f, 0.1f};

// Adds what one group of receivers of a scene shows, for each of the variations.
void gatherScene(std::uint64_t seed, GatherMode mode, std::span<Counts> counts) {
  constexpr int kFiner = 8;
  const RandomScene scene = makeRandomScene(seed);
  if (scene.surfels.empty()) return;
  const auto indexed = IndexedScene::make(scene.surfels);
  ASSERT_TRUE(indexed.ok()) << indexed.status().message();
  const std::vector<LocalReceiver> receivers =
      finerReceivers(scene, **indexed, kFiner, kGroupReceivers);
  GatherQuality quality;
  PacketGatherer whole(mode, quality);
  std::vector<GatherResult> exact(receivers.size()), found(receivers.size());
  for (std::size_t at = 0; at < receivers.size(); at += kClusterReceivers) {
    const std::size_t size = std::min(kClusterReceivers, receivers.size() - at);
    const auto part = std::span(receivers).subspan(at, size);
    ASSERT_TRUE(whole.gather(part, (*indexed)->reader(), std::span(exact).subspan(at, size)).ok());
  }

  for (std::size_t i = 0; i < counts.size(); ++i) {
    quality.max_variation = kVariations[i];
    GroupGatherer some(GatherRules(mode, quality));
    WorldReader world((*indexed)->reader());
    ASSERT_TRUE(some.gather(receivers, world, found).ok());
    counts[i].receivers += receivers.size();
    counts[i].interpolated += some.interpolatedCount();
    count(exact, found, kVariations[i], counts[i]);

    // What is gathered is equal to the last bit
    std::size_t equal = 0;
    for (std::size_t k = 0; k < exact.size(); ++k) {
      equal += std::memcmp(&exact[k], &found[k], sizeof(GatherResult)) == 0;
    }
    EXPECT_GE(equal + some.interpolatedCount(), receivers.size()) << seed;
  }
}

TEST(Interpolated, TheMaxVariationBoundsTheErrorAt99Of100Receivers) {
  for (const GatherMode mode : {GatherMode::kOcclusion, GatherMode::kBleeding}) {
    const char* const name = mode == GatherMode::kOcclusion ? "occlusion" : "color";
    Counts all[2];
    for (std::uint64_t seed = 0; seed < 6; ++seed) gatherScene(seed, mode, all);
    for (std::size_t i = 0; i < 2; ++i) {
      std::printf("%s, variation %.2f: %zu receivers, %.1f %% interpolated, %.2f %% beyond\n", name,
                  double(kVariations[i]), all[i].receivers, 100 * all[i].share(all[i].interpolated),
                  100 * all[i].share(all[i].beyond));
      EXPECT_LE(all[i].share(all[i].beyond), 0.01) << name << ' ' << kVariations[i];
      EXPECT_GT(all[i].share(all[i].interpolated), 0.05) << name << ' ' << kVariations[i];
    }
  }
}

}  // namespace
}  // namespace surfeit
