// Results interpolated between receivers are held to results gathered at every one of them.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <glm/geometric.hpp>
#include <limits>
#include <numeric>
#include <random>
#include <string>
#include <vector>

#include "batch/gather_input.h"
#include "batch/gather_memory.h"
#include "gather/packet/group_gatherer.h"
#include "gather/packet/packet_fit.h"
#include "gather/rules/gather_outputs.h"
#include "gather/rules/interpolation_limits.h"
#include "gather/test_clouds.h"
#include "octree/read/scene_file.h"
#include "surfeit/bake.h"

namespace surfeit {
namespace {

constexpr float kVariation = 0.02f;

// Jittered points on a patch of a sphere that touches the origin, one unit wide.
std::vector<FitPoint> pointsOnSphere(int side, float radius) {
  std::mt19937 random(7);
  std::uniform_real_distribution<float> jitter(0, 1);
  std::vector<FitPoint> points;
  for (int i = 0; i < side * side; ++i) {
    const float x = (float(i % side) + jitter(random)) / float(side) - 0.5f;
    const float y = (float(i / side) + jitter(random)) / float(side) - 0.5f;
    const glm::vec3 normal = glm::vec3(x, y, std::sqrt(radius * radius - x * x - y * y)) / radius;
    points.push_back({(normal - glm::vec3(0, 0, 1)) * radius, normal});
  }
  return points;
}

// Fits a function to all points about the origin.
template <typename Function>
PacketFit fitTo(const std::vector<FitPoint>& points, const Function& function) {
  PacketFit fit;
  fit.begin({{0, 0, 0}, {0, 0, 1}}, 1, 1);
  for (const FitPoint& point : points) {
    const float value = function(point);
    fit.add(point, 0.5f, &value);
  }
  EXPECT_TRUE(fit.solve());
  return fit;
}

float valueOf(const PacketFit& fit, const FitPoint& point) {
  float value = 0;
  fit.value(point, &value);
  return value;
}

TEST(PacketFit, IsExactForWhatIsOfSecondOrderInThePosition) {
  const std::vector<FitPoint> points = pointsOnSphere(12, 1e4f);
  const auto function = [](const FitPoint& point) {
    const glm::vec3 p = point.position;
    return 0.3f + 2 * p.x - p.y + p.x * p.y - 3 * p.y * p.y;
  };
  const PacketFit fit = fitTo(points, function);
  for (const FitPoint& point : points) {
    EXPECT_NEAR(valueOf(fit, point), function(point), 3e-3f);
  }
}

TEST(PacketFit, IsExactForWhatIsLinearInTheAxis) {
  const std::vector<FitPoint> points = pointsOnSphere(12, 2);
  const auto function = [](const FitPoint& point) { return point.axis.x - 2 * point.axis.z; };
  const PacketFit fit = fitTo(points, function);
  for (const FitPoint& point : points) {
    EXPECT_NEAR(valueOf(fit, point), function(point), 3e-3f);
  }
}

TEST(PacketFit, LeverageTellsWhatLiesOutsideAboveOrFacesElsewhere) {
  const std::vector<FitPoint> points = pointsOnSphere(12, 1e4f);
  const PacketFit fit = fitTo(points, [](const FitPoint&) { return 1.f; });
  const FitPoint middle = {{0.1f, -0.1f, 0}, {0, 0, 1}};
  FitPoint outside = middle, above = middle, bent = middle;
  outside.position.x += 2;
  above.position.z += 0.2f;
  bent.axis = glm::normalize(glm::vec3(0.2f, 0, 1));
  EXPECT_LT(fit.leverage(middle), 10);
  for (const FitPoint& point : {outside, above, bent}) {
    EXPECT_GT(fit.leverage(point), kInterpolation.most_leverage);
  }
}

// A floor, a wall, and a ball that lies on the floor: soft and contact shadows, and a corner.
Table roomCloud(int side) {
  Table table = floorAndSphere(side);
  std::vector<std::vector<double>> wall;
  for (std::vector<double>& row : table.rows) {
    if (row[5] == 1 && row[2] == 0) {
      std::vector<double> turned = row;
      std::swap(turned[0], turned[2]);
      turned[0] = -2, turned[2] += 2, turned[3] = 1, turned[5] = 0;
      wall.push_back(turned);
    } else {
      row[2] -= 0.2;  // the ball comes down
    }
  }
  table.rows.insert(table.rows.end(), wall.begin(), wall.end());
  return table;
}

// Receivers on floor, ball and wall.
Table roomReceivers(int count) {
  Table table = receiversOf(count);
  std::size_t i = 0;
  for (std::vector<double>& row : table.rows) {
    if (row[5] != 1 || row[2] != 0) row[2] -= 0.2;
    if (row[5] == 1 && ++i % 2 == 0) {
      row[2] = row[0] + 2, row[0] = -2, row[3] = 1, row[5] = 0;
    }
  }
  return table;
}

class Interpolation : public testing::Test {
 protected:
  struct Gathered {
    Table table;
    std::string bytes;
    GatherStats stats;
  };

