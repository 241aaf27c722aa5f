// Gathers that see some groups of surfels are held to gathers from clouds of these alone.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>
#include <string>
#include <vector>

#include "gather/packet/packet_gatherer.h"
#include "gather/brute_force.h"
#include "gather/test_clouds.h"
#include "gather/test_scene.h"
#include "surfeit/bounce.h"
#include "surfeit/scene.h"

namespace surfeit {
namespace {

using testing::HasSubstr;
using Cloud = std::vector<Surfel>;

constexpr std::uint64_t kSubsets[] = {groupBit(0), groupBit(1) | groupBit(5), groupBit(3),
                                      groupBit(0) | groupBit(3) | groupBit(40)};

// A ground of group 0; above it spheres of groups 1 to 4 and a ceiling that faces up (group 5), of
// which every 23rd surfel is a lamp that faces down (group 3).
Cloud groupedCloud() {
  Cloud cloud;
  const auto add = [&](const glm::vec3& position, const glm::vec3& normal, float area,
                       std::uint32_t group) {
    Surfel surfel;
    surfel.position = position;
    surfel.normal = normal;
    surfel.area = area;
    surfel.radius = std::sqrt(area / 2);
    surfel.radiosity = glm::vec3(.5f) + .4f * glm::sin(7.f * position);
    surfel.group = group;
    cloud.push_back(surfel);
  };
  constexpr int kSide = 90;
  constexpr float kStep = 6.f / kSide;
  for (int i = 0; i < kSide * kSide; ++i) {
    const glm::vec3 at((float(i % kSide) + .5f) * kStep - 3, (float(i / kSide) + .5f) * kStep - 3,
                       0);
    add(at, {0, 0, 1}, kStep * kStep, 0);
    const bool is_lamp = i % 23 == 0;
    add(at + glm::vec3(0, 0, 3), {0, 0, is_lamp ? -1 : 1}, kStep * kStep, is_lamp ? 3 : 5);
  }
  for (std::uint32_t group = 1; group < 5; ++group) {
    constexpr int kCount = 900;
    const float radius = .3f + .1f * float(group);
    const float phase = 1.6f * float(group);
    for (int i = 0; i < kCount; ++i) {
      const float z = 1 - float(2 * i + 1) / kCount, phi = float(i) * 2.39996323f;
      const float rho = std::sqrt(1 - z * z);
      const glm::vec3 outward(rho * std::cos(phi), rho * std::sin(phi), z);
      add(glm::vec3(1.2f * std::cos(phase), 1.2f * std::sin(phase), 1.2f) + radius * outward,
          outward, 4 * kPi * radius * radius / kCount, group);
    }
  }
  return cloud;
}

Cloud subsetOf(const Cloud& cloud, std::uint64_t groups) {
  Cloud subset;
  std::copy_if(cloud.begin(), cloud.end(), std::back_inserter(subset),
               [&](const Surfel& surfel) { return (groups & groupBit(surfel.group)) != 0; });
  return subset;
}

GatherRules rulesFor(std::uint64_t groups, float max_solid_angle) {
  GatherQuality quality;
  quality.max_solid_angle = max_solid_angle;
  GatherRules rules(GatherMode::kBleeding, quality);
  rules.groups = groups;
  return rules;
}

// A receiver on one surfel of so many.
std::vector<LocalReceiver> receiversOn(const Cloud& cloud, std::size_t step) {
  std::vector<LocalReceiver> receivers;
  for (std::size_t i = 0; i < cloud.size(); i += step) {
    receivers.push_back({cloud[i].position, cloud[i].normal});
  }
  return receivers;
}

double difference(const GatherResult& a, const GatherResult& b) {
  const glm::vec3 color = glm::abs(a.irradiance - b.irradiance);
  return double(std::max({std::abs(a.occlusion - b.occlusion), color.x, color.y, color.z}));
}

// Equal distances are drawn in the order of the walk, and may close other pixels.
TEST(Subset, WithEveryNodeOpenItIsTheSubsetAlone) {
  TestScene scene(groupedCloud());
  for (const std::uint64_t groups : kSubsets) {
    TestScene alone(subsetOf(scene.cloud(), groups));
    const GatherRules subset = rulesFor(groups, 0), all = rulesFor(kAllGroups, 0);
    for (const LocalReceiver& receiver : receiversOn(scene.cloud(), 1511)) {
      const GatherResult found = scene.gather(receiver, subset);
      EXPECT_LT(difference(found, alone.gather(receiver, all)), 3e-3);
      EXPECT_LT(difference(found, gatherBruteForce(receiver, scene.cloud(), subset)), 3e-3);
    }
  }
}

TEST(Subset, ApproximatesTheSubsetAlone) {
  TestScene scene(groupedCloud());
  for (const std::uint64_t groups : kSubsets) {
    TestScene alone(subsetOf(scene.cloud(), groups));
    const GatherRules subset = rulesFor(groups, .08f), all = rulesFor(kAllGroups, .08f);
    const GatherRules exact = rulesFor(kAllGroups, 0);
    double square = 0, square_alone = 0, seen = 0;
    const std::vector<LocalReceiver> receivers = receiversOn(scene.cloud(), 97);
    for (const LocalReceiver& receiver : receivers) {
      const GatherResult expected = alone.gather(receiver, exact);
      const double error = difference(scene.gather(receiver, subset), expected);
      const double error_alone = difference(alone.gather(receiver, all), expected);
      square += error * error;
      square_alone += error_alone * error_alone;
      seen += double(expected.occlusion);
    }
    const double rms = std::sqrt(square / double(receivers.size()));
    const double rms_alone = std::sqrt(square_alone / double(receivers.size()));
    std::printf("groups %llx: error %.5f, of the subset alone %.5f\n",
                static_cast<unsigned long long>(groups), rms, rms_alone);
    EXPECT_LT(rms, 1.1 * rms_alone + .0003) << groups;
    EXPECT_GT(seen / double(receivers.size()), .003) << groups;
  }
}

TEST(Subset, PacketsGiveWhatTheScalarGatherGives) {
  TestScene scene(groupedCloud());
  for (const std::uint64_t groups : kSubsets) {
    const GatherRules rules = rulesFor(groups, .08f);
    PacketGatherer gatherer(rules);
    double worst = 0;
    for (const LocalReceiver& receiver : receiversOn(scene.cloud(), 511)) {
      const std::vector<LocalReceiver> packet(kPacketReceivers, receiver);
      std::vector<GatherResult> results(packet.size());
      const Status status = gatherer.gather(packet, scene.reader(), results);
      ASSERT_TRUE(status.ok()) << status.message();
      const GatherResult expected = scene.gather(receiver, rules);
      for (const GatherResult& result : results) {
        worst = std::max(worst, difference(result, expected));
      }
    }
    EXPECT_LT(worst, 1e-3) << groups;
  }
}

// Clouds and scenes as files.
class SubsetOfSceneTest : public testing::Test {
 protected:
  static Table tableOf(const Cloud& cloud, bool has_groups) {
    Table table;
    for (const char* name : {"x", "y", "z", "nx", "ny", "nz", "radius", "area", "radiosity_r",
                             "radiosity_g", "radiosity_b", "albedo_r", "albedo_g", "albedo_b"}) {
      table.addProperty(name);
    }
    if (has_groups) table.addProperty("group", ValueType::kInt32);
    for (const Surfel& s : cloud) {
      const glm::vec3 &p = s.position, &n = s.normal, &b = s.radiosity;
      table.rows.push_back(
          {p.x, p.y, p.z, n.x, n.y, n.z, s.radius, s.area, b.x, b.y, b.z, .5, .5, .5});
      if (has_groups) table.rows.back().push_back(double(s.group));
    }
    return table;
  }

