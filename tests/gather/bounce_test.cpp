// Bounces against the series that a closed diffuse room gives: with emission e and albedo rho
// everywhere, all it receives is what it sends, so B_k = e (1 + rho + ... + rho^k). A gather misses
// some hundredths of what a closed room sends, where disks leave gaps; a bounce then misses as much
// of what the bounce before had gained. So with a part d missing, B_k is e times the sum of the
// (rho (1 - d))^j, and the tests state d.
#include "surfeit/bounce.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>
#include <numeric>
#include <random>
#include <string>
#include <vector>

#include "gather/test_clouds.h"
#include "octree/indexed_surfels.h"
#include "surfeit/bake.h"
#include "surfeit/scene.h"

namespace surfeit {
namespace {

constexpr float kPi = 3.14159265f;
constexpr CloudChannels kEverything = {true, true, true, true, true, true};

Surfel surfelOf(const glm::vec3& position, const glm::vec3& normal, float area) {
  Surfel surfel;
  surfel.position = position;
  surfel.normal = normal;
  surfel.area = area;
  surfel.radius = std::sqrt(2 * area / kPi);
  return surfel;
}

// The inside of a cube of edge 2 with side * side surfels on each wall.
std::vector<Surfel> room(int side, const glm::vec3& emission, const glm::vec3& albedo) {
  std::vector<Surfel> cloud;
  const float step = 2 / float(side);
  for (int axis = 0; axis < 3; ++axis) {
    for (const float sign : {-1.f, 1.f}) {
      for (int i = 0; i < side * side; ++i) {
        glm::vec3 position(0), normal(0);
        position[axis] = sign;
        position[(axis + 1) % 3] = (float(i % side) + .5f) * step - 1;
        position[(axis + 2) % 3] = (float(i / side) + .5f) * step - 1;
        normal[axis] = -sign;
        Surfel& surfel = cloud.emplace_back(surfelOf(position, normal, step * step));
        surfel.radiosity = emission;
        surfel.albedo = albedo;
      }
    }
  }
  return cloud;
}

// The inside of the unit sphere; or its outside.
std::vector<Surfel> shell(int count, const glm::vec3& emission, const glm::vec3& albedo,
                          float side = -1) {
  std::vector<Surfel> cloud;
  for (int i = 0; i < count; ++i) {
    const float z = 1 - float(2 * i + 1) / float(count), phi = float(i) * 2.39996323f;
    const float r = std::sqrt(1 - z * z);
    const glm::vec3 out(r * std::cos(phi), r * std::sin(phi), z);
    Surfel& surfel = cloud.emplace_back(surfelOf(out, side * out, 4 * kPi / float(count)));
    surfel.radiosity = emission;
    surfel.albedo = albedo;
  }
  return cloud;
}

// A room with things of every kind in it, lit from a part of its ceiling.
std::vector<Surfel> furnishedRoom(int side = 24) {
  std::vector<Surfel> cloud = room(side, {0, 0, 0}, {.7f, .5f, .3f});
  for (Surfel& surfel : cloud) {
    if (surfel.position.z == 1 && glm::distance(surfel.position, {0, 0, 1}) < .5f) {
      surfel.radiosity = {3, 3, 2};
    }
  }
  std::mt19937 random(5);
  std::uniform_real_distribution<float> uniform(-1, 1);
  for (int i = 0; i < 600; ++i) {
    const glm::vec3 at = .6f * glm::vec3(uniform(random), uniform(random), uniform(random));
    Surfel& surfel = cloud.emplace_back(surfelOf(at, glm::normalize(at + .01f), .004f));
    surfel.albedo = {.4f, .6f, .2f};
    if (i % 3 == 1) surfel.flags = kSurfelTwoSided;
    if (i % 3 == 2) {
      surfel.flags = kSurfelSphere;
      surfel.normal = glm::vec3(0);
    }
  }
  return cloud;
}

class BounceTest : public testing::Test {
 protected:
  std::string index(const std::vector<Surfel>& cloud, const std::string& name,
                    const CloudChannels& channels = kEverything, bool full_precision = false) {
    const std::string path = directory_.file(name);
    indexSurfels(cloud, path, channels, full_precision);
    return path;
  }

