#include "gather/cut.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <random>
#include <vector>

#include "gather/packet_cluster.h"
#include "gather/packet_cost.h"
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
  node.flatness = 1 - uniform(random) * uniform(random);
  node.flags = node.flatness > .97f ? kNodeFlat : 0;
  if (node.isFlat() && random() % 2 == 0) node.flags |= kNodeTwoSided;
  node.child_count = random() % 2 == 0 ? 0 : 8;
  node.groups = 1 + random() % 7;  // some of three
  return node;
}

TEST(Cut, EightSiblingsAtOnceAreClassifiedLikeOneByOne) {
  std::mt19937 random(5);
  int differing = 0, far = 0, open = 0, dropped = 0, fading = 0, sloping = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    std::vector<Node> siblings;
    for (int i = 0; i < 1 + trial % 8; ++i) siblings.push_back(randomNode(random));
    std::vector<Receiver> receivers;
    const glm::vec3 axis = randomDirection(random);
    for (int i = 0; i < 1 + trial % 5; ++i) {
      receivers.push_back(
          {.05f * randomDirection(random), glm::normalize(axis + .2f * randomDirection(random))});
    }
    const CutRules rules = {
        trial % 7 == 0 ? 0.f : .1f, trial % 3 == 0 ? 2.f : 1e30f,
        float(trial % 3 - 1),       trial % 5 < 2 ? std::uint64_t(1 + trial % 7) : kAllGroups,
        trial % 2 == 0 ? 4.f : 1.f, trial % 11 < 5 ? .2f : 0.f};
    CutRegion region;
    region.part = CutRegion::Part(trial % 3);
    region.cluster = viewPacket(receivers);
    region.cluster.radius = .2f;
    region.limit = 1;
    GatherRules gather(GatherMode::kBleeding, {});
    if (trial % 4 == 0) gather.weights.cone_angle = .1f + .001f * float(trial % 1000);
    const PacketView view = viewPacket(receivers, gather);
    const SiblingClasses expected = classifySiblings(siblings, view, region, rules);
    const SiblingClasses found = fastestSiblingClassifier()(siblings, view, region, rules);
    if (rules.fading == 0) {
      EXPECT_EQ(found.far & found.open, 0u);
    }
    for (std::size_t i = 0; i < siblings.size(); ++i) {
      const auto bit = [i](std::uint32_t bits) { return bits >> i & 1; };
      differing += bit(expected.far) != bit(found.far) || bit(expected.open) != bit(found.open);
      far += int(bit(expected.far));
      open += int(bit(expected.open));
      dropped += !bit(expected.far) && !bit(expected.open);
      fading += int(bit(expected.far & expected.open));
      if (bit((expected.far & found.far) | (expected.open & found.open))) {
        const Blend one = found.below(i), other = expected.below(i);
        EXPECT_NEAR(one.at_centre, other.at_centre, 1e-3f);
        const float tolerance = 1e-3f * (1 + glm::length(other.slope));
        EXPECT_LT(glm::distance(one.slope, other.slope), tolerance);
        sloping += one.slope != glm::vec3(0);
      }
      EXPECT_FALSE(rules.isMixed(siblings[i]) && bit(expected.far | found.far));
      EXPECT_FALSE(!rules.sees(siblings[i].groups) && bit(expected.open | found.open));
    }
  }
  EXPECT_LE(differing, 3);  // where rounding decides
  EXPECT_GT(far, 500);
  EXPECT_GT(open, 500);
  EXPECT_GT(dropped, 500);
  EXPECT_GT(fading, 30);
  EXPECT_GT(sloping, 30);
}

// Counts the surfels that a walk stands for, those that fade in part.
struct CountSurfels {
  const CutRegion& region;
  glm::vec3 offset{0};  // of the receiver for which they count
  double count = 0;
  int fading = 0;
  void node(const Node& node, const Blend& blend) {
    const float part = blend.at(offset);
    count += double(part) * node.surfel_count;
    fading += part < 1 ? 1 : 0;
  }
  void leaf(const Node&) {}
  void surfels(std::span<const Surfel> run, const Blend& blend) {
    const double part = blend.at(offset);
    for (const Surfel& surfel : run) count += region.holds(surfel.position) ? part : 0;
  }
};
constexpr double kRounding = .01;

