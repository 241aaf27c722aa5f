// What lets colors through differently: against the product of what panes let through in each
// color, and against scenes of one opacity, one scene per color.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <random>
#include <string>
#include <vector>

#include "gather/environment_pictures.h"
#include "gather/packet_clouds.h"
#include "gather/test_clouds.h"
#include "gather/test_scene.h"
#include "surfeit/bake.h"
#include "surfeit/bounce.h"
#include "surfeit/cube.h"
#include "surfeit/index_shards.h"
#include "surfeit/progress.h"
#include "surfeit/scene.h"

namespace surfeit {
namespace {

using Color = std::array<double, 3>;
constexpr const char* kTints[] = {"opacity_r", "opacity_g", "opacity_b"};
constexpr const char* kIrradiance[] = {"irradiance_r", "irradiance_g", "irradiance_b"};
constexpr const char* kEnvironment[] = {"environment_r", "environment_g", "environment_b"};
constexpr std::size_t kFirstTint = 8;  // column of opacity_r

Table emptyTinted() {
  Table table;
  for (const char* name : {"x", "y", "z", "nx", "ny", "nz", "radius", "area", "opacity_r",
                           "opacity_g", "opacity_b", "radiosity_r", "radiosity_g", "radiosity_b"}) {
    table.addProperty(name);
  }
  return table;
}

// A pane of side 100 at height z, that faces down, of side * side surfels.
void addPane(double z, const Color& opacity, double light, int side, Table& table) {
  const double step = 100.0 / side;
  for (int i = 0; i < side * side; ++i) {
    const double x = (i % side + 0.5) * step - 50, y = (i / side + 0.5) * step - 50;
    table.rows.push_back({x, y, z, 0, 0, -1, step * std::sqrt(0.5), step * step, opacity[0],
                          opacity[1], opacity[2], light, light, light});
  }
}

// Smoke, flakes and panes of changing tints, before and behind each other.
Table tintedThings() {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> both(-1, 1), unit(.05, 1);
  Table table = emptyTinted();
  for (int i = 0; i < 6000; ++i) {
    const bool is_drop = i % 3 == 0;
    glm::dvec3 n(both(random), both(random), both(random));
    n = is_drop ? glm::dvec3(0) : glm::normalize(n);
    const double size = is_drop ? .08 : .15;
    table.rows.push_back({2 * both(random), 2 * both(random), 3 + both(random), n.x, n.y, n.z, size,
                          3 * size * size, unit(random), unit(random) / 2, unit(random) / 4,
                          unit(random), unit(random), unit(random)});
  }
  addPane(1.2, {.1, .4, .2}, .5, 60, table);
  addPane(5, {1, 1, .7}, 2, 60, table);
  return table;
}

// The cloud with one opacity, that of a color.
Table ofColor(const Table& cloud, std::size_t color) {
  Table one;
  for (std::size_t i = 0; i < cloud.properties.size(); ++i) {
    if (i == kFirstTint) one.addProperty("opacity");
    if (i < kFirstTint || i > kFirstTint + 2) one.addProperty(cloud.properties[i].name);
  }
  for (std::vector<double> row : cloud.rows) {
    row[kFirstTint] = row[kFirstTint + color];
    row.erase(row.begin() + kFirstTint + 1, row.begin() + kFirstTint + 3);
    one.rows.push_back(row);
  }
  return one;
}

class Tint : public testing::Test {
 protected:
  struct Means {
    double occlusion = 0;
    Color irradiance{};
  };
  std::string file(const char* name) const { return directory_.file(name); }