  static BounceOptions optionsFor(int bounces, int threads = 2) {
    BounceOptions options;
    options.bounces = bounces;
    options.threads = threads;
    options.memory_bytes = 256 << 20;
    return options;
  }

  Result<BounceStats> bounce(const std::string& scene, const std::string& name,
                             const BounceOptions& options) {
    return bounceScene(scene, directory_.file(name), options, progress_);
  }
  // Expects success, and returns the surfels of the result.
  std::vector<Surfel> bounced(const std::string& scene, const BounceOptions& options) {
    const Result<BounceStats> stats = bounce(scene, "bounced.sft", options);
    EXPECT_TRUE(stats.ok()) << stats.status().message();
    if (stats.ok()) stats_ = *stats;
    return stats.ok() ? surfelsOf(directory_.file("bounced.sft")) : std::vector<Surfel>();
  }

  std::vector<std::string> findingsOf(const std::string& path) {
    const Result<VerifyReport> report = verifyScene(path, 2, progress_);
    return report.ok() ? report->findings : std::vector<std::string>{report.status().message()};
  }

  TestDirectory directory_;
  Progress progress_;
  BounceStats stats_;
};

const glm::vec3 kEmission(1, .5f, .25f), kAlbedo(.8f, .5f, .2f);

// In a channel, with the part d of all irradiance missing.
double seriesOf(int bounces, int channel, double missing) {
  const double factor = double(kAlbedo[channel]) * (1 - missing);
  double sum = 0, power = 1;
  for (int k = 0; k <= bounces; ++k, power *= factor) sum += power;
  return double(kEmission[channel]) * sum;
}

// The part that is missing at a value of the series: 0 when none is; negative when there is more.
double missingAt(double value, int bounces, int channel) {
  double low = -.1, high = .5;
  while (high - low > 1e-6) {
    const double middle = (low + high) / 2;
    (seriesOf(bounces, channel, middle) > value ? low : high) = middle;
  }
  return low;
}

// Expects that of what a closed room sends no more is missing than `at_most` anywhere and `on_mean`
// on the mean, and that there is nowhere too much.
void expectSeries(const std::string& what, const std::vector<Surfel>& surfels, int bounces,
                  double at_most, double on_mean) {
  double most = 0, least = 1, mean = 0;
  for (int channel = 0; channel < 3; ++channel) {
    double sum = 0;
    for (const Surfel& surfel : surfels) {
      const double missing = missingAt(double(surfel.radiosity[channel]), bounces, channel);
      most = std::max(most, missing);
      least = std::min(least, missing);
      sum += double(surfel.radiosity[channel]);
    }
    mean = std::max(mean, missingAt(sum / double(surfels.size()), bounces, channel));
  }
  fmt::print("{}, {} bounces: missing {:+.4f} to {:+.4f}, on the mean {:+.4f}\n", what, bounces,
             least, most, mean);
  EXPECT_LT(most, at_most);
  EXPECT_LT(mean, on_mean);
  EXPECT_GT(least, -.002);
}

TEST_F(BounceTest, AShellFollowsTheGeometricSeries) {
  const std::string scene = index(shell(10000, kEmission, kAlbedo), "shell.sft", kEverything, true);
  for (const int bounces : {1, 2, 5}) {
    expectSeries("shell", bounced(scene, optionsFor(bounces)), bounces, .035, .02);
  }
}

TEST_F(BounceTest, ARoomFollowsTheGeometricSeries) {
  const std::string scene = index(room(40, kEmission, kAlbedo), "room.sft", kEverything, true);
  for (const int bounces : {1, 2, 5}) {
    expectSeries("room", bounced(scene, optionsFor(bounces)), bounces, .07, .02);
  }
  BounceOptions options = optionsFor(3);
  options.surfels_per_receiver = 8;
  expectSeries("room, 8 surfels per receiver", bounced(scene, options), 3, .07, .02);
}

// Between receivers, in light that varies.
TEST_F(BounceTest, InterpolatedBouncesAreCloseToAll) {
  const std::string scene = index(furnishedRoom(40), "furnished.sft");
  BounceOptions options = optionsFor(3);
  options.surfels_per_receiver = 8;
  const std::vector<Surfel> interpolated = bounced(scene, options);
  EXPECT_LT(stats_.passes[0].receivers, stats_.surfels / 3);
  EXPECT_GE(stats_.passes[2].receivers, stats_.surfels);
  const std::vector<Surfel> all = bounced(scene, optionsFor(3));
  double square = 0, sum = 0;
  for (std::size_t i = 0; i < all.size(); ++i) {
    square += std::pow(double(interpolated[i].radiosity.g - all[i].radiosity.g), 2);
    sum += double(all[i].radiosity.g);
  }
  const double n = double(all.size()), relative = std::sqrt(square / n) / (sum / n);
  fmt::print("furnished room: interpolated against all, relative RMS {:.4f}\n", relative);
  EXPECT_LT(relative, .01);
}

// The same light, by the way through a cloud of receivers.
TEST_F(BounceTest, OneBounceIsAlbedoTimesWhatAGatherFinds) {
  std::vector<Surfel> cloud = furnishedRoom(40);
  std::erase_if(cloud, [](const Surfel& surfel) { return surfel.flags != 0; });
  const std::string scene = index(cloud, "room.sft", kEverything, true);
  const std::vector<Surfel> before = surfelsOf(scene), after = bounced(scene, optionsFor(1));
  Table receivers;
  for (const char* name : {"x", "y", "z", "nx", "ny", "nz"}) receivers.addProperty(name);
  for (const Surfel& surfel : before) {
    const glm::dvec3 p(surfel.position), n(surfel.normal);
    receivers.rows.push_back({p.x, p.y, p.z, n.x, n.y, n.z});
  }
  writeTable(receivers, directory_.file("receivers.ply"));
  GatherOptions options;
  options.mode = GatherMode::kBleeding;
  const auto stats = gatherCloud(scene, directory_.file("receivers.ply"),
                                 directory_.file("result.ply"), options, progress_);
  ASSERT_TRUE(stats.ok()) << stats.status().message();
  const std::vector<double> irradiance =
      readTable(directory_.file("result.ply")).column("irradiance_g");
  double square = 0, sum = 0;
  for (std::size_t i = 0; i < before.size(); ++i) {
    const double expected =
        double(before[i].radiosity.g) + double(before[i].albedo.g) * irradiance[i];
    square += std::pow(double(after[i].radiosity.g) - expected, 2);
    sum += expected;
  }
  const double n = double(before.size()), relative = std::sqrt(square / n) / (sum / n);
  fmt::print("one bounce against a gather: relative RMS {:.4f}\n", relative);
  EXPECT_LT(relative, .005);  // other packets
}

// Nothing outside the light's reach brightens: the outside of a convex body sees nothing of itself.
TEST_F(BounceTest, AConvexBodyReceivesNothing) {
  const std::string scene = index(shell(5000, kEmission, kAlbedo, 1), "ball.sft");
  for (const Surfel& surfel : bounced(scene, optionsFor(2))) {
    EXPECT_LT(glm::distance(surfel.radiosity, kEmission), .001f);
  }
}

// Around a two-sided disk and a sphere all is equally bright, so both receive what the shell sends;
// the disk only half of that when one half of the shell is dark.
TEST_F(BounceTest, TwoSidedDisksAndSpheresReceiveTheMeanOfAllSides) {
  for (const bool is_half_dark : {false, true}) {
    std::vector<Surfel> cloud = shell(20000, glm::vec3(1), glm::vec3(0));
    for (Surfel& surfel : cloud) {
      if (is_half_dark && surfel.position.z < 0) surfel.radiosity = glm::vec3(0);
    }
    Surfel small = surfelOf(glm::vec3(0), {0, 0, 1}, 1e-4f);
    small.albedo = glm::vec3(.5f);
    small.flags = kSurfelTwoSided;
    cloud.push_back(small);
    small.position = {.2f, 0, 0};
    small.flags = kSurfelSphere;
    small.normal = glm::vec3(0);
    cloud.push_back(small);
    const float expected = is_half_dark ? .25f : .5f;
    int found = 0;
    for (const Surfel& surfel : bounced(index(cloud, "kinds.sft"), optionsFor(1))) {
      if (surfel.flags == 0) continue;
      ++found;
      EXPECT_NEAR(surfel.radiosity.g, expected, .05f * expected)
          << is_half_dark << ' ' << surfel.flags;
    }
    EXPECT_EQ(found, 2);
  }
}

TEST_F(BounceTest, OnlyRadiosityChanges) {
  const std::string scene = index(furnishedRoom(), "room.sft");
  const std::vector<Surfel> before = surfelsOf(scene), after = bounced(scene, optionsFor(2));
  ASSERT_EQ(after.size(), before.size());
  std::size_t brighter = 0;
  for (std::size_t i = 0; i < before.size(); ++i) {
    Surfel kept = after[i];
    brighter += kept.radiosity.g > before[i].radiosity.g ? 1 : 0;
    kept.radiosity = before[i].radiosity;
    ASSERT_EQ(std::memcmp(&kept, &before[i], sizeof kept), 0) << i;
  }
  EXPECT_GT(brighter, before.size() * 9 / 10);
  EXPECT_EQ(findingsOf(directory_.file("bounced.sft")), std::vector<std::string>{});
  const Result<SceneInfo> was = readSceneInfo(scene),
                          is = readSceneInfo(directory_.file("bounced.sft"));
  ASSERT_TRUE(was.ok() && is.ok());
  EXPECT_EQ(is->nodes, was->nodes);
  EXPECT_EQ(is->level_pages, was->level_pages);
  EXPECT_NE(is->provenance.find("\"bounces\":2"), std::string::npos) << is->provenance;
  EXPECT_TRUE(directory_.holdsOnly({"room.sft", "bounced.sft"}));
}

// With every surfel as bright, at the least.
TEST_F(BounceTest, MoreBouncesAreBrighter) {
  const std::string scene = index(furnishedRoom(), "room.sft");
  std::vector<Surfel> before = surfelsOf(scene);
  double change = 1e9;
  for (int bounces = 1; bounces <= 4; ++bounces) {
    const std::vector<Surfel> after = bounced(scene, optionsFor(bounces));
    double sum = 0, area = 0;
    for (std::size_t i = 0; i < after.size(); ++i) {
      ASSERT_GE(after[i].radiosity.g, before[i].radiosity.g * .995f - 1e-3f) << bounces << ' ' << i;
      sum += double(after[i].area * after[i].radiosity.g);
      area += double(after[i].area);
    }
    ASSERT_EQ(stats_.passes.size(), std::size_t(bounces));
    const BouncePass& last = stats_.passes.back();
    EXPECT_NEAR(last.mean_radiosity.g, sum / area, 1e-3 * sum / area);
    EXPECT_LT(last.largest_change, change);
    EXPECT_GT(last.largest_change, 0);
    change = last.largest_change;
    before = after;
  }
}

// Bounces choose the receivers that they interpolate between.
TEST_F(BounceTest, MaxVariationDoesNotChangeTheBytes) {
  const std::string scene = index(furnishedRoom(), "room.sft");
  BounceOptions options = optionsFor(1);
  bounced(scene, options);
  const std::string expected = readBytes(directory_.file("bounced.sft"));
  ASSERT_FALSE(expected.empty());
  options.quality.max_variation = .5f;
  bounced(scene, options);
  EXPECT_TRUE(readBytes(directory_.file("bounced.sft")) == expected);
}

TEST_F(BounceTest, ThreadsAndBudgetDoNotChangeTheBytes) {
  const std::string scene = index(furnishedRoom(40), "room.sft");
  for (const int surfels_per_receiver : {1, 4}) {
    BounceOptions options = optionsFor(2, 1);
    options.surfels_per_receiver = surfels_per_receiver;
    options.quality.max_solid_angle = .3f;
    options.quality.raster_resolution = 4;
    bounced(scene, options);
    const std::string expected = readBytes(directory_.file("bounced.sft"));
    ASSERT_FALSE(expected.empty());
    for (const int threads : {2, 5}) {
      options.threads = threads;
      options.memory_bytes = 1;
      const Status refused = bounce(scene, "refused.sft", options).status();
      EXPECT_EQ(refused.code(), StatusCode::kBudgetTooSmall);
      EXPECT_FALSE(std::filesystem::exists(directory_.file("refused.sft")));
      const std::size_t end = refused.message().find(" MiB is the least that works");
      ASSERT_NE(end, std::string::npos) << refused.message();
      const std::string least = refused.message().substr(refused.message().rfind(' ', end - 1) + 1);
      options.memory_bytes = static_cast<std::uint64_t>(std::stod(least) * (1 << 20)) + 1;
      bounced(scene, options);
      EXPECT_TRUE(readBytes(directory_.file("bounced.sft")) == expected) << threads << " threads";
    }
  }
}

// Pages of later bounces have more colors than those of the scene: what may be too little for them
// is refused before any work. Budgets closer to each other than pages grow.
TEST_F(BounceTest, ABudgetThatIsAcceptedIsEnoughForLaterBounces) {
  const std::string scene = index(furnishedRoom(40), "room.sft");
  BounceOptions options = optionsFor(2, 8);
  options.quality.max_solid_angle = 1;
  options.quality.raster_resolution = 2;
  options.surfels_per_receiver = 16;
  options.memory_bytes = 1;
  const std::string refused = bounce(scene, "refused.sft", options).status().message();
  const std::size_t end = refused.find(" MiB is the least that works");
  ASSERT_NE(end, std::string::npos) << refused;
  const double least = std::stod(refused.substr(refused.rfind(' ', end - 1) + 1));
  options.memory_bytes = static_cast<std::uint64_t>(least * (1 << 20)) + 1;
  Result<BounceStats> result = bounce(scene, "bounced.sft", options);
  EXPECT_TRUE(result.ok()) << result.status().message();
  for (; result.ok(); result = bounce(scene, "bounced.sft", options)) options.memory_bytes -= 4096;
  EXPECT_EQ(result.status().code(), StatusCode::kBudgetTooSmall);
  EXPECT_NE(result.status().message().find(scene), std::string::npos) << result.status().message();
}

// So that bounces before the last, which are stored on the way, are as exact as the last.
TEST_F(BounceTest, TemporaryFilesGoWhereTheyAreWanted) {
  const std::string scene = index(furnishedRoom(), "room.sft");
  const std::string temporary = directory_.file("temporary");
  std::filesystem::create_directory(temporary);
  BounceOptions options = optionsFor(2);
  options.temporary_directory = temporary;
  EXPECT_FALSE(bounced(scene, options).empty());
  EXPECT_TRUE(std::filesystem::is_empty(temporary));
  EXPECT_GT(stats_.temporary_bytes, 12 * stats_.surfels);
  options.temporary_directory = directory_.file("nowhere");
  EXPECT_EQ(bounce(scene, "refused.sft", options).status().code(), StatusCode::kIoError);
  EXPECT_FALSE(std::filesystem::exists(directory_.file("refused.sft")));
}

TEST_F(BounceTest, ScenesWithoutAlbedoOrRadiosityAreRefused) {
  for (const bool has_albedo : {false, true}) {
    CloudChannels channels = kEverything;
    channels.albedo = has_albedo;
    channels.radiosity = !has_albedo;
    const std::string scene = index(room(10, kEmission, kAlbedo), "lacking.sft", channels);
    const Status refused = bounce(scene, "refused.sft", optionsFor(1)).status();
    EXPECT_EQ(refused.code(), StatusCode::kCorruption);
    EXPECT_NE(refused.message().find(has_albedo ? "no radiosity" : "no albedo"), std::string::npos)
        << refused.message();
  }
}

TEST_F(BounceTest, WhatCannotWorkIsRefusedBeforeAnyWork) {
  const std::string scene = index(room(10, kEmission, kAlbedo), "room.sft");
  const auto refused = [&](const BounceOptions& options, const std::string& result) {
    return bounceScene(scene, result, options, progress_).status().code();
  };
  const std::string result = directory_.file("refused.sft");
  for (const int bounces : {-1, 0, 101}) {
    EXPECT_EQ(refused(optionsFor(bounces), result), StatusCode::kInvalidArgument) << bounces;
  }
  BounceOptions options = optionsFor(1);
  options.surfels_per_receiver = 0;
  EXPECT_EQ(refused(options, result), StatusCode::kInvalidArgument);
  options = optionsFor(1);
  options.quality.raster_resolution = 13;
  EXPECT_EQ(refused(options, result), StatusCode::kInvalidArgument);
  EXPECT_EQ(refused(optionsFor(1), scene), StatusCode::kInvalidArgument);
  EXPECT_EQ(refused(optionsFor(1), directory_.file("no/such/place.sft")), StatusCode::kIoError);
  EXPECT_EQ(bounce(directory_.file("nowhere.sft"), "refused.sft", optionsFor(1)).status().code(),
            StatusCode::kIoError);
  EXPECT_TRUE(directory_.holdsOnly({"room.sft"}));
}

// Its bounces would be taken for direct light and counted again.
TEST_F(BounceTest, ABouncedSceneIsRefused) {
  const std::string scene = index(room(10, kEmission, kAlbedo), "room.sft");
  bounced(scene, optionsFor(1));
  const Status refused =
      bounce(directory_.file("bounced.sft"), "again.sft", optionsFor(1)).status();
  EXPECT_EQ(refused.code(), StatusCode::kInvalidArgument);
  EXPECT_NE(refused.message().find("bounces already"), std::string::npos) << refused.message();
}

class CancelledProgress : public Progress {
 public:
  explicit CancelledProgress(std::uint64_t at) : at_(at) {}
  void advance(std::uint64_t count) override { done_ += count; }
  bool isCancelled() const override { return done_ >= at_; }

 private:
  const std::uint64_t at_;
  std::atomic<std::uint64_t> done_{0};
};

TEST_F(BounceTest, InterruptedAnywhereItLeavesNothing) {
  const std::string scene = index(furnishedRoom(40), "room.sft");
  const std::uint64_t surfels = surfelsOf(scene).size();
  BounceOptions options = optionsFor(2);
  setQuality(QualityPreset::kDraft, options.quality);
  for (const double part : {0., .5, 1.2, 2.1, 3.1}) {
    CancelledProgress progress(static_cast<std::uint64_t>(part * double(surfels)));
    const Status status =
        bounceScene(scene, directory_.file("never.sft"), options, progress).status();
    EXPECT_EQ(status.code(), StatusCode::kInterrupted) << part;
    EXPECT_TRUE(directory_.holdsOnly({"room.sft"})) << part;
  }
}

}  // namespace
}  // namespace surfeit
