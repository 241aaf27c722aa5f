#include "gather/cut/cut.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <random>
#include <vector>

#include "gather/cut/packet_cluster.h"
#include "gather/cut/packet_cost.h"
#include "gather/test_scene.h"

namespace surfeit {
namespace {

glm::vec3 randomDirection(std::mt19937& random) {
  std::normal_distribution<float> normal;
  return glm::normalize(glm::vec3(normal(random), normal(random), normal(random)));
}

// Surfels on a box and a sphere in it.
std::vector<Surfel> boxWithSphere(int count) {
  std::mt19937 random(1);
  std::uniform_real_distribution<float> uniform(-2, 2);
  std::vector<Surfel> cloud;
  for (int i = 0; i < count; ++i) {
    Surfel surfel;
    surfel.position = {uniform(random), uniform(random), uniform(random)};
    if (i % 2 == 0) {
      const int axis = i / 2 % 3;
      surfel.position[axis] = i / 6 % 2 == 0 ? 2.f : -2.f;
      surfel.normal[axis] = -surfel.position[axis] / 2;
    } else {
      surfel.normal = randomDirection(random);
      surfel.position = .5f * surfel.normal;
    }
    surfel.area = 100.f / float(count);
    surfel.radius = std::sqrt(surfel.area);
    surfel.radiosity = {1, 1, 1};
    // On one side all of a group, on the other two mixed
    surfel.group = surfel.position.x < 0 ? 0u : 1u + std::uint32_t(i / 2 % 2);
    cloud.push_back(surfel);
  }
  return cloud;
}

Node randomNode(std::mt19937& random) {
  std::uniform_real_distribution<float> uniform(0, 1);
  Node node{};
  node.position = 3 * uniform(random) * randomDirection(random);
  node.normal = randomDirection(random);
  node.radius = .5f * uniform(random) * uniform(random);
  node.forgetBounds();
  if (random() % 4 != 0) {
    node.thickness = node.radius * uniform(random) * uniform(random);
    node.normal_cosine = 1 - uniform(random) * uniform(random);
  }
  node.flatness = 1 - uniform(random) * uniform(random);
  node.flags = node.flatness > .97f ? kNodeFlat : 0;
  node.off_plane = node.isFlat() ? node.thickness : 0;
  node.child_count = random() % 2 == 0 ? 0 : 8;
  node.groups = 1 + random() % 7;  // some of three
  return node;
}

std::vector<LocalReceiver> randomPacket(std::mt19937& random, std::size_t count) {
  std::vector<LocalReceiver> receivers;
  const glm::vec3 axis = randomDirection(random);
  while (receivers.size() < count) {
    receivers.push_back(
        {.05f * randomDirection(random), glm::normalize(axis + .2f * randomDirection(random))});
  }
  return receivers;
}

TEST(Cut, ClassesOfSiblingsHoldForEveryReceiver) {
  std::mt19937 random(5);
  int far = 0, open = 0, mixed = 0, dropped = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    std::vector<Node> siblings;
    for (int i = 0; i < 1 + trial % 8; ++i) siblings.push_back(randomNode(random));
    const std::vector<LocalReceiver> receivers = randomPacket(random, std::size_t(1 + trial % 5));
    const CutRules rules = {
        trial % 7 == 0 ? 0.f : .1f,  trial % 3 == 0 ? 2.f : 1e30f,
        float(trial % 3 - 1),        trial % 5 < 2 ? std::uint64_t(1 + trial % 7) : kAllGroups,
        trial % 2 == 0 ? .25f : 1.f, .125f};
    GatherRules gather(GatherMode::kBleeding, {});
    if (trial % 4 == 0) gather.weights.cone_angle = .1f + .001f * float(trial % 1000);
    const PacketView view = viewPacket(receivers, gather);
    const SiblingClasses found = fastestSiblingClassifier()(siblings, view, rules);
    EXPECT_EQ(found.far & found.open, 0u);
    EXPECT_EQ((found.far | found.open) & found.mixed, 0u);
    for (std::size_t i = 0; i < siblings.size(); ++i) {
      const auto bit = [i](std::uint32_t bits) { return (bits >> i & 1) != 0; };
      const bool is_seen = bit(found.far | found.open | found.mixed);
      dropped += !is_seen;
      far += bit(found.far);
      open += bit(found.open);
      mixed += bit(found.mixed);
      EXPECT_FALSE(!rules.sees(siblings[i].groups) && is_seen);
      for (const LocalReceiver& receiver : receivers) {
        const float part = openPart(siblings[i], receiver, rules);
        EXPECT_FALSE(bit(found.far) && part > 1e-3f);
        EXPECT_FALSE(bit(found.open) && part < 1 - 1e-3f);
      }
    }
  }
  EXPECT_GT(far, 500);
  EXPECT_GT(open, 500);
  EXPECT_GT(mixed, 30);
  EXPECT_GT(dropped, 500);
}

// Disks here and there within a node, and the bounds that hold them.
std::vector<Surfel> randomSurfels(std::mt19937& random, Node& node) {
  std::uniform_real_distribution<float> uniform(0, 1);
  const float flat = uniform(random) * uniform(random), turn = uniform(random) * uniform(random);
  std::vector<Surfel> surfels(std::size_t(1 + random() % 8));
  node.radius = node.thickness = 0;
  node.normal_cosine = 1;
  for (Surfel& surfel : surfels) {
    glm::vec3 offset = .4f * uniform(random) * randomDirection(random);
    offset -= (1 - flat) * glm::dot(offset, node.normal) * node.normal;
    surfel.position = node.position + offset;
    surfel.normal = glm::normalize(node.normal + turn * randomDirection(random));
    surfel.radius = .1f * uniform(random);
    const float cosine = glm::dot(surfel.normal, node.normal);
    const float sine = std::sqrt(std::max(0.f, 1 - cosine * cosine));
    node.radius = std::max(node.radius, glm::length(offset) + surfel.radius);
    node.thickness =
        std::max(node.thickness, std::abs(glm::dot(offset, node.normal)) + surfel.radius * sine);
    node.normal_cosine = std::min(node.normal_cosine, cosine);
  }
  node.thickness = std::min(node.thickness, node.radius);
  return surfels;
}

// Whether a receiver sees any place of a disk, tried at its middle and around its rim, that lies
// higher above the horizon than what may be dropped.
bool seesSome(const Surfel& surfel, const LocalReceiver& receiver) {
  const glm::vec3 aside = glm::normalize(glm::cross(surfel.normal, glm::vec3(.3f, .5f, .8f)));
  const glm::vec3 across = glm::cross(surfel.normal, aside);
  for (int i = 0; i <= 32; ++i) {
    const float angle = .2f * float(i), reach = i == 0 ? 0 : surfel.radius;
    const glm::vec3 to = surfel.position + reach * std::cos(angle) * aside +
                         reach * std::sin(angle) * across - receiver.position;
    const bool is_above =
        glm::dot(to, receiver.normal) > 1.01f * kFidelity.horizon_slope * glm::length(to);
    if (is_above && glm::dot(to, surfel.normal) < -1e-5f) return true;
  }
  return false;
}

// Whatever the surfels: flat or not, facing one way or many.
TEST(Cut, NothingThatIsSeenIsDropped) {
  std::mt19937 random(8);
  int below = 0, away = 0, seen = 0;
  for (int trial = 0; trial < 20'000; ++trial) {
    Node node = randomNode(random);
    node.groups = 1;
    const std::vector<Surfel> surfels = randomSurfels(random, node);
    const std::vector<LocalReceiver> receivers = randomPacket(random, std::size_t(1 + trial % 16));
    const PacketView view = viewPacket(receivers);
    const CutRules both = {.1f, 1e30f, 0, kAllGroups, 1, .125f};
    CutRules fronts = both;
    fronts.facing = 1;
    const auto isDropped = [&](const CutRules& rules) {
      const SiblingClasses found = fastestSiblingClassifier()({&node, 1}, view, rules);
      return (found.far | found.open | found.mixed) == 0;
    };
    if (!isDropped(fronts)) {
      ++seen;
      continue;
    }
    (isDropped(both) ? below : away) += 1;
    for (const Surfel& surfel : surfels) {
      for (const LocalReceiver& receiver : receivers) {
        ASSERT_FALSE(seesSome(surfel, receiver)) << trial;
      }
    }
  }
  EXPECT_GT(below, 1000);
  EXPECT_GT(away, 1000);
  EXPECT_GT(seen, 1000);
}

// Parallel sheets have no spread of normals and any height: what stands on the upper one is seen
// from there.
TEST(Cut, AStackOfSheetsIsAsHighAsItIs) {
  Node stack{};
  stack.position = {3, 0, -10};
  stack.normal = {0, 0, 1};
  stack.radius = 12;
  stack.thickness = 12;
  stack.normal_cosine = 1;
  stack.flatness = 1;
  stack.flags = kNodeFlat;
  stack.groups = 1;
  const LocalReceiver receiver = {{0, 0, 0}, {0, 0, 1}};
  const CutRules rules = {.1f, 1e30f, 1, kAllGroups, 1, .125f};
  for (const float thickness : {12.f, 9.9f}) {
    stack.thickness = thickness;
    const SiblingClasses found =
        fastestSiblingClassifier()({&stack, 1}, viewPacket({&receiver, 1}), rules);
    EXPECT_EQ((found.far | found.open | found.mixed) != 0, thickness > 10) << thickness;
  }
}

// Counts the surfels that a walk stands for, for each receiver.
struct CountSurfels {
  std::array<double, kPacketReceivers> count{};
  int fading = 0;
  void add(double surfels, const LaneParts* parts) {
    for (std::size_t i = 0; i < kPacketReceivers; ++i) {
      count[i] += surfels * (parts != nullptr ? double((*parts)[i]) : 1);
    }
    fading += parts != nullptr;
  }
  void node(const Node& node, const LaneParts* parts) { add(double(node.surfel_count), parts); }
  OpenedNode opened(const Node&, const LaneParts*, OpenedNode) { return {}; }
  void surfels(std::span<const Surfel> run, const LaneParts* parts) {
    add(double(run.size()), parts);
  }
};

TEST(Cut, EveryReceiverSeesEverySurfelOfTheGroupsSeenOnce) {
  TestScene scene(boxWithSphere(20'000));
  for (const std::uint64_t groups : {kAllGroups, std::uint64_t{0b001}, std::uint64_t{0b110}}) {
    const auto seen =
        double(std::count_if(scene.cloud().begin(), scene.cloud().end(), [&](const Surfel& surfel) {
          return (groups & groupBit(surfel.group)) != 0;
        }));
    GatherQuality quality;
    quality.sides = GatherSides::kBoth;  // and no normals below: nothing is dropped
    GatherRules rules(GatherMode::kBleeding, quality);
    rules.groups = groups;
    CutWalk walk(rules);
    std::mt19937 random(9);
    int fading = 0;
    for (const float extent : {.01f, .1f, .5f, 2.f}) {
      std::vector<LocalReceiver> receivers(kPacketReceivers);
      for (LocalReceiver& receiver : receivers) {
        receiver.position = glm::vec3(1, .5f, -1) + extent * randomDirection(random);
      }
      CountSurfels found;
      ASSERT_TRUE(walk.walk(viewPacket(receivers), receivers, scene.reader(), found).ok());
      for (const double count : found.count) EXPECT_NEAR(count, seen, .01) << extent;
      fading += found.fading;
    }
    EXPECT_GT(fading, 100);
  }
}

// Adds up the heights of what a walk draws: no node stands where all below it do.
struct SumOfHeights {
  std::array<double, kPacketReceivers> sum{};  // for each receiver
  void add(float height, const LaneParts* parts) {
    for (std::size_t i = 0; i < kPacketReceivers; ++i) {
      sum[i] += double(height) * (parts != nullptr ? double((*parts)[i]) : 1);
    }
  }
  void node(const Node& node, const LaneParts* parts) { add(node.position.z, parts); }
  OpenedNode opened(const Node&, const LaneParts*, OpenedNode) { return {}; }
  void surfels(std::span<const Surfel> run, const LaneParts* parts) {
    for (const Surfel& surfel : run) add(surfel.position.z, parts);
  }
};

// On a way of 4,000 places nodes come and go, by and by, and not at once (23).
TEST(Cut, NodesFadeIntoWhatIsBelowThem) {
  TestScene scene(boxWithSphere(20'000));
  GatherQuality quality;
  quality.sides = GatherSides::kBoth;  // and no horizon: nothing is dropped
  const GatherRules rules(GatherMode::kBleeding, quality);
  CutWalk walk(rules);
  double before = 0, largest = 0, least = 1e9, most = -1e9;
  for (int i = 0; i < 4000; ++i) {
    const LocalReceiver receiver = {{1 + .00005f * float(i), .3f, -1}, {0, 0, 0}};
    SumOfHeights found;
    ASSERT_TRUE(walk.walk(viewPacket({&receiver, 1}), {&receiver, 1}, scene.reader(), found).ok());
    const double sum = found.sum[0];
    if (i > 0) largest = std::max(largest, std::abs(sum - before));
    least = std::min(least, sum);
    most = std::max(most, sum);
    before = sum;
  }
  EXPECT_GT(most - least, 10);
  EXPECT_LT(largest, .1);
}

// However wide the packet is: what it takes for others does not count.
TEST(Cut, EveryReceiverOfAPacketHasTheCutItHasAlone) {
  TestScene scene(boxWithSphere(20'000));
  GatherQuality quality;
  quality.sides = GatherSides::kBoth;  // and no normals below: nothing is dropped
  CutWalk walk(GatherRules(GatherMode::kBleeding, quality));
  for (const float width : {.003f, .05f, .4f}) {
    std::vector<LocalReceiver> receivers(kPacketReceivers);
    for (std::size_t k = 0; k < kPacketReceivers; ++k) {
      receivers[k] = {glm::vec3(1 + width * float(k) / 16, .3f, -1), {0, 0, 0}};
    }
    SumOfHeights together;
    ASSERT_TRUE(walk.walk(viewPacket(receivers), receivers, scene.reader(), together).ok());
    for (std::size_t k = 0; k < kPacketReceivers; ++k) {
      SumOfHeights alone;
      const std::span<const LocalReceiver> one(&receivers[k], 1);
      ASSERT_TRUE(walk.walk(viewPacket(one), one, scene.reader(), alone).ok());
      EXPECT_NEAR(together.sum[k], alone.sum[0], .01) << width << ' ' << k;
    }
  }
}

// A node says nothing about the few that are seen of it.
TEST(Cut, NodesOfWhichFewAreSeenAreOpenedAndTurnedAwayByProofAlone) {
  Node wall{};
  wall.position = {0, 0, 5};
  wall.normal = {0, 0, -1};
  wall.radius = .3f;
  wall.thickness = .01f;
  wall.normal_cosine = .999f;
  wall.flatness = .999f;
  wall.flags = kNodeFlat;
  wall.groups = 0b11;
  const LocalReceiver receiver = {{0, 0, 0}, {0, 0, 1}};
  const PacketView view = viewPacket({&receiver, 1});
  CutRules rules = {.1f, 1e30f, 1, kAllGroups, 1, .125f};
  EXPECT_EQ(openPart(wall, receiver, rules), 0);
  rules.groups = 0b10;
  EXPECT_EQ(openPart(wall, receiver, rules), 1);
  for (const float side : {-1.f, 1.f}) {
    wall.normal = {0, 0, side};
    const SiblingClasses found = fastestSiblingClassifier()({&wall, 1}, view, rules);
    EXPECT_EQ(found.far, 0u);
    EXPECT_EQ(found.open | found.mixed, side < 0 ? 1u : 0u);
  }
}

TEST(PacketCluster, DividesByPlaceAndNormal) {
  std::mt19937 random(3);
  std::vector<LocalReceiver> receivers;
  for (int i = 0; i < 200; ++i) {  // two walls back to back, far from a third one
    const glm::vec3 at = .1f * randomDirection(random) * glm::vec3(1, 1, 0);
    receivers.push_back(i % 3 == 0   ? LocalReceiver{at, {0, 0, 1}}
                        : i % 3 == 1 ? LocalReceiver{at, {0, 0, -1}}
                                     : LocalReceiver{at + glm::vec3(5, 0, 0), {0, 0, 1}});
  }
  const PacketCluster cluster(receivers);
  ASSERT_EQ(cluster.packetCount(), 13u);
  std::vector<int> seen(receivers.size(), 0);
  int mixed = 0;
  for (std::size_t i = 0; i < cluster.packetCount(); ++i) {
    for (std::size_t k = 0; k < cluster.places(i).size(); ++k) {
      ++seen[cluster.places(i)[k]];
      EXPECT_EQ(cluster.receivers(i)[k].position, receivers[cluster.places(i)[k]].position);
    }
    const PacketView view = viewPacket(cluster.receivers(i));
    mixed += view.radius > .3f || !view.has_horizon;
  }
  EXPECT_EQ(seen, std::vector<int>(receivers.size(), 1));
  // Those that halving by number leaves between two groups; in the order given all would be
  EXPECT_LE(mixed, 4);
}

// Seen from two places at once, what is between has no one look.
TEST(PacketCluster, PacketsAcrossTwoPlacesAreToBeDivided) {
  for (const float apart : {0.f, 5.f}) {
    std::mt19937 random(3);
    std::vector<LocalReceiver> receivers;
    for (int i = 0; i < 200; ++i) {  // 104 here, 96 there: one packet reaches across
      const glm::vec3 at = .1f * randomDirection(random) * glm::vec3(1, 1, 0);
      receivers.push_back({at + (i < 104 ? glm::vec3(0) : glm::vec3(apart, 0, 0)), {0, 0, 1}});
    }
    const PacketCluster cluster(receivers);
    int wide = 0;
    for (std::size_t i = 0; i < cluster.packetCount(); ++i) {
      wide += viewPacket(cluster.receivers(i)).radius > cluster.mostPacketRadius();
    }
    EXPECT_EQ(wide, apart == 0 ? 0 : 1);
  }
}

// Of nothing to draw, whose cost would divide no packet.
TEST(PacketCost, NoPartIsWiderThanAllowed) {
  std::vector<LocalReceiver> receivers(kPacketReceivers);
  for (std::size_t i = 0; i < receivers.size(); ++i) {
    receivers[i].position = {.01f * float(i) + (i < 3 ? 0.f : 5.f), 0, 0};
  }
  const PacketCost cost({GatherMode::kBleeding, {}});
  for (const float most_radius : {10.f, .2f}) {
    std::size_t next = 0, parts = 0;
    const auto visit = [&](std::size_t begin, std::size_t count) {
      EXPECT_EQ(begin, next);
      EXPECT_LE(viewPacket(std::span(receivers).subspan(begin, count)).radius, most_radius);
      next += count;
      ++parts;
      return Status();
    };
    EXPECT_TRUE(cost.forEachPart(receivers, most_radius, visit).ok());
    EXPECT_EQ(next, receivers.size());
    EXPECT_EQ(parts > 1, most_radius < 1);
  }
}

}  // namespace
}  // namespace surfeit