  Result<GatherStats> gather(const std::string& scene, std::uint64_t groups,
                             const std::string& result, int threads = 2) {
    GatherOptions options;
    options.mode = GatherMode::kBleeding;
    options.groups = groups;
    options.threads = threads;
    options.memory_bytes = std::uint64_t{64} << 20;
    Progress progress;
    return gatherCloud(path(scene), path("receivers.ply"), path(result), options, progress);
  }

  Result<BounceStats> bounce(const std::string& scene, std::uint64_t groups,
                             const std::string& result) {
    BounceOptions options;
    options.groups = groups;
    options.threads = 2;
    options.memory_bytes = std::uint64_t{128} << 20;
    Progress progress;
    return bounceScene(path(scene), path(result), options, progress);
  }

  std::string path(const std::string& name) const { return directory_.file(name); }

  TestDirectory directory_;
};

TEST_F(SubsetOfSceneTest, GatheringIsThatOfTheSubsetAlone) {
  const Cloud cloud = groupedCloud();
  makeScene(tableOf(cloud, true), path("all.sft"));
  writeTable(receiversOf(2000), path("receivers.ply"));
  for (const std::uint64_t groups : kSubsets) {
    makeScene(tableOf(subsetOf(cloud, groups), false), path("alone.sft"));
    const Result<GatherStats> found = gather("all.sft", groups, "found.ply");
    ASSERT_TRUE(found.ok()) << found.status().message();
    ASSERT_TRUE(gather("alone.sft", kAllGroups, "alone.ply").ok());
    const Table a = readTable(path("found.ply")), b = readTable(path("alone.ply"));
    for (const char* name : {"occlusion", "irradiance_r", "irradiance_b"}) {
      const std::vector<double> x = a.column(name), y = b.column(name);
      ASSERT_EQ(x.size(), 2000u);
      double square = 0;
      for (std::size_t i = 0; i < x.size(); ++i) square += (x[i] - y[i]) * (x[i] - y[i]);
      EXPECT_LT(std::sqrt(square / double(x.size())), .012) << groups << ' ' << name;
    }
    ASSERT_TRUE(gather("all.sft", groups, "again.ply", 1).ok());
    EXPECT_EQ(readBytes(path("again.ply")), readBytes(path("found.ply")));
  }
}

TEST_F(SubsetOfSceneTest, AllGroupsGiveWhatSceneWithoutGroupsGives) {
  const Cloud cloud = groupedCloud();
  makeScene(tableOf(cloud, true), path("grouped.sft"));
  makeScene(tableOf(cloud, false), path("plain.sft"));
  writeTable(receiversOf(1000), path("receivers.ply"));
  ASSERT_TRUE(gather("grouped.sft", kAllGroups, "grouped.ply").ok());
  ASSERT_TRUE(gather("plain.sft", kAllGroups, "plain.ply").ok());
  EXPECT_EQ(readBytes(path("grouped.ply")), readBytes(path("plain.ply")));
}

TEST_F(SubsetOfSceneTest, GroupsThatAreNotThereAreRefusedBeforeAnyWork) {
  const Cloud cloud = groupedCloud();
  makeScene(tableOf(cloud, true), path("grouped.sft"));
  makeScene(tableOf(cloud, false), path("plain.sft"));
  writeTable(receiversOf(10), path("receivers.ply"));
  for (const Status& status : {gather("plain.sft", groupBit(1), "out.ply").status(),
                               bounce("plain.sft", groupBit(1), "out.sft").status()}) {
    EXPECT_EQ(status.code(), StatusCode::kCorruption);
    EXPECT_THAT(status.message(), HasSubstr("plain.sft: found no groups"));
  }
  for (const Status& status : {gather("grouped.sft", groupBit(7), "out.ply").status(),
                               bounce("grouped.sft", groupBit(7), "out.sft").status()}) {
    EXPECT_EQ(status.code(), StatusCode::kInvalidArgument);
    EXPECT_THAT(status.message(), HasSubstr("found groups 0-5, expected one of those chosen: 7"));
  }
  EXPECT_TRUE(directory_.holdsOnly({"grouped.sft", "plain.sft", "receivers.ply"}));
}

TEST_F(SubsetOfSceneTest, LightOfGroupsThatAreNotSeenDoesNotBounce) {
  Cloud cloud = groupedCloud();
  for (Surfel& surfel : cloud) surfel.radiosity = glm::vec3(surfel.group == 3 ? 1.f : 0.f);
  makeScene(tableOf(cloud, true), path("lamps.sft"));
  const Result<BounceStats> dark = bounce("lamps.sft", kAllGroups & ~groupBit(3), "dark.sft");
  ASSERT_TRUE(dark.ok()) << dark.status().message();
  EXPECT_EQ(dark->passes[0].largest_change, 0);
  const Result<BounceStats> all = bounce("lamps.sft", kAllGroups, "lit.sft");
  const Result<BounceStats> lamps = bounce("lamps.sft", groupBit(3), "open.sft");
  ASSERT_TRUE(all.ok() && lamps.ok());
  // Nothing stands in the way of the lamps alone
  EXPECT_GT(lamps->passes[0].mean_radiosity.r, all->passes[0].mean_radiosity.r);

  // The result can be chosen from again
  Progress progress;
  const Result<VerifyReport> report = verifyScene(path("open.sft"), 1, progress);
  ASSERT_TRUE(report.ok());
  EXPECT_THAT(report->findings, testing::IsEmpty());
  const Result<SceneInfo> info = readSceneInfo(path("open.sft"));
  ASSERT_TRUE(info.ok());
  EXPECT_EQ(info->groups, 0b111111u);
  EXPECT_THAT(info->provenance, HasSubstr("\"groups\":\"3\""));
}

}  // namespace
}  // namespace surfeit