void expectEverySurfelOnce(Scene& scene, std::uint64_t groups) {
  const auto seen =
      double(std::count_if(scene.cloud().begin(), scene.cloud().end(), [&](const Surfel& surfel) {
        return (groups & groupBit(surfel.group)) != 0;
      }));
  GatherQuality quality;
  quality.sides = GatherSides::kBoth;  // and no normals below: nothing is dropped
  std::mt19937 random(9);
  double all_far = 0;
  int fading = 0;
  for (const float extent : {.01f, .1f, .5f}) {
    for (const float parallax : {.1f, .3f, .8f}) {
      quality.far_field_parallax = parallax;
      std::vector<Receiver> receivers(kClusterReceivers - 5);
      for (Receiver& receiver : receivers) {
        receiver.position = glm::vec3(1, .5f, -1) + extent * randomDirection(random);
      }
      const PacketCluster cluster(receivers, {GatherMode::kBleeding, quality});
      ASSERT_TRUE(cluster.shares());
      GatherRules rules(GatherMode::kBleeding, quality);
      rules.groups = groups;
      CutWalk walk(rules);
      const CutRegion far_region = cluster.farRegion();
      for (std::size_t i = 0; i < cluster.packetCount(); ++i) {
        CountSurfels far{far_region, cluster.packet(i).centre - cluster.view().centre};
        ASSERT_TRUE(walk.walk(cluster.view(), far_region, scene.reader(), far).ok());
        all_far += far.count;
        fading += far.fading;
        const CutRegion region = cluster.regionOf(i);
        CountSurfels near{region};
        ASSERT_TRUE(walk.walk(cluster.packet(i), region, scene.reader(), near).ok());
        EXPECT_NEAR(near.count + (cluster.shares(i) ? far.count : 0), seen, kRounding)
            << extent << ' ' << parallax << ' ' << i;
        fading += near.fading;
      }
    }
  }
  EXPECT_GT(all_far, 0);
  EXPECT_GT(fading, 100);
}

TEST(Cut, FlatNodesOfTwoSidedSurfelsTurnTheirBackOnNobody) {
  Node node{};
  node.position = {0, 0, 5};
  node.normal = {0, 0, 1};  // as the receiver looks
  node.radius = .1f;
  node.forgetBounds();
  node.flatness = 1;
  node.groups = 1;
  const PacketView view = viewPacket(std::vector<Receiver>{{{0, 0, 0}, {0, 0, 1}}});
  for (const bool is_two_sided : {false, true}) {
    node.flags = std::uint8_t(kNodeFlat | (is_two_sided ? kNodeTwoSided : 0));
    const auto siblings = std::span<const Node>(&node, 1);
    EXPECT_EQ(classifySiblings(siblings, view, {}, {.1f, 1e30f}).far, is_two_sided ? 1u : 0u);
    EXPECT_EQ(fastestSiblingClassifier()(siblings, view, {}, {.1f, 1e30f}).far,
              is_two_sided ? 1u : 0u);
  }
}

