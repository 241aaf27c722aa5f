// Gains of what groups of surfels send are held to gathers from clouds whose surfels send as much.
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

#include "gather/test_clouds.h"
#include "gather/test_scene.h"
#include "surfeit/bake.h"
#include "surfeit/engine.h"
#include "surfeit/shards.h"

namespace surfeit {
namespace {

const std::vector<GroupGain> kSomeGains = {{1, 2.5f}, {2, 0}, {3, .3f}};

// A floor of group 0; above it a ceiling of lamps: one half of group 1, the other of group 2, and
// of both every 19th of group 3. A ball of group 4 between them.
std::vector<Surfel> lampsAndBall() {
  std::vector<Surfel> cloud;
  const auto add = [&](const glm::vec3& position, const glm::vec3& normal, float area,
                       std::uint32_t group) {
    Surfel surfel;
    surfel.position = position;
    surfel.normal = normal;
    surfel.area = area;
    surfel.radius = std::sqrt(area / 2);
    surfel.radiosity = glm::vec3(.6f) + .4f * glm::sin(5.f * position);
    surfel.group = static_cast<std::uint8_t>(group);
    cloud.push_back(surfel);
  };
  constexpr int kSide = 60;
  constexpr float kStep = 4.f / kSide;
  for (int i = 0; i < kSide * kSide; ++i) {
    const glm::vec3 at((float(i % kSide) + .5f) * kStep - 2, (float(i / kSide) + .5f) * kStep - 2,
                       0);
    add(at, {0, 0, 1}, kStep * kStep, 0);
    add(at + glm::vec3(0, 0, 2), {0, 0, -1}, kStep * kStep, i % 19 == 0 ? 3 : at.x < 0 ? 1 : 2);
  }
  constexpr int kBall = 900;
  for (int i = 0; i < kBall; ++i) {
    const float z = 1 - float(2 * i + 1) / kBall, phi = float(i) * 2.39996323f;
    const float rho = std::sqrt(1 - z * z);
    const glm::vec3 outward(rho * std::cos(phi), rho * std::sin(phi), z);
    add(glm::vec3(0, 0, 1) + .4f * outward, outward, 4 * kPi * .16f / kBall, 4);
  }
  return cloud;
}

std::vector<Surfel> withGains(std::vector<Surfel> cloud, const std::vector<GroupGain>& gains) {
  for (Surfel& surfel : cloud) {
    for (const GroupGain& of : gains) {
      if (surfel.group == of.group) surfel.radiosity *= of.gain;
    }
  }
  return cloud;
}

GatherRules gainRules(const std::vector<GroupGain>& gains, float max_solid_angle) {
  GatherSettings settings;
  settings.mode = GatherMode::kBleeding;
  settings.quality.max_solid_angle = max_solid_angle;
  settings.gains = gains;
  return GatherRules(settings);
}

std::vector<LocalReceiver> someReceivers(const std::vector<Surfel>& cloud, std::size_t step) {
  std::vector<LocalReceiver> receivers;
  for (std::size_t i = 0; i < cloud.size(); i += step) {
    receivers.push_back({cloud[i].position, cloud[i].normal});
  }
  return receivers;
}

TEST(SendingGain, WithEveryNodeOpenItIsAnotherRadiosity) {
  TestScene scene(lampsAndBall()), changed(withGains(lampsAndBall(), kSomeGains));
  for (const LocalReceiver& receiver : someReceivers(scene.cloud(), 601)) {
    const GatherResult found = scene.gather(receiver, gainRules(kSomeGains, 0));
    const GatherResult expected = changed.gather(receiver, gainRules({}, 0));
    EXPECT_EQ(found.occlusion, expected.occlusion);
    EXPECT_EQ(found.irradiance, expected.irradiance);
  }
}

TEST(SendingGain, NodesApproximateAsThoseOfAnotherRadiosity) {
  TestScene scene(lampsAndBall()), changed(withGains(lampsAndBall(), kSomeGains));
  double square = 0, square_changed = 0, seen = 0;
  const std::vector<LocalReceiver> receivers = someReceivers(scene.cloud(), 41);
  for (const LocalReceiver& receiver : receivers) {
    const glm::vec3 exact = changed.gather(receiver, gainRules({}, 0)).irradiance;
    const glm::vec3 usual = changed.gather(receiver, gainRules({}, .08f)).irradiance;
    const glm::vec3 found = scene.gather(receiver, gainRules(kSomeGains, .08f)).irradiance;
    square += double(glm::dot(found - exact, found - exact));
    square_changed += double(glm::dot(usual - exact, usual - exact));
    seen += double(exact.g);
  }
  const double count = double(receivers.size());
  std::printf("error %.5f, of nodes of that radiosity %.5f, mean %.3f\n", std::sqrt(square / count),
              std::sqrt(square_changed / count), seen / count);
  EXPECT_LT(std::sqrt(square), 1.1 * std::sqrt(square_changed) + .0003 * std::sqrt(count));
  EXPECT_GT(seen / count, .1);
}

// One gain of all opens nothing, and is a factor; nor does the gain of what nobody sees.
TEST(SendingGain, OneGainOfAllIsAFactor) {
  TestScene scene(lampsAndBall());
  std::vector<GroupGain> all;
  for (std::uint32_t group = 0; group < 5; ++group) all.push_back({group, .25f});
  for (const LocalReceiver& receiver : someReceivers(scene.cloud(), 601)) {
    const GatherResult plain = scene.gather(receiver, gainRules({}, .08f));
    const auto visited = scene.work().nodes_visited;
    const GatherResult found = scene.gather(receiver, gainRules(all, .08f));
    EXPECT_EQ(scene.work().nodes_visited, visited);
    EXPECT_LT(glm::distance(found.irradiance, .25f * plain.irradiance), 1e-6f);
    EXPECT_EQ(found.occlusion, plain.occlusion);
    scene.gather(receiver, gainRules({{9, 3.f}}, .08f));
    EXPECT_EQ(scene.work().nodes_visited, visited);
  }
}

// Each light by itself, times its gain, adds up to all of them: coverage stays.
TEST(SendingGain, LightsAddUp) {
  TestScene scene(lampsAndBall());
  const auto only = [](std::uint32_t lit) {
    std::vector<GroupGain> gains;
    for (std::uint32_t group = 0; group < 5; ++group) {
      gains.push_back({group, group == lit ? 1.f : 0.f});
    }
    return gains;
  };
  for (const LocalReceiver& receiver : someReceivers(scene.cloud(), 601)) {
    glm::vec3 sum(0);
    for (std::uint32_t group = 0; group < 5; ++group) {
      sum += scene.gather(receiver, gainRules(only(group), 0)).irradiance;
    }
    const glm::vec3 all = scene.gather(receiver, gainRules({}, 0)).irradiance;
    EXPECT_LT(glm::distance(sum, all), 1e-5f);
  }
}

class SendingGainOfJobs : public testing::Test {
 protected:
  SendingGainOfJobs() : scene_(lampsAndBall()) {
    writeTable(receiversOf(1200), receivers_);
    options_.mode = GatherMode::kBleeding;
    options_.memory_bytes = 64 << 20;
    options_.gains = kSomeGains;
  }
  Result<GatherStats> gather(const std::string& result) {
    return gatherCloud(scene_.path(), receivers_, directory_.file(result), options_, progress_);
  }