  // A full-precision scene, so that what others share with it has no part in its numbers.
  void index(const Table& cloud, const std::string& scene) {
    writeTable(cloud, file("cloud.ply"));
    IndexOptions options;
    options.full_precision = true;
    const auto stats = indexClouds({file("cloud.ply")}, scene, options, progress_);
    ASSERT_TRUE(stats.ok()) << stats.status().message();
  }
  Table gatherTable(const Table& cloud, const GatherOptions& options) {
    index(cloud, file("scene.sft"));
    writeTable(receivers_, file("receivers.ply"));
    const auto stats = gatherCloud(file("scene.sft"), file("receivers.ply"), file("result.ply"),
                                   options, progress_);
    EXPECT_TRUE(stats.ok()) << stats.status().message();
    return readTable(file("result.ply"));
  }
  // Relative above 1.
  static void expectNear(const std::vector<double>& found, const std::vector<double>& expected,
                         double tolerance) {
    ASSERT_EQ(found.size(), expected.size());
    for (std::size_t i = 0; i < found.size(); ++i) {
      EXPECT_NEAR(found[i], expected[i], tolerance * std::max(1., std::abs(expected[i]))) << i;
    }
  }
  void expectColorsOfOneOpacity(const Table& cloud, float max_solid_angle, double tolerance) {
    GatherOptions options = bleeding(max_solid_angle);
    options.outputs = kOutputOcclusion | kOutputIrradiance | kOutputFluence | kOutputRadianceSh;
    const Table found = gatherTable(cloud, options);
    std::vector<double> occlusion(receivers_.rows.size());
    for (std::size_t c = 0; c < 3; ++c) {
      const Table one = gatherTable(ofColor(cloud, c), options);
      const std::string suffix = kTints[c] + 7;
      for (const std::string name : {"irradiance", "fluence", "sh0", "sh4", "sh8"}) {
        SCOPED_TRACE(testing::Message() << name << c << ", solid angle " << max_solid_angle);
        expectNear(found.column(name + suffix), one.column(name + suffix), tolerance);
      }
      for (std::size_t i = 0; i < occlusion.size(); ++i) {
        occlusion[i] += one.column("occlusion")[i] / 3;
      }
    }
    expectNear(found.column("occlusion"), occlusion, tolerance);
  }
  Means gather(const Table& cloud, const GatherOptions& options) {
    const Table result = gatherTable(cloud, options);
    const auto mean = [&](const char* name) {
      double sum = 0;
      for (const double value : result.column(name)) sum += value;
      return sum / double(result.rows.size());
    };
    return {mean("occlusion"), {mean(kIrradiance[0]), mean(kIrradiance[1]), mean(kIrradiance[2])}};
  }
  static GatherOptions bleeding(float max_solid_angle = 0.1f) {
    GatherOptions options;
    options.mode = GatherMode::kBleeding;
    options.threads = 1;
    options.quality.max_solid_angle = max_solid_angle;
    return options;
  }
  // On the ground below the middle of panes, facing up.
  static Table ground(int count) {
    Table table;
    for (const char* name : {"x", "y", "z", "nx", "ny", "nz"}) table.addProperty(name);
    std::mt19937 random(5);
    std::uniform_real_distribution<double> place(-1, 1);
    for (int i = 0; i < count; ++i) {
      table.rows.push_back({place(random), place(random), 0, 0, 0, 1});
    }
    return table;
  }