TEST(Cut, NearAndFarWalkTakeEverySurfelOnce) {
  Scene scene(boxWithSphere(20'000));
  expectEverySurfelOnce(scene, kAllGroups);
}

// What is low may look larger, by the packet's horizon or the cluster's: nothing may be taken twice
// or left out for that. A few walls around receivers that face up, everything above their horizon.
TEST(Cut, NearAndFarWalkTakeWhatIsLowOnce) {
  std::vector<Surfel> cloud;
  for (const Surfel& surfel : boxWithSphere(40'000)) {
    if (surfel.position.z > -1.5f && std::abs(surfel.position.z) < 2) cloud.push_back(surfel);
  }
  Scene scene(cloud);
  GatherQuality quality;
  quality.sides = GatherSides::kBoth;
  quality.far_field_parallax = .5f;
  std::mt19937 random(9);
  std::vector<Receiver> receivers(kClusterReceivers);
  for (Receiver& receiver : receivers) {
    receiver = {glm::vec3(1, .5f, -1.9f) + .05f * randomDirection(random), {0, 0, 1}};
  }
  const GatherRules rules(GatherMode::kBleeding, quality);
  const PacketCluster cluster(receivers, rules);
  ASSERT_TRUE(cluster.shares());
  CutWalk walk(rules);
  const CutRegion far_region = cluster.farRegion();
  CountSurfels far{far_region};
  ASSERT_TRUE(walk.walk(cluster.view(), far_region, scene.reader(), far).ok());
  EXPECT_GT(far.count, 0);
  for (std::size_t i = 0; i < cluster.packetCount(); ++i) {
    const CutRegion region = cluster.regionOf(i);
    CountSurfels near{region};
    ASSERT_TRUE(walk.walk(cluster.packet(i), region, scene.reader(), near).ok());
    EXPECT_NEAR(near.count + (cluster.shares(i) ? far.count : 0), double(cloud.size()), kRounding)
        << i;
  }
}

TEST(Cut, NearAndFarWalkTakeEverySurfelOfTheGroupsSeenOnce) {
  Scene scene(boxWithSphere(20'000));
  for (const std::uint64_t groups : {0b001ull, 0b010ull, 0b110ull, 0b101ull}) {
    SCOPED_TRACE(groups);
    expectEverySurfelOnce(scene, groups);
  }
}

// Adds up the heights of what a walk draws: no node stands where all below it do.
struct SumOfHeights {
  glm::vec3 offset{0};  // of the receiver for which they count
  double sum = 0;
  void node(const Node& node, const Blend& blend) {
    sum += double(blend.at(offset)) * double(node.position.z);
  }
  void leaf(const Node&) {}
  void surfels(std::span<const Surfel> run, const Blend& blend) {
    for (const Surfel& surfel : run) sum += double(blend.at(offset)) * double(surfel.position.z);
  }
};

// On a way of 4,000 places nodes come and go, by and by, and not at once (23).
TEST(Cut, NodesFadeIntoWhatIsBelowThem) {
  Scene scene(boxWithSphere(20'000));
  GatherQuality quality;
  quality.sides = GatherSides::kBoth;  // and no horizon: nothing is dropped
  const GatherRules rules(GatherMode::kBleeding, quality);
  for (const SiblingClassifier classify : {&classifySiblings, fastestSiblingClassifier()}) {
    CutWalk walk(rules, classify);
    double before = 0, largest = 0, least = 1e9, most = -1e9;
    for (int i = 0; i < 4000; ++i) {
      const Receiver receiver = {{1 + .00005f * float(i), .3f, -1}, {0, 0, 0}};
      SumOfHeights found;
      ASSERT_TRUE(walk.walk(viewPacket({&receiver, 1}), {}, scene.reader(), found).ok());
      if (i > 0) largest = std::max(largest, std::abs(found.sum - before));
      least = std::min(least, found.sum);
      most = std::max(most, found.sum);
      before = found.sum;
    }
    EXPECT_GT(most - least, 10);
    EXPECT_LT(largest, .1);
  }
}

// What a receiver between two packets sees as one of either. (Of 1000 sums 164 differ by more than
// 1 when all receivers of a packet have the same blend; 6 with blends of their own.)
TEST(Cut, PacketsBlendAlikeForReceiversBetweenThem) {
  Scene scene(boxWithSphere(20'000));
  const GatherRules rules(GatherMode::kBleeding, {});
  CutWalk walk(rules);
  int differing = 0;
  for (int i = 0; i < 1000; ++i) {
    const glm::vec3 between = {1 + .0005f * float(i), .3f, -1};
    double sums[2];
    for (const int side : {0, 1}) {
      std::array<Receiver, kPacketReceivers> receivers;
      for (std::size_t k = 0; k < kPacketReceivers; ++k) {
        const float x = .0002f * (float(k) - (side == 0 ? 15 : 0));
        receivers[k] = {between + glm::vec3(x, 0, 0), {0, 1, 0}};
      }
      const PacketView view = viewPacket(receivers);
      SumOfHeights found{between - view.centre};
      ASSERT_TRUE(walk.walk(view, {}, scene.reader(), found).ok());
      sums[side] = found.sum;
    }
    differing += std::abs(sums[0] - sums[1]) > 1;
  }
  EXPECT_LT(differing, 20);
}

// Of a wall that faces away, a few surfels that do not.
TEST(Cut, NodesOfWhichFewAreSeenAreOpenedWhereverTheyFace) {
  Node wall{};
  wall.position = {0, 0, 5};
  wall.normal = {0, 0, 1};
  wall.radius = .3f;
  wall.forgetBounds();
  wall.flatness = .999f;
  wall.flags = kNodeFlat;
  wall.groups = 0b11;
  const Receiver receiver = {{0, 0, 0}, {0, 0, 1}};
  const PacketView view = viewPacket({&receiver, 1});
  for (const SiblingClassifier classify : {&classifySiblings, fastestSiblingClassifier()}) {
    CutRules rules = {.1f, 1e30f, 1};
    EXPECT_EQ(classify({&wall, 1}, view, {}, rules).open, 0u);
    EXPECT_EQ(classify({&wall, 1}, view, {}, rules).far, 0u);
    rules.groups = 0b10;
    EXPECT_EQ(classify({&wall, 1}, view, {}, rules).open, 1u);
  }
}

TEST(PacketCluster, DividesByPlaceAndNormal) {
  std::mt19937 random(3);
  std::vector<Receiver> receivers;
  for (int i = 0; i < 200; ++i) {  // two walls back to back, far from a third one
    const glm::vec3 at = .1f * randomDirection(random) * glm::vec3(1, 1, 0);
    receivers.push_back(i % 3 == 0   ? Receiver{at, {0, 0, 1}}
                        : i % 3 == 1 ? Receiver{at, {0, 0, -1}}
                                     : Receiver{at + glm::vec3(5, 0, 0), {0, 0, 1}});
  }
  const PacketCluster cluster(receivers, {GatherMode::kBleeding, {}});
  ASSERT_EQ(cluster.packetCount(), 13u);
  std::vector<int> seen(receivers.size(), 0);
  int mixed = 0;
  for (std::size_t i = 0; i < cluster.packetCount(); ++i) {
    for (std::size_t k = 0; k < cluster.places(i).size(); ++k) {
      ++seen[cluster.places(i)[k]];
      EXPECT_EQ(cluster.receivers(i)[k].position, receivers[cluster.places(i)[k]].position);
    }
    mixed += cluster.packet(i).radius > .3f || !cluster.packet(i).has_horizon;
  }
  EXPECT_EQ(seen, std::vector<int>(receivers.size(), 1));
  // Those that halving by number leaves between two groups; in the order given all would be
  EXPECT_LE(mixed, 4);
}

// Seen from two places at once, what is between has no one look.
TEST(PacketCluster, TwoPlacesShareNothingAndPacketsAcrossAreToBeDivided) {
  for (const float apart : {0.f, 5.f}) {
    std::mt19937 random(3);
    std::vector<Receiver> receivers;
    for (int i = 0; i < 200; ++i) {  // 104 here, 96 there: one packet reaches across
      const glm::vec3 at = .1f * randomDirection(random) * glm::vec3(1, 1, 0);
      receivers.push_back({at + (i < 104 ? glm::vec3(0) : glm::vec3(apart, 0, 0)), {0, 0, 1}});
    }
    const PacketCluster cluster(receivers, {GatherMode::kBleeding, {}});
    EXPECT_EQ(cluster.shares(), apart == 0);
    int wide = 0;
    for (std::size_t i = 0; i < cluster.packetCount(); ++i) {
      wide += cluster.packet(i).radius > cluster.mostPacketRadius();
    }
    EXPECT_EQ(wide, apart == 0 ? 0 : 1);
  }
}

// Of nothing to draw, whose cost would divide no packet.
TEST(PacketCost, NoPartIsWiderThanAllowed) {
  std::vector<Receiver> receivers(kPacketReceivers);
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
