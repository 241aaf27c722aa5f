// Packets are held to packets of one; gather_modes_test.cpp holds instruction sets to each other.
#include "gather/packet/packet_gatherer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>
#include <random>
#include <vector>

#include "core/long_side.h"
#include "gather/packet_clouds.h"

namespace surfeit {
namespace {

double difference(const GatherResult& a, const GatherResult& b) {
  const glm::vec3 color = glm::abs(a.irradiance - b.irradiance);
  return double(std::max({std::abs(a.occlusion - b.occlusion), color.x, color.y, color.z}));
}

// Leaves around the origin, at distances of 2 to 4, that face anywhere: along every ray as many
// meet it, 1 in the mean, wherever they are. Each has `disk_part` of its disk.
Cloud foliage(std::size_t count, float disk_part) {
  std::mt19937 random(7);
  std::normal_distribution<float> normal;
  std::uniform_real_distribution<float> uniform(2, 4);
  const auto direction = [&] {
    return glm::normalize(glm::vec3(normal(random), normal(random), normal(random)));
  };
  Cloud leaves(count);
  for (Surfel& leaf : leaves) {
    leaf.position = uniform(random) * direction();
    leaf.normal = direction();
    leaf.flags = kSurfelTwoSided;
    // A / 2 of each is seen: count A / 2 / (4 pi 2) times the integral of 1 / r^2 from 2 to 4
    leaf.area = 64 * kPi / float(count);
    leaf.radius = std::sqrt(leaf.area / (kPi * disk_part));
    leaf.radiosity = {1, 1, 1};
  }
  return leaves;
}

constexpr float kLeaf = 1, kRibbon = .1f;

// Surfels of which the longer side is known.
Cloud ribbons(int count) {
  Cloud cloud = foliage(count, kRibbon);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const float turn = float(i), length = 2 * cloud[i].radius / (i % 3 == 0 ? 2.f : 1.f);
    const glm::vec3 across(std::cos(turn), std::sin(turn), std::cos(2 * turn));
    setLongSide(length * glm::normalize(glm::cross(cloud[i].normal, across)), cloud[i]);
  }
  return cloud;
}

TEST(PacketGatherer, EqualReceiversGiveWhatOneGives) {
  for (const Cloud& cloud : {mixedCloud(), enclosedCloud(), foliage(20'000, kLeaf),
                             foliage(20'000, kRibbon), ribbons(20'000)}) {
    TestScene scene(cloud);
    for (const float max_solid_angle : {.02f, .1f, .4f}) {
      for (const GatherSides sides : {GatherSides::kFront, GatherSides::kBoth}) {
        GatherQuality quality;
        quality.max_solid_angle = max_solid_angle;
        quality.sides = sides;
        PacketGatherer gatherer(GatherMode::kBleeding, quality);
        double worst = 0;
        for (std::size_t run = 0; run < kRuns; ++run) {
          const Surfel& surfel = cloud[run * cloud.size() / kRuns];
          const LocalReceiver receiver = {surfel.position, surfel.normal};
          const GatherResult expected = scene.gather(receiver, quality);
          for (const GatherResult& result : gatherPacket(
                   gatherer, scene, std::vector<LocalReceiver>(kPacketReceivers, receiver))) {
            worst = std::max(worst, difference(result, expected));
          }
        }
        EXPECT_LT(worst, 1e-4) << max_solid_angle << ' ' << int(sides);
      }
    }
  }
}

// One cut for all is finer than each would choose, and the order is shared: close, not equal.
TEST(PacketGatherer, NeighboursComeCloseToWhatEachGathersAlone) {
  const Cloud cloud = mixedCloud();
  TestScene scene(cloud);
  GatherQuality quality;
  PacketGatherer gatherer(GatherMode::kBleeding, quality);
  double square = 0;
  for (std::size_t run = 0; run < kRuns; ++run) {
    const std::vector<LocalReceiver> receivers = neighbours(cloud, run * cloud.size() / kRuns);
    const std::vector<GatherResult> results = gatherPacket(gatherer, scene, receivers);
    for (std::size_t i = 0; i < receivers.size(); ++i) {
      const double error = difference(results[i], scene.gather(receivers[i], quality));
      square += error * error;
    }
  }
  EXPECT_LT(std::sqrt(square / double(kRuns * kPacketReceivers)), .01);
}

// A cluster on a patch of the ground.
std::vector<LocalReceiver> denseReceivers() {
  std::vector<LocalReceiver> receivers;
  for (int i = 0; i < int(kClusterReceivers); ++i) {
    receivers.push_back({{.2f + .002f * float(i % 16), .1f + .002f * float(i / 16), 0}, {0, 0, 1}});
  }
  return receivers;
}

// A cluster anywhere above the ground, inside spheres too, facing anywhere.
std::vector<LocalReceiver> scatteredReceivers() {
  std::mt19937 random(11);
  std::uniform_real_distribution<float> uniform(-1, 1);
  const auto anywhere = [&] {
    const float x = uniform(random), y = uniform(random);
    return glm::vec3(x, y, uniform(random));
  };
  std::vector<LocalReceiver> receivers;
  while (receivers.size() < kClusterReceivers) {
    const glm::vec3 position = anywhere(), normal = anywhere();
    const float length = glm::length(normal);
    if (length < .1f || length > 1) continue;
    receivers.push_back({{4 * position.x, 4 * position.y, 1 + .99f * position.z}, normal / length});
  }
  return receivers;
}

struct Differences {
  double rms = 0, largest = 0;
};

Differences differences(const std::vector<GatherResult>& a, const std::vector<GatherResult>& b) {
  Differences found;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double error = difference(a[i], b[i]);
    found.rms += error * error / double(a.size());
    found.largest = std::max(found.largest, error);
  }
  found.rms = std::sqrt(found.rms);
  return found;
}

// What is near to any receiver of a packet is opened for all: scattered ones are better off in less
// company. Measured: 234 packets, differences of 0.0017 RMS and 0.022 at most.
TEST(PacketGatherer, ScatteredReceiversAreDividedAndComeCloseToWhatEachGathersAlone) {
  TestScene scene(fineCloud());
  const std::vector<LocalReceiver> receivers = scatteredReceivers();
  const GatherQuality quality;
  PacketGatherer gatherer(GatherMode::kBleeding, quality);
  const std::vector<GatherResult> results = gatherPacket(gatherer, scene, receivers);
  EXPECT_GT(gatherer.work().packets, 4 * kClusterPackets);
  EXPECT_LE(gatherer.work().packets, kClusterReceivers);
  std::vector<GatherResult> expected;
  for (const LocalReceiver& receiver : receivers)
    expected.push_back(scene.gather(receiver, quality));
  const Differences found = differences(results, expected);
  EXPECT_LT(found.rms, .004);
  EXPECT_LT(found.largest, .04);
}

// Only pixels that count are cleared: what others hold from before must not be looked at.
TEST(PacketGatherer, WhatWasGatheredBeforeLeavesNothing) {
  TestScene scene(mixedCloud());
  for (const std::vector<LocalReceiver>& receivers : {denseReceivers(), scatteredReceivers()}) {
    PacketGatherer fresh(GatherMode::kBleeding, {}), used(GatherMode::kBleeding, {});
    std::vector<LocalReceiver> others = receivers;
    for (LocalReceiver& receiver : others) receiver.normal = -receiver.normal;
    gatherPacket(used, scene, others);
    const std::vector<GatherResult> expected = gatherPacket(fresh, scene, receivers);
    const std::vector<GatherResult> found = gatherPacket(used, scene, receivers);
    for (std::size_t i = 0; i < expected.size(); ++i) {
      ASSERT_EQ(difference(found[i], expected[i]), 0) << i;
    }
  }
}

// A two-sided sheet that leans over the receiver by 45 degrees and meets its plane a fiftieth of a
// radius away: rays that began the bias above the receiver would begin behind it.
TEST(PacketGatherer, WhatHangsOverAReceiverIsNotLookedThrough) {
  constexpr float kSide = .05f, kAway = .0007f, kFirstRow = .1f;
  const glm::vec3 up = glm::normalize(glm::vec3(-1, 0, 1)), normal(up.z, 0, -up.x);
  Cloud sheet;
  for (int row = 0; row < 120; ++row) {
    for (int column = -120; column <= 120; ++column) {
      Surfel& piece = sheet.emplace_back();
      piece.position =
          glm::vec3(kAway, float(column) * kSide, 0) + (float(row) + kFirstRow) * kSide * up;
      piece.normal = normal;
      piece.area = kSide * kSide;
      piece.radius = std::sqrt(.5f) * kSide;
      piece.flags = kSurfelTwoSided;
    }
  }
  TestScene scene(sheet);
  const GatherQuality quality;
  const LocalReceiver receiver = {{0, 0, 0}, {0, 0, 1}};
  PacketGatherer gatherer(GatherMode::kOcclusion, quality);
  const std::vector<LocalReceiver> packet(kPacketReceivers, receiver);
  const double expected = (1 + std::sqrt(.5)) / 2;
  EXPECT_NEAR(double(scene.gather(receiver, quality).occlusion), expected, .05);
  EXPECT_NEAR(double(gatherPacket(gatherer, scene, packet)[0].occlusion), expected, .05);
}

// Half a plane of disks that face the receiver, which lies in that plane, just beside its edge.
// Disks end past the edge. Places are rounded to either side of the plane, which must not decide
// whether all is dark.
TEST(PacketGatherer, RoundingPutsNothingInAPlaneBeforeAReceiverInIt) {
  const glm::vec3 turned = glm::normalize(glm::vec3(.3f, -.5f, .8f));
  for (const glm::vec3& normal : {glm::vec3(0, 0, 1), turned}) {
    const glm::vec3 u = glm::normalize(glm::cross(normal, glm::vec3(0, 1, 0)));
    const glm::vec3 v = glm::cross(normal, u);
    for (const float scale : {1e-3f, 1.f, 1e4f}) {
      const auto occlusionBelow = [&](float radii) {
        Cloud plane;
        for (int i = 0; i < 40 * 40; ++i) {
          Surfel& piece = plane.emplace_back();
          piece.radius = .71f * scale;
          const float x = float(i % 40) + .4f, y = float(i / 40) - 20;
          piece.position = scale * (x * u + y * v) + radii * piece.radius * normal;
          piece.normal = -normal;
          piece.area = scale * scale;
        }
        TestScene scene(plane);
        return scene.gather({{0, 0, 0}, normal}, GatherQuality()).occlusion;
      };
      for (const float radii : {-.001f, -.0001f, 0.f, .0001f, .001f}) {
        EXPECT_NEAR(occlusionBelow(radii), 0, 1e-6) << radii << " radii, scale " << scale;
      }
      // It may still lie close before it
      EXPECT_GT(occlusionBelow(.01f), .3f) << scale;
    }
  }
}

// What lies anywhere is not met by exp(-1) of the rays.
TEST(PacketGatherer, LeavesAndRibbonsCoverAsMuchAsWhatIsSpreadAtRandom) {
  const float expected = 1 - std::exp(-1.f);
  struct Case {
    std::size_t count;
    float disk_part;
  };
  for (const auto& [count, disk_part] :
       {Case{20'000, kLeaf}, {200'000, kLeaf}, {3'000, kRibbon}, {20'000, kRibbon}}) {
    TestScene scene(foliage(count, disk_part));
    const GatherQuality quality;
    PacketGatherer gatherer(GatherMode::kBleeding, quality);
    std::vector<LocalReceiver> receivers;
    for (std::size_t i = 0; i < kPacketReceivers; ++i) {
      const float z = 1 - (2 * float(i) + 1) / kPacketReceivers, across = std::sqrt(1 - z * z);
      receivers.push_back(
          {{.01f * float(i), 0, 0},
           {across * std::cos(2.4f * float(i)), across * std::sin(2.4f * float(i)), z}});
    }
    double packet = 0, alone = 0, light = 0;
    for (const GatherResult& result : gatherPacket(gatherer, scene, receivers)) {
      packet += double(result.occlusion) / kPacketReceivers;
      light += double(result.irradiance.x) / kPacketReceivers;
    }
    for (const LocalReceiver& receiver : receivers) {
      alone += double(scene.gather(receiver, quality).occlusion) / kPacketReceivers;
    }
    SCOPED_TRACE(testing::Message() << count << " of " << disk_part);
    EXPECT_NEAR(packet, expected, .03) << count;
    EXPECT_NEAR(alone, expected, .03) << count;
    EXPECT_NEAR(light, packet, 1e-4) << count;  // leaves shine to both sides
  }
}

TEST(PacketGatherer, DenseReceiversAreNotDivided) {
  TestScene scene(fineCloud());
  PacketGatherer gatherer(GatherMode::kBleeding, GatherQuality());
  gatherPacket(gatherer, scene, denseReceivers());
  EXPECT_EQ(gatherer.work().packets, kClusterPackets);
}

}  // namespace
}  // namespace surfeit