  TestDirectory directory_;
  Progress progress_;
  Table receivers_ = ground(24);
};

TEST_F(Tint, RedGlassLetsRedLightThrough) {
  Table cloud = emptyTinted();
  addPane(1, {.2, .8, .8}, 0, 200, cloud);
  addPane(2, {1, 1, 1}, 2, 200, cloud);
  for (const float max_solid_angle : {0.f, 0.1f}) {
    const Means found = gather(cloud, bleeding(max_solid_angle));
    EXPECT_GT(found.occlusion, .985);
    EXPECT_NEAR(found.irradiance[0], .8 * 2, .03) << max_solid_angle;
    EXPECT_NEAR(found.irradiance[1], .2 * 2, .02) << max_solid_angle;
    EXPECT_NEAR(found.irradiance[2], .2 * 2, .02) << max_solid_angle;
  }
}

TEST_F(Tint, PlatesBehindEachOtherMultiplyInEachColor) {
  const Color first = {.2, .8, .6}, second = {.7, 0, .3};
  Table cloud = emptyTinted();
  addPane(1, first, 1, 200, cloud);
  addPane(2.5, second, 2, 200, cloud);
  for (const float max_solid_angle : {0.f, 0.1f}) {
    const Means found = gather(cloud, bleeding(max_solid_angle));
    double covered = 0;
    for (std::size_t c = 0; c < 3; ++c) {
      const double open = (1 - first[c]) * (1 - second[c]);
      covered += (1 - open) / 3;
      // Towards the horizon nodes hold both, and know the mean of their opacities
      const double limit = max_solid_angle == 0 ? .015 : .045;
      EXPECT_NEAR(found.irradiance[c], first[c] + (1 - first[c]) * second[c] * 2, limit) << c;
    }
    EXPECT_NEAR(found.occlusion, covered, .01) << max_solid_angle;
  }
}

// The same scene built the long way: a scene for each color. Nodes keep apart what differs much in
// some color, so they are the same where nothing does.
TEST_F(Tint, EachColorIsThatOfASceneOfItsOpacity) {
  const Table things = tintedThings();
  Table alike = things;
  for (std::vector<double>& row : alike.rows) {
    for (std::size_t c = 0; c < 3; ++c) {
      double& opacity = row[kFirstTint + c];
      opacity = .85 - .3 * double(c) + .1 * opacity;
    }
  }
  for (const float max_solid_angle : {0.f, 0.03f}) {
    expectColorsOfOneOpacity(alike, max_solid_angle, 1e-6);
    expectColorsOfOneOpacity(things, max_solid_angle, max_solid_angle == 0 ? .002 : .03);
  }
}

TEST_F(Tint, EqualOpacitiesAreAsOne) {
  Table cloud = tintedThings();
  for (std::vector<double>& row : cloud.rows) {
    row[kFirstTint + 1] = row[kFirstTint + 2] = row[kFirstTint];
  }
  GatherOptions options = bleeding();
  options.outputs =
      kOutputOcclusion | kOutputIrradiance | kOutputBentNormal | kOutputIlluminationDirection;
  gatherTable(cloud, options);
  const std::string bytes = readBytes(file("result.ply"));
  gatherTable(ofColor(cloud, 0), options);
  EXPECT_EQ(readBytes(file("result.ply")), bytes);
}

// Behind a pane that stops red light, light is seen where the other colors come from.
TEST_F(Tint, DirectionsAreOfAllColors) {
  Table cloud = emptyTinted();
  const auto add = [&](double x, const Color& opacity, const Color& light) {
    for (int i = 0; i < 400; ++i) {
      const double y = (i % 20 - 9.5) / 10, z = 1 + (i / 20 - 9.5) / 10;
      cloud.rows.push_back({x, y, z, x < 0 ? 1. : -1., 0, 0, .08, .01, opacity[0], opacity[1],
                            opacity[2], light[0], light[1], light[2]});
    }
  };
  add(-2, {1, 1, 1}, {4, 0, 0});
  add(2, {1, 1, 1}, {0, 4, 0});
  GatherOptions options = bleeding();
  options.outputs = kOutputIlluminationDirection | kOutputBentNormal | kOutputIrradiance;
  receivers_.rows = {{0, 0, 0, 0, 0, 1}};
  const auto x = [&] { return gatherTable(cloud, options).column("illumination_direction_x")[0]; };
  const double open = x();
  EXPECT_GT(open, .1);  // green is brighter than red
  add(1, {0, 1, 0}, {0, 0, 0});
  EXPECT_LT(x(), -.3);  // nothing green is left
  const Table found = readTable(file("result.ply"));
  for (const std::string name : {"illumination_direction", "bent_normal"}) {
    double length = 0;
    for (const char* axis : {"_x", "_y", "_z"}) {
      length += std::pow(found.column(name + axis)[0], 2);
    }
    EXPECT_NEAR(length, 1, 1e-5) << name;
  }
}

// Smoke of drops in layers: each color has its own optical depth.
TEST_F(Tint, SmokeFollowsBeerAndLambertInEachColor) {
  constexpr int kDrops = 60000;
  constexpr double kDrop = .15;
  const Color depth = {.5, 1, 2};  // straight up through the layer
  Table cloud = emptyTinted();
  std::mt19937 random(1);
  std::uniform_real_distribution<double> both(-1, 1);
  const double drop_area = 3.14159265 * kDrop * kDrop, covered = kDrops * drop_area / (40 * 40);
  for (int i = 0; i < kDrops; ++i) {
    cloud.rows.push_back({20 * both(random), 20 * both(random), 1.5 + .5 * both(random), 0, 0, 0,
                          kDrop, drop_area, depth[0] / covered, depth[1] / covered,
                          depth[2] / covered, 0, 0, 0});
  }
  addPane(4, {1, 1, 1}, 1, 200, cloud);
  const Means found = gather(cloud, bleeding(0.03f));
  for (std::size_t c = 0; c < 3; ++c) {
    // Of cosine-weighted directions 2 E3(depth) pass
    double passed = 0;
    for (int i = 0; i < 100000; ++i) {
      passed += std::exp(-depth[c] / std::sqrt((i + .5) / 100000)) / 100000;
    }
    EXPECT_NEAR(found.irradiance[c], passed, .03) << c;
  }
}

// A square above the floor, facing down.
struct Square {
  glm::dvec3 middle;
  double half;
  Color opacity;
  double light;
};
const std::vector<Square>& filters() {
  static const std::vector<Square> filters = {{{-.5, .3, .5}, .9, {.9, .05, .05}, 0},
                                              {{.5, .3, .9}, .9, {.05, .9, .05}, 0},
                                              {{0, -.5, 1.3}, .9, {.05, .05, .9}, 0}};
  return filters;
}
Table surfelsOf(const std::vector<Square>& squares) {
  Table cloud = emptyTinted();
  for (const Square& square : squares) {
    constexpr int kSide = 150;
    const double step = 2 * square.half / kSide;
    for (int i = 0; i < kSide * kSide; ++i) {
      const double x = square.middle.x - square.half + (i % kSide + .5) * step;
      const double y = square.middle.y - square.half + (i / kSide + .5) * step;
      cloud.rows.push_back({x, y, square.middle.z, 0, 0, -1, step * std::sqrt(.5), step * step,
                            square.opacity[0], square.opacity[1], square.opacity[2], square.light,
                            square.light, square.light});
    }
  }
  return cloud;
}
bool meets(const Square& square, const glm::dvec3& from, const glm::dvec3& ray) {
  const glm::dvec3 offset = from + (square.middle.z - from.z) / ray.z * ray - square.middle;
  return std::max(std::abs(offset.x), std::abs(offset.y)) <= square.half;
}
// Calls visit(ray) for cosine-weighted directions of a floor.
template <typename Visit>
void forEachRay(int rays, const Visit& visit) {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> unit(0, 1);
  for (int i = 0; i < rays; ++i) {
    const double u = unit(random), phi = 6.283185307 * unit(random), s = std::sqrt(u);
    visit(glm::dvec3(s * std::cos(phi), s * std::sin(phi), std::sqrt(1 - u)));
  }
}
constexpr int kRays = 200000;

class Filters : public Tint {
 protected:
  Filters() {
    receivers_.rows.clear();
    for (const auto& [x, y] : {std::pair(-.5, .3), {.5, .3}, {0., -.5}, {.9, .3}, {0., 0.}}) {
      receivers_.rows.push_back({x, y, 0, 0, 0, 1});
    }
  }
  glm::dvec3 place(std::size_t i) const {
    return {receivers_.rows[i][0], receivers_.rows[i][1], receivers_.rows[i][2]};
  }
};

// Three filters above a floor, and a bright ceiling, against rays through squares.
TEST_F(Filters, LetThroughWhatRaysSay) {
  std::vector<Square> squares = filters();
  squares.push_back({{0, 0, 4}, 6, {1, 1, 1}, 2});
  const Table cloud = surfelsOf(squares);
  for (const float max_solid_angle : {0.f, .1f}) {
    const Table found = gatherTable(cloud, bleeding(max_solid_angle));
    for (std::size_t at = 0; at < receivers_.rows.size(); ++at) {
      Color light{};
      double covered = 0;
      forEachRay(kRays, [&](const glm::dvec3& ray) {
        Color open = {1, 1, 1};
        for (const Square& square : squares) {
          if (!meets(square, place(at), ray)) continue;
          for (std::size_t c = 0; c < 3; ++c) {
            light[c] += open[c] * square.opacity[c] * square.light / kRays;
            open[c] *= 1 - square.opacity[c];
          }
        }
        covered += (1 - (open[0] + open[1] + open[2]) / 3) / kRays;
      });
      EXPECT_NEAR(found.column("occlusion")[at], covered, .02) << at;
      for (std::size_t c = 0; c < 3; ++c) {
        EXPECT_NEAR(found.column(kIrradiance[c])[at], light[c], .06) << at << ' ' << c;
      }
    }
  }
}

// The same filters below a sky that differs from direction to direction and from color to color.
TEST_F(Filters, LetThroughTheSkyAsRaysSay) {
  const TestPicture sky(64, 32, [](int column, int) {
    const float turn = 6.2831853f * (float(column) + .5f) / 64;
    return glm::vec3(1 + std::sin(turn), 2, 1 - std::sin(turn));
  });
  writeExr(sky, file("sky.exr"));
  const Table cloud = surfelsOf(filters());
  for (const float max_solid_angle : {0.f, .1f}) {
    GatherOptions options = bleeding(max_solid_angle);
    options.outputs = kOutputEnvironment;
    options.environment.path = file("sky.exr");
    options.environment.up = UpAxis::kZ;
    const Table found = gatherTable(cloud, options);
    for (std::size_t at = 0; at < receivers_.rows.size(); ++at) {
      Color light{}, unfiltered{};
      forEachRay(kRays, [&](const glm::dvec3& ray) {
        const glm::vec3 radiance = sky.lookup(ray, 0);
        for (int c = 0; c < 3; ++c) {
          double open = 1;
          for (const Square& square : filters()) {
            if (meets(square, place(at), ray)) open *= 1 - square.opacity[std::size_t(c)];
          }
          light[std::size_t(c)] += 3.14159265 * open * double(radiance[c]) / kRays;
          unfiltered[std::size_t(c)] += 3.14159265 * double(radiance[c]) / kRays;
        }
      });
      for (std::size_t c = 0; c < 3; ++c) {
        EXPECT_NEAR(found.column(kEnvironment[c])[at], light[c], .02 * unfiltered[c])
            << at << ' ' << c << " at " << max_solid_angle;
        EXPECT_LT(light[c], .9 * unfiltered[c]);
      }
    }
  }
}

// Three times as much is drawn where a tint is in sight, and once elsewhere.
TEST_F(Tint, WhoSeesNoneIsGatheredOnce) {
  Cloud cloud;
  addGround(cloud, 40, 8);
  const std::size_t end = cloud.size();
  addSphere(cloud, 2000, {0, 0, 3}, 1);
  for (std::size_t i = end; i < cloud.size(); ++i) cloud[i].setOpacity(.2, 1, .6);
  TestScene scene(cloud);
  const GatherQuality quality;
  scene.gather({{2, 0, .01f}, {0, 0, 1}}, quality);
  EXPECT_EQ(scene.work().packets, 3u);
  // Below the ground, which hides nothing from there, facing down; and beside the scene
  scene.gather({{2, 0, -.5f}, {0, 0, -1}}, quality);
  EXPECT_EQ(scene.work().packets, 1u);
  scene.gather({{9, 0, 2}, {1, 0, 0}}, quality);
  EXPECT_EQ(scene.work().packets, 1u);
}

// The pixels that are shown sum up to the result.
TEST_F(Tint, CubesShowAllColors) {
  index(tintedThings(), file("scene.sft"));
  const auto cube = gatherCube(file("scene.sft"), {{.2, -.1, 0}, {0, 0, 1}}, bleeding(), progress_);
  ASSERT_TRUE(cube.ok()) << cube.status().message();
  double weights = 0, coverage = 0;
  glm::dvec3 light(0);
  for (const CubePixel& pixel : cube->pixels) {
    const double weight = double(pixel.weight) * double(pixel.solid_angle);
    weights += weight;
    coverage += weight * double(pixel.coverage);
    light += weight * glm::dvec3(pixel.light);
  }
  EXPECT_NEAR(coverage / weights, double(cube->occlusion), 1e-4);
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(light[c] / weights, double(cube->irradiance[c]), 1e-4) << c;
  }
  EXPECT_GT(std::abs(light.r - light.b), .1);
}

TEST_F(Tint, BouncesKeepIt) {
  Table cloud = tintedThings();
  for (const char* name : {"albedo_r", "albedo_g", "albedo_b"}) cloud.addProperty(name);
  for (auto& row : cloud.rows) row.insert(row.end(), 3, .5);
  index(cloud, file("in.sft"));
  BounceOptions options;
  options.threads = 1;
  const auto stats = bounceScene(file("in.sft"), file("out.sft"), options, progress_);
  ASSERT_TRUE(stats.ok()) << stats.status().message();
  for (const char* scene : {"in.sft", "out.sft"}) {
    const auto report = verifyScene(file(scene), 1, progress_);
    ASSERT_TRUE(report.ok()) << report.status().message();
    EXPECT_TRUE(report->findings.empty()) << scene << ": " << report->findings.front();
    const auto info = readSceneInfo(file(scene));
    ASSERT_TRUE(info.ok());
    EXPECT_TRUE(info->channels.tint) << scene;
  }
}

// What many machines index has the bytes of what one does.
TEST_F(Tint, ShardsOfAnIndexMergeToTheSameScene) {
  writeTable(tintedThings(), file("cloud.ply"));
  ASSERT_TRUE(indexClouds({file("cloud.ply")}, file("one.sft"), {}, progress_).ok());
  for (const IndexPass pass : {IndexPass::kCount, IndexPass::kDistribute, IndexPass::kBuild}) {
    for (int shard = 1; shard <= 2; ++shard) {
      const auto stats =
          indexShards({file("cloud.ply")}, file("two.sft"), {}, pass, {shard, shard, 2}, progress_);
      ASSERT_TRUE(stats.ok()) << stats.status().message();
    }
  }
  const auto merged =
      mergeIndexShards({file("cloud.ply")}, file("two.sft"), {}, 2, true, progress_);
  ASSERT_TRUE(merged.ok()) << merged.status().message();
  EXPECT_EQ(readBytes(file("two.sft")), readBytes(file("one.sft")));
}

TEST_F(Tint, WhatIsNoOpacityIsInvalid) {
  Table cloud = emptyTinted();
  addPane(1, {.3, .4, .5}, 1, 20, cloud);
  const Color wrong[] = {{0, 0, 0}, {.5, -.5, .5}, {.5, .5, 1.5}};
  for (std::size_t i = 0; i < 3; ++i) {
    std::copy(wrong[i].begin(), wrong[i].end(), cloud.rows[i].begin() + kFirstTint);
  }
  cloud.rows[3][kFirstTint] = 0;  // clear in one color is a tint
  writeTable(cloud, file("cloud.ply"));
  const auto stats = indexClouds({file("cloud.ply")}, file("scene.sft"), IndexOptions{}, progress_);
  ASSERT_TRUE(stats.ok()) << stats.status().message();
  EXPECT_EQ(stats->skipped_records, 3u);
}

}  // namespace
}  // namespace surfeit