  void make(const Table& cloud, const Table& receivers) {
    makeScene(cloud, scene_);
    writeTable(receivers, receivers_);
    options_.threads = 2;
    options_.memory_bytes = std::uint64_t{1} << 30;
    options_.mode = GatherMode::kBleeding;
  }

  Gathered gather(float max_variation) {
    options_.quality.max_variation = max_variation;
    Progress progress;
    const Result<GatherStats> stats = gatherCloud(scene_, receivers_, result_, options_, progress);
    EXPECT_TRUE(stats.ok()) << stats.status().message();
    return {readTable(result_), readBytes(result_), stats.ok() ? *stats : GatherStats{}};
  }

  static double interpolatedPart(const Gathered& gathered) {
    return double(gathered.stats.interpolated_receivers) / double(gathered.stats.receivers);
  }

  TestDirectory directory_;
  const std::string scene_ = directory_.file("s.sft"), receivers_ = directory_.file("r.ply"),
                    result_ = directory_.file("result.ply");
  GatherOptions options_;
};

struct Errors {
  double rms = 0, within = 0, most = 0;
};

Errors errorsOf(std::vector<double> errors, double bound, const char* name) {
  Errors found;
  for (const double error : errors) {
    found.rms += error * error / double(errors.size());
    found.within += error <= bound ? 1 / double(errors.size()) : 0;
    found.most = std::max(found.most, error);
  }
  found.rms = std::sqrt(found.rms);
  std::printf("%s: RMS %.4f, within %.4f: %.3f %%, most %.4f\n", name, found.rms, bound,
              100 * found.within, found.most);
  return found;
}

Errors occlusionErrors(const Table& exact, const Table& found) {
  std::vector<double> a = exact.column("occlusion"), b = found.column("occlusion");
  for (std::size_t i = 0; i < a.size(); ++i) a[i] = std::abs(a[i] - b[i]);
  return errorsOf(a, double(kVariation), "occlusion");
}

// Of the brightest color, relative to the receiver or, where it is dark, to the mean.
Errors lightErrors(const Table& exact, const Table& found, const std::string& name) {
  std::vector<double> errors, brightest;
  for (const char* color : {"_r", "_g", "_b"}) {
    const std::vector<double> a = exact.column(name + color), b = found.column(name + color);
    errors.resize(a.size());
    brightest.resize(a.size());
    for (std::size_t i = 0; i < a.size(); ++i) {
      errors[i] = std::max(errors[i], std::abs(a[i] - b[i]));
      brightest[i] = std::max(brightest[i], a[i]);
    }
  }
  const double mean =
      std::accumulate(brightest.begin(), brightest.end(), 0.0) / double(brightest.size());
  for (std::size_t i = 0; i < errors.size(); ++i) errors[i] /= std::max(mean, brightest[i]);
  return errorsOf(errors, double(kVariation), name.c_str());
}

TEST_F(Interpolation, SmoothLightStaysWithinTheVariation) {
  make(floorAndSphere(150), receiversOf(40000));
  const Gathered exact = gather(0), found = gather(kVariation);
  EXPECT_EQ(exact.stats.interpolated_receivers, 0u);
  std::printf("interpolated: %.1f %%\n", 100 * interpolatedPart(found));
  EXPECT_GT(interpolatedPart(found), 0.1);
  const Errors occlusion = occlusionErrors(exact.table, found.table);
  EXPECT_GT(occlusion.within, 0.999);
  EXPECT_LT(occlusion.rms, double(kVariation) / 3);
  const Errors light = lightErrors(exact.table, found.table, "irradiance");
  EXPECT_GT(light.within, 0.99);
  EXPECT_LT(light.rms, double(kVariation) / 2);
}

// On a floor, where nothing needs more samples, at most N x N receivers have a packet of samples.
TEST_F(Interpolation, SamplesLieAsCloseAsPixelsAreAllowedTo) {
  Table receivers = receiversOf(0);
  constexpr int kSide = 96;
  for (int i = 0; i < kSide * kSide; ++i) {
    receivers.rows.push_back({.02 * (i % kSide) - 1, .02 * (i / kSide) - 1, 0, 0, 0, 1, double(i)});
  }
  Table cloud = floorAndSphere(40);
  for (std::vector<double>& row : cloud.rows) {
    row[2] += row[2] > 0 ? 20 : 0;  // a sphere that is far away
  }
  make(cloud, receivers);
  double before = 1;
  for (const int pixels : {4, 6, 8, 12, 16, 23}) {
    options_.quality.max_pixel_distance = pixels;
    const Gathered found = gather(kVariation);
    const double gathered = 1 - interpolatedPart(found);
    std::printf("%d pixels: %.4f gathered\n", pixels, gathered);
    EXPECT_GE(gathered, .9 * 16 / (pixels * pixels));
    if (pixels == 4) {
      EXPECT_EQ(gathered, 1);
    }
    EXPECT_LE(gathered, before);
    before = gathered;
  }
  EXPECT_LT(before, .2);
  options_.quality.max_pixel_distance = 0;
  EXPECT_EQ(1 - interpolatedPart(gather(kVariation)), before);
  for (const int wrong : {-1, 3}) {
    options_.quality.max_pixel_distance = wrong;
    Progress progress;
    const Status status = gatherCloud(scene_, receivers_, result_, options_, progress).status();
    EXPECT_NE(status.message().find("max pixel distance"), std::string::npos);
  }
}

TEST_F(Interpolation, ContactShadowsAndCornersAreSubdivided) {
  make(roomCloud(150), roomReceivers(40000));
  const Gathered exact = gather(0), found = gather(kVariation);
  std::printf("interpolated: %.1f %%\n", 100 * interpolatedPart(found));
  const Errors occlusion = occlusionErrors(exact.table, found.table);
  EXPECT_GT(occlusion.within, 0.995);
  EXPECT_LT(occlusion.rms, double(kVariation) / 3);

  // A finer knob gathers more; the error falls
  const Gathered finer = gather(kVariation / 4);
  EXPECT_LT(finer.stats.interpolated_receivers, found.stats.interpolated_receivers);
  EXPECT_LE(occlusionErrors(exact.table, finer.table).rms, occlusion.rms);
}

TEST_F(Interpolation, WhereNothingAgreesTheBytesAreThoseOfTheGather) {
  make(floorAndSphere(60), receiversOf(3000));
  const Gathered exact = gather(0);
  const Gathered found = gather(1e-6f);
  EXPECT_EQ(found.stats.interpolated_receivers, 0u);
  EXPECT_EQ(found.bytes, exact.bytes);
}

TEST_F(Interpolation, SparseReceiversAreGathered) {
  make(roomCloud(150), roomReceivers(300));
  const Gathered exact = gather(0), found = gather(kVariation);
  EXPECT_LT(interpolatedPart(found), 0.02);
  EXPECT_GT(occlusionErrors(exact.table, found.table).within, 0.99);
}

TEST_F(Interpolation, ThreadsAndMemoryDoNotChangeResults) {
  make(roomCloud(60), roomReceivers(20000));
  const Gathered found = gather(kVariation);
  EXPECT_GT(found.stats.interpolated_receivers, 0u);
  for (const int threads : {1, 3}) {
    options_.threads = threads;
    EXPECT_EQ(gather(kVariation).bytes, found.bytes) << threads;
  }
  const Result<SceneFile> scene = SceneFile::open(scene_);
  const Result<GatherInput> input = GatherInput::open(receivers_);
  ASSERT_TRUE(scene.ok() && input.ok());
  options_.threads = 1;
  const std::uint64_t with = leastGatherMemory(*scene, gatherWork(input->receivers(), options_));
  options_.memory_bytes = with;
  EXPECT_EQ(gather(kVariation).bytes, found.bytes);

  // What it holds beside is charged
  options_.quality.max_variation = 0;
  const std::uint64_t without = leastGatherMemory(*scene, gatherWork(input->receivers(), options_));
  EXPECT_GE(with - without, kGroupReceivers * (sizeof(LocalReceiver) + sizeof(GatherResult)));
}

TEST_F(Interpolation, ReceiversWithoutNormalsAreInterpolatedInSpace) {
  Table receivers;
  for (const char* name : {"x", "y", "z"}) receivers.addProperty(name);
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (int i = 0; i < 16000; ++i) {
    receivers.rows.push_back(
        {0.7 * uniform(random), 0.7 * uniform(random), 2.7 + 0.2 * uniform(random)});
  }
  make(floorAndSphere(60), receivers);
  options_.outputs = kOutputOcclusion | kOutputFluence;
  const Gathered exact = gather(0), found = gather(2 * kVariation);
  std::printf("interpolated: %.1f %%\n", 100 * interpolatedPart(found));
  EXPECT_GT(interpolatedPart(found), 0.2);
  EXPECT_GT(occlusionErrors(exact.table, found.table).within, 0.999);
  EXPECT_LT(lightErrors(exact.table, found.table, "fluence").rms, double(kVariation));
}

TEST_F(Interpolation, DirectionsStayUnitVectors) {
  make(floorAndSphere(60), receiversOf(16000));
  options_.outputs = kAllOutputs & ~std::uint32_t{kOutputEnvironment};
  const Gathered exact = gather(0), found = gather(5 * kVariation);
  std::printf("interpolated: %.1f %%\n", 100 * interpolatedPart(found));
  EXPECT_GT(found.stats.interpolated_receivers, 0u);
  for (const std::string name : {"bent_normal", "illumination_direction"}) {
    double worst = 0, sum_sq = 0;
    std::vector<double> length_sq(found.table.rows.size()), distance_sq(length_sq.size());
    for (const char* axis : {"_x", "_y", "_z"}) {
      const std::vector<double> a = exact.table.column(name + axis),
                                b = found.table.column(name + axis);
      for (std::size_t i = 0; i < a.size(); ++i) {
        length_sq[i] += b[i] * b[i];
        distance_sq[i] += (a[i] - b[i]) * (a[i] - b[i]);
      }
    }
    for (std::size_t i = 0; i < length_sq.size(); ++i) {
      if (length_sq[i] > 0) worst = std::max(worst, std::abs(length_sq[i] - 1));
      sum_sq += distance_sq[i];
    }
    EXPECT_LT(worst, 1e-4) << name;
    const double rms = std::sqrt(sum_sq / double(length_sq.size()));
    std::printf("%s: RMS %.4f\n", name.c_str(), rms);
    EXPECT_LT(rms, 2 * 5 * double(kVariation) / 2) << name;
  }
}

TEST_F(Interpolation, ARefusedVariationIsNamed) {
  make(floorAndSphere(10), receiversOf(10));
  for (const float wrong : {-0.1f, std::numeric_limits<float>::quiet_NaN()}) {
    options_.quality.max_variation = wrong;
    Progress progress;
    const auto stats = gatherCloud(scene_, receivers_, result_, options_, progress);
    ASSERT_FALSE(stats.ok());
    EXPECT_NE(stats.status().message().find("max variation"), std::string::npos);
  }
}

}  // namespace
}  // namespace surfeit
