#include "gather/far_field.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>
#include <vector>

#include "gather/packet_clouds.h"

namespace surfeit {
namespace {

constexpr int kRowReceivers = 16;  // of a square of receivers

// That look up.
std::vector<Receiver> squareOfReceivers(const glm::vec3& corner, float step) {
  std::vector<Receiver> receivers;
  for (int i = 0; i < kRowReceivers * kRowReceivers; ++i) {
    receivers.push_back(
        {corner + step * glm::vec3(float(i % kRowReceivers), float(i / kRowReceivers), 0),
         {0, 0, 1}});
  }
  return receivers;
}

std::vector<GatherResult> gatherWith(float parallax, Scene& scene,
                                     const std::vector<Receiver>& receivers) {
  GatherQuality quality;
  quality.far_field_parallax = parallax;
  PacketGatherer gatherer(GatherMode::kBleeding, quality);
  const std::vector<GatherResult> results = gatherPacket(gatherer, scene, receivers);
  EXPECT_EQ(gatherer.work().shared_patches > 0, parallax > 0);
  return results;
}

// How much what sharing changes differs from neighbour to neighbour, root mean square.
struct Unevenness {
  double occlusion = 0, irradiance = 0;
};
Unevenness unevennessOfSharing(Scene& scene, const std::vector<Receiver>& receivers) {
  const std::vector<GatherResult> shared = gatherWith(.2f, scene, receivers);
  const std::vector<GatherResult> alone = gatherWith(0, scene, receivers);
  Unevenness sum;
  const int pairs = kRowReceivers * (kRowReceivers - 1);
  for (std::size_t i = 0; i + 1 < receivers.size(); ++i) {
    if (i % kRowReceivers == kRowReceivers - 1) continue;
    const auto change = [&](auto value) {
      return double((value(shared[i + 1]) - value(alone[i + 1])) -
                    (value(shared[i]) - value(alone[i])));
    };
    const double occlusion = change([](const GatherResult& r) { return r.occlusion; });
    const double irradiance = change([](const GatherResult& r) { return r.irradiance.g; });
    sum.occlusion += occlusion * occlusion / pairs;
    sum.irradiance += irradiance * irradiance / pairs;
  }
  return {std::sqrt(sum.occlusion), std::sqrt(sum.irradiance)};
}

// Of a ball in some distance receivers see what their packets' centres see, and what that changes
// up to where they are. Without the change: .0013 and .0006.
TEST(FarField, IsAlikeForNeighboursInDifferentPackets) {
  Cloud cloud;
  addSphere(cloud, 20'000, {3, .5f, 1}, 1.2f);
  Scene scene(cloud);
  const Unevenness found = unevennessOfSharing(scene, squareOfReceivers({-.15f, -.15f, 0}, .02f));
  EXPECT_GT(found.occlusion, 0);
  EXPECT_LT(found.occlusion, .0004);
  EXPECT_LT(found.irradiance, .00015);
}

// A hemisphere of tiles that face its middle, of which every other two by two are missing.
void addHalfDome(Cloud& cloud, float radius) {
  constexpr int kRings = 100;
  const float step = kPi / 2 / kRings;
  for (int ring = 0; ring < kRings; ++ring) {
    const float height = (float(ring) + .5f) * step;
    const int count = int(2 * kPi * std::cos(height) / step);
    for (int i = 0; i < count; ++i) {
      if ((ring / 2 + i / 2) % 2 == 0) continue;
      const float angle = 2 * kPi * float(i) / float(count);
      Surfel surfel;
      surfel.position = radius * glm::vec3(std::cos(height) * std::cos(angle),
                                           std::cos(height) * std::sin(angle), std::sin(height));
      surfel.normal = -surfel.position / radius;
      surfel.area = radius * radius * step * step;
      surfel.radius = .8f * radius * step;
      surfel.radiosity = {1, 1, 1};
      cloud.push_back(surfel);
    }
  }
}

double meanOcclusion(const std::vector<GatherResult>& results) {
  double sum = 0;
  for (const GatherResult& result : results) sum += double(result.occlusion);
  return sum / double(results.size());
}

// A dome whose layer reaches beyond where the shared far field begins, before one that is far
// behind: they hide each other, and do not add up, as they would if all that is shared began at
// once. (.65 is covered alone; .69 if a layer is shared in part, for what is shared adds to it.)
TEST(FarField, HidesBehindWhatEndsAtItsBorder) {
  const std::vector<Receiver> receivers = squareOfReceivers({-.075f, -.075f, 0}, .01f);
  const PacketCluster cluster(receivers, {GatherMode::kBleeding, GatherQuality()});
  for (const float part : {.95f, 1.f}) {
    const float near = part * cluster.farDistance();
    Cloud cloud;
    addHalfDome(cloud, near);
    addHalfDome(cloud, 2 * near);
    Scene scene(cloud);
    EXPECT_NEAR(meanOcclusion(gatherWith(.2f, scene, receivers)),
                meanOcclusion(gatherWith(0, scene, receivers)), .04);
  }
}

// A cluster of a line spreads 16 times as wide as its packets.
TEST(FarField, IsOfSquaresAndNotOfLines) {
  const GatherRules rules(GatherMode::kBleeding, GatherQuality());
  EXPECT_TRUE(PacketCluster(squareOfReceivers({0, 0, 0}, .01f), rules).shares());
  std::vector<Receiver> line;
  for (std::size_t i = 0; i < kClusterReceivers; ++i) {
    line.push_back({{.01f * float(i), 0, 0}, {0, 0, 1}});
  }
  EXPECT_FALSE(PacketCluster(line, rules).shares());
}

TEST(FarField, TakesMemoryOnlyWhereSomethingIsShared) {
  GatherQuality quality;
  const std::size_t sharing = PacketGatherer::memoryBytes({GatherMode::kBleeding, quality});
  quality.far_field_parallax = 0;
  const GatherRules alone(GatherMode::kBleeding, quality);
  EXPECT_EQ(sharing, PacketGatherer::memoryBytes(alone) + FarField::memoryBytes(alone));
  GatherRules cone(GatherMode::kBleeding, GatherQuality());
  cone.weights.cone_angle = .2f;
  EXPECT_FALSE(PacketCluster::mayShare(cone));
}

}  // namespace
}  // namespace surfeit
