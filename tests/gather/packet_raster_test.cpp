// What the lanes of a packet see is what a packet of each receiver alone sees.
#include "gather/packet/packet_raster.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>
#include <random>
#include <span>
#include <vector>

#include "gather/rules/gather_rules.h"

namespace surfeit {
namespace {

// A piece of a bent surface: its normals lean up to .27 either way.
Node bentNode() {
  Node node{};
  node.radius = .5f;
  node.forgetBounds();
  node.normal = {1, 0, 0};
  node.flatness = .975f;
  node.flags = kNodeFlat;
  node.area = .6f;
  node.radiosity = {.5f, .6f, .7f};
  node.surfel_count = 100;
  node.groups = 1;
  node.covariance.entries = {.002f, .05f, .05f, 0, 0, 0};
  return node;
}

// Results of a packet, of what is added to it.
template <typename Add>
std::vector<GatherResult> gathered(PacketRaster& raster, std::span<const LocalReceiver> receivers,
                                   const Add& add) {
  raster.begin(receivers, viewPacket(receivers));
  add(raster);
  raster.sort();
  raster.draw();
  std::vector<GatherResult> results(receivers.size());
  raster.integrate(results);
  return results;
}

// From where the node faces them to where it turns away.
std::vector<LocalReceiver> receiversAlongTheRim() {
  std::vector<LocalReceiver> receivers;
  for (int i = 0; i < int(kPacketReceivers); ++i) {
    receivers.push_back({{.2f * float(i) - 1.5f, 0, -3}, {0, 0, 1}});
  }
  return receivers;
}

TEST(PacketRaster, EveryReceiverSeesItsOwnPartOfWhatIsBent) {
  const Node node = bentNode();
  const std::vector<LocalReceiver> receivers = receiversAlongTheRim();
  for (const GatherSides sides : {GatherSides::kFront, GatherSides::kBack}) {
    GatherQuality quality;
    quality.sides = sides;
    const GatherRules rules(GatherMode::kBleeding, quality);
    PacketRaster packet(rules), alone(rules);
    const auto add = [&](PacketRaster& raster) { raster.addNode(node); };
    const std::vector<GatherResult> results = gathered(packet, receivers, add);
    float least = 1, most = 0;
    for (std::size_t i = 0; i < receivers.size(); ++i) {
      const GatherResult expected = gathered(alone, std::span(receivers).subspan(i, 1), add)[0];
      EXPECT_NEAR(results[i].occlusion, expected.occlusion, 1e-5) << i << ' ' << int(sides);
      EXPECT_NEAR(results[i].irradiance.x, expected.irradiance.x, 1e-5) << i << ' ' << int(sides);
      least = std::min(least, expected.occlusion);
      most = std::max(most, expected.occlusion);
    }
    EXPECT_EQ(least, 0);
    EXPECT_GT(most, .005f);
  }
}

// Lanes without receivers are left out, whole vectors of them, and hold what was drawn before.
TEST(PacketRaster, FewReceiversSeeTheSameAsInAFullPacket) {
  const Node node = bentNode();
  std::vector<LocalReceiver> receivers = receiversAlongTheRim();
  std::reverse(receivers.begin(), receivers.end());
  const PacketView view = viewPacket(receivers);
  const GatherRules rules(GatherMode::kBleeding, {});
  for (const PacketKernel& kernel : packetKernels()) {
    PacketRaster packet(rules, kernel);
    const auto gather = [&](std::size_t count) {
      packet.begin(std::span(receivers).first(count), view);
      packet.addNode(node);
      packet.sort();
      packet.draw();
      std::vector<GatherResult> results(count);
      packet.integrate(results);
      return results;
    };
    const std::vector<GatherResult> all = gather(receivers.size());
    EXPECT_GT(all[0].occlusion, 0);
    for (const std::size_t count : {1, 4, 5, 8, 9, 15}) {
      const std::vector<GatherResult> few = gather(count);
      for (std::size_t i = 0; i < count; ++i) {
        EXPECT_EQ(few[i].occlusion, all[i].occlusion) << kernel.name << ' ' << count << ' ' << i;
        EXPECT_EQ(few[i].irradiance, all[i].irradiance) << kernel.name << ' ' << count << ' ' << i;
      }
    }
  }
}

// Surfels of all kinds, sizes and distances, many of them across edges of the faces.
Surfel surfelAround(std::mt19937& random) {
  std::uniform_real_distribution<float> uniform(-1, 1);
  const auto direction = [&] {
    return glm::normalize(glm::vec3(uniform(random), uniform(random), uniform(random)));
  };
  glm::vec3 to_surfel = direction();
  if (uniform(random) > 0) to_surfel.y = (1 + .2f * uniform(random)) * to_surfel.x;
  const float distance = std::exp2(3 * uniform(random));
  const int kind = int(random() % 3);
  Surfel surfel;
  surfel.position = distance * to_surfel;
  surfel.normal = kind == 2 ? glm::vec3(0) : direction();
  if (kind == 1) surfel.flags = kSurfelTwoSided;
  if (kind == 2) surfel.flags = kSurfelSphere;
  surfel.radius = .1f * distance * std::exp2(2 * uniform(random));
  surfel.area = .5f * kPi * surfel.radius * surfel.radius;
  surfel.radiosity = {.5f, .6f, .7f};
  return surfel;
}

// What some receiver sees something of is drawn on every face it reaches; the rest is not kept.
TEST(PacketRaster, SurfelsAreKeptForTheFacesThatSeeThem) {
  for (const bool has_normals : {true, false}) {
    std::vector<LocalReceiver> receivers;
    for (int i = 0; i < int(kPacketReceivers); ++i) {
      const float turn = .1f * float(i - 8);
      receivers.push_back({{.1f * turn, .02f * float(i % 4), 0}, glm::vec3(0)});
      if (has_normals) receivers.back().normal = {std::sin(turn), 0, std::cos(turn)};
    }
    const GatherRules rules(GatherMode::kBleeding, {});
    PacketRaster packet(rules), alone(rules);
    std::mt19937 random(5);
    int kept = 0, seen = 0;
    for (int i = 0; i < 1000; ++i) {
      const Surfel surfel = surfelAround(random);
      const auto add = [&](PacketRaster& raster) { raster.addSurfels({&surfel, 1}); };
      const std::vector<GatherResult> results = gathered(packet, receivers, add);
      kept += int(packet.patchCount());
      bool is_seen = false;
      for (std::size_t lane = 0; lane < receivers.size(); ++lane) {
        const GatherResult expected =
            gathered(alone, std::span(receivers).subspan(lane, 1), add)[0];
        is_seen |= expected.occlusion > 0;
        ASSERT_NEAR(results[lane].occlusion, expected.occlusion, 1e-5) << i << ' ' << lane;
      }
      seen += is_seen ? 1 : 0;
    }
    EXPECT_GT(seen, 500);
    EXPECT_GE(kept, seen);
    EXPECT_LT(kept, seen + seen / 16);
  }
}

// Rays through the middles of pixels meet most of a thin disk that lies on them, or nothing.
TEST(PacketRaster, ThinDisksMakeNoStepAtTheBorderOfTheNearField) {
  const GatherRules rules(GatherMode::kOcclusion, {});
  Surfel surfel;
  surfel.radius = .1f;
  surfel.area = .02f;
  surfel.normal = glm::normalize(glm::vec3(1, 0, -.1f));
  const float border = nearFieldRadii(rules, false) * surfel.radius;
  constexpr std::size_t kPlaces = 64;  // from .8 to 1.1 times the border
  std::vector<LocalReceiver> receivers(kPlaces);
  for (std::size_t i = 0; i < kPlaces; ++i) {
    const float distance = border * (.8f + .3f * float(i) / float(kPlaces - 1));
    receivers[i] = {{-.5f / 8 * distance, -.5f / 8 * distance, -distance}, {0, 0, 1}};
  }
  PacketRaster packet(rules), alone(rules);
  const auto add = [&](PacketRaster& raster) { raster.addSurfels({&surfel, 1}); };
  std::vector<float> occlusion;
  for (std::size_t i = 0; i < kPlaces; i += kPacketReceivers) {
    const std::span<const LocalReceiver> lanes = std::span(receivers).subspan(i, kPacketReceivers);
    const std::vector<GatherResult> results = gathered(packet, lanes, add);
    for (std::size_t lane = 0; lane < lanes.size(); ++lane) {
      const GatherResult expected = gathered(alone, lanes.subspan(lane, 1), add)[0];
      EXPECT_NEAR(results[lane].occlusion, expected.occlusion, 1e-5f);
      occlusion.push_back(results[lane].occlusion);
    }
  }
  float largest = 0;
  for (std::size_t i = 1; i < kPlaces; ++i) {
    largest = std::max(largest, std::abs(occlusion[i] - occlusion[i - 1]));
  }
  const float change = std::abs(occlusion.front() - occlusion.back());
  EXPECT_GT(change, .0005f);
  EXPECT_LT(largest, .15f * change);
}

// A disk beside which a receiver stands, however close, hides what is on its side: half of what is
// above the horizon.
TEST(PacketRaster, AWallThatIsTouchedCoversHalf) {
  for (const glm::vec3& across :
       {glm::vec3(1, 0, 0), glm::vec3(0, 1, 0), glm::normalize(glm::vec3(.6f, -.8f, 0))}) {
    for (const float gap : {1e-2f, 1e-4f, 1e-6f, 1e-8f}) {
      Surfel wall;
      wall.radius = 100;
      wall.area = kPi * wall.radius * wall.radius;
      wall.normal = -across;
      wall.position = gap * across;
      GatherQuality quality;
      quality.raster_resolution = 32;
      const GatherRules rules(GatherMode::kOcclusion, quality);
      PacketRaster raster(rules);
      const LocalReceiver receiver = {{0, 0, 0}, {0, 0, 1}};
      const GatherResult result = gathered(raster, {&receiver, 1}, [&](PacketRaster& to) {
        to.addSurfels({&wall, 1});
      })[0];
      EXPECT_NEAR(result.occlusion, .5f, .01f) << gap << ' ' << across.x;
    }
  }
}

// Walls one behind the other, 1 apart, each of its own color on both sides.
constexpr int kWalls = 5;
glm::vec3 colorOfWall(int wall) { return {wall % 2 == 0, wall % 3 == 0, .2f * float(wall)}; }

std::vector<Surfel> parallelWalls(float surfels_apart) {
  std::vector<Surfel> walls;
  const int side = int(std::lround(8 / surfels_apart));
  for (int i = 0; i < kWalls * 2 * side * side; ++i) {
    const int place = i / (kWalls * 2), wall = i % kWalls;
    const float facing = i / kWalls % 2 == 0 ? 1.f : -1.f;
    Surfel surfel;
    surfel.position = {float(wall) + .01f * facing, surfels_apart * (float(place % side) + .5f) - 4,
                       surfels_apart * (float(place / side) + .5f) - 4};
    surfel.normal = {facing, 0, 0};
    surfel.area = surfels_apart * surfels_apart;
    surfel.radius = .75f * surfels_apart;
    surfel.radiosity = colorOfWall(wall);
    walls.push_back(surfel);
  }
  return walls;
}

// The centre of the packet lies between other walls than most of its receivers.
TEST(PacketRaster, ReceiversBetweenWallsSeeTheNearestOne) {
  for (const float apart : {.5f, .25f}) {
    const std::vector<Surfel> walls = parallelWalls(apart);
    std::vector<LocalReceiver> receivers;
    for (int i = 0; i < int(kPacketReceivers); ++i) {
      const float facing = i % 2 == 0 ? 1.f : -1.f;
      const float x = float(i / 2 % (kWalls - 1)) + .3f + .05f * float(i / 8);
      receivers.push_back({{x, .1f * float(i % 3), .1f}, {facing, 0, 0}});
    }
    const GatherRules rules(GatherMode::kBleeding, {});
    for (const PacketKernel& kernel : packetKernels()) {
      PacketRaster packet(rules, kernel), alone(rules, kernel);
      const auto add = [&](PacketRaster& raster) { raster.addSurfels(walls); };
      const std::vector<GatherResult> results = gathered(packet, receivers, add);
      for (std::size_t i = 0; i < receivers.size(); ++i) {
        const GatherResult own = gathered(alone, std::span(receivers).subspan(i, 1), add)[0];
        const int nearest = int(receivers[i].position.x) + (i % 2 == 0 ? 1 : 0);
        for (int c = 0; c < 3; ++c) {
          EXPECT_NEAR(results[i].irradiance[c], own.irradiance[c], .01) << apart << ' ' << i;
          EXPECT_NEAR(results[i].irradiance[c], colorOfWall(nearest)[c], .06) << apart << ' ' << i;
        }
      }
    }
  }
}

}  // namespace
}  // namespace surfeit