  TestDirectory directory_;
  TestScene scene_;
  std::string receivers_ = directory_.file("receivers.ply");
  GatherOptions options_;
  struct Notes : Progress {
    void note(const std::string& message) override { said += message; }
    std::string said;
  } progress_;
};

TEST_F(SendingGainOfJobs, EnginesAndShardsGiveTheirBits) {
  const Result<GatherStats> stats = gather("one.ply");
  ASSERT_TRUE(stats.ok()) << stats.status().message();
  options_.threads = 1;
  ASSERT_TRUE(gatherResumable(scene_.path(), receivers_, directory_.file("parts.ply"), options_, 3,
                              progress_)
                  .ok());
  EXPECT_EQ(readBytes(directory_.file("parts.ply")), readBytes(directory_.file("one.ply")));
  EXPECT_EQ(progress_.said, "");

  const Table table = readTable(directory_.file("one.ply"));
  std::vector<Receiver> receivers;
  for (const std::vector<double>& row : table.rows) {
    receivers.push_back({{row[0], row[1], row[2]}, glm::vec3(row[3], row[4], row[5])});
  }
  std::vector<GatherResult> results(receivers.size());
  Result<Engine> engine = Engine::create({.memory_bytes = 64 << 20, .threads = 1});
  ASSERT_TRUE(engine.ok());
  const Result<Scene> scene = engine->open(scene_.path());
  ASSERT_TRUE(scene.ok());
  ASSERT_TRUE(engine
                  ->gatherAll({{*scene}}, options_, receivers.data(), receivers.size(),
                              results.data(), progress_)
                  .ok());
  const std::vector<double> green = table.column("irradiance_g");
  for (std::size_t i = 0; i < results.size(); ++i) {
    EXPECT_EQ(double(results[i].irradiance.g), green[i]) << i;
  }
}

TEST_F(SendingGainOfJobs, WrongOnesAreNamed) {
  const auto refusal = [&](const std::vector<GroupGain>& gains) {
    options_.gains = gains;
    const Status status = gather("none.ply").status();
    EXPECT_EQ(status.code(), StatusCode::kInvalidArgument) << status.message();
    EXPECT_TRUE(directory_.holdsOnly({"receivers.ply"}));
    return status.message();
  };
  using testing::HasSubstr;
  EXPECT_THAT(refusal({{64, 1}}), HasSubstr("0 to 63"));
  EXPECT_THAT(refusal({{1, -1}}), HasSubstr("gain of group 1 is -1"));
  EXPECT_THAT(refusal({{1, 2}, {1, 2}}), HasSubstr("found two"));
  EXPECT_THAT(refusal({{9, 2}}), HasSubstr("found groups 0-4"));
  options_.mode = GatherMode::kOcclusion;
  EXPECT_THAT(refusal({{1, 2}}), HasSubstr("--mode bleeding"));

  options_.mode = GatherMode::kBleeding;
  options_.gains = {{1, 2}, {9, 2}};
  ASSERT_TRUE(gather("noted.ply").ok());
  EXPECT_THAT(progress_.said, HasSubstr("no surfels of groups 9"));
}

}  // namespace
}  // namespace surfeit
