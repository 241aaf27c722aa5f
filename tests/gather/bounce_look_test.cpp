// The look of bounce light against scenes that are built the long way, and against its formulas,
// which are written here once more.
#include "surfeit/bounce_look.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <limits>
#include <string>
#include <vector>

#include "gather/test_clouds.h"
#include "octree/indexed_surfels.h"
#include "surfeit/apply_look.h"
#include "surfeit/bake.h"
#include "surfeit/bounce.h"
#include "surfeit/scene.h"

namespace surfeit {
namespace {

double smoothFall(double x, double inner, double outer) {
  if (x <= inner) return 1;
  if (x >= outer) return 0;
  const double t = (x - inner) / (outer - inner);
  return 1 - 3 * t * t + 2 * t * t * t;
}

glm::dvec3 correctedInDoubles(const ColorCorrection& correction, const glm::dvec3& light) {
  const double grey = .2126 * light.r + .7152 * light.g + .0722 * light.b;
  glm::dvec3 result(0);
  for (int i = 0; i < 3; ++i) {
    const double value = grey + double(correction.saturation) * (light[i] - grey);
    result[i] = double(correction.gain) * double(correction.tint[i]) * std::max(0.0, value);
  }
  return result;
}

void expectClose(const glm::dvec3& found, const glm::dvec3& expected, const std::string& what) {
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(found[i], expected[i], 2e-5 * std::abs(expected[i]) + 1e-6) << what << " " << i;
  }
}

// A floor of group 0 and two walls, of groups 1 and 2, that face each other, at full precision.
// Panes with two sides and spheres of group 3 stand between them. All is far from the origin.
std::vector<Surfel> wallsOnFloor() {
  std::vector<Surfel> cloud;
  constexpr int kSide = 12;
  constexpr float kStep = 2.f / kSide;
  const auto add = [&](const glm::vec3& at, const glm::vec3& normal, std::uint8_t group,
                       const glm::vec3& albedo, const glm::vec3& radiosity) {
    Surfel surfel;
    surfel.position = at + glm::vec3(100, 50, 20);
    surfel.normal = normal;
    surfel.area = kStep * kStep;
    surfel.radius = .75f * kStep;
    surfel.group = group;
    surfel.albedo = albedo;
    surfel.radiosity = radiosity;
    cloud.push_back(surfel);
  };
  for (int i = 0; i < kSide * kSide; ++i) {
    const float a = (float(i % kSide) + .5f) * kStep - 1, b = (float(i / kSide) + .5f) * kStep - 1;
    add({a, b, 0}, {0, 0, 1}, 0, {.5f, .5f, .5f}, {0, 0, 0});
    add({-1, a, b + 1}, {1, 0, 0}, 1, {.8f, .2f, .1f}, {2, 1, .5f});
    add({1, a, b + 1}, {-1, 0, 0}, 2, {.1f, .6f, .7f}, {0, .2f, .8f});
  }
  for (int i = 0; i < 24; ++i) {
    add({-.6f + .05f * float(i), .3f, .8f}, {0, 0, 1}, 3, {.6f, .5f, .4f}, {0, 0, 0});
    cloud.back().flags = kSurfelTwoSided;
    if (i % 2 == 0) continue;
    cloud.back().flags = kSurfelSphere;
    cloud.back().normal = glm::vec3(0);
  }
  return cloud;
}

class BounceLookTest : public testing::Test {
 protected:
  std::string index(const std::vector<Surfel>& cloud, const std::string& name) {
    const std::string path = directory_.file(name);
    CloudChannels channels;
    channels.normal = channels.radius = channels.area = channels.radiosity = channels.albedo = true;
    channels.two_sided = channels.group = true;
    indexSurfels(cloud, path, channels, /* full_precision= */ true);
    origin_ = SceneFile::open(path)->header().origin;
    return path;
  }
  static BounceOptions optionsFor(int bounces) {
    BounceOptions options;
    options.bounces = bounces;
    options.threads = 2;
    options.memory_bytes = 256 << 20;
    return options;
  }
  std::vector<Surfel> bounced(const std::string& scene, const BounceOptions& options) {
    const auto stats = bounceScene(scene, directory_.file("bounced.sft"), options, progress_);
    EXPECT_TRUE(stats.ok()) << stats.status().message();
    return stats.ok() ? surfelsOf(directory_.file("bounced.sft")) : std::vector<Surfel>();
  }
  // Expects that two results are those of equal surfels and equal light.
  static void expectSameLight(const std::vector<Surfel>& found,
                              const std::vector<Surfel>& expected) {
    ASSERT_EQ(found.size(), expected.size());
    for (std::size_t i = 0; i < found.size(); ++i) {
      ASSERT_EQ(found[i].position, expected[i].position);
      expectClose(found[i].radiosity, expected[i].radiosity, "surfel");
    }
  }
  // Compares what a look reflects with what a formula makes of what is reflected without.
  using Formula = std::function<glm::dvec3(const Surfel&, const glm::dvec3& irradiance)>;
  void expectReflected(const BounceOptions& options, const Formula& formula) {
    const std::string scene = index(wallsOnFloor(), "scene.sft");
    const std::vector<Surfel> before = surfelsOf(scene), plain = bounced(scene, optionsFor(1)),
                              found = bounced(scene, options);
    ASSERT_EQ(found.size(), before.size());
    for (std::size_t i = 0; i < found.size(); ++i) {
      const glm::dvec3 added = glm::dvec3(plain[i].radiosity) - glm::dvec3(before[i].radiosity);
      const glm::dvec3 expected = glm::dvec3(before[i].radiosity) +
                                  formula(before[i], added / glm::dvec3(before[i].albedo));
      expectClose(found[i].radiosity, expected, "surfel");
    }
  }

  TestDirectory directory_;
  Progress progress_;
  glm::dvec3 origin_{0};
};

// The long way: another albedo gives the same light, over all bounces.
TEST_F(BounceLookTest, GroupGainAndTintAreThoseOfAnotherAlbedo) {
  BounceOptions options = optionsFor(3);
  options.group_corrections = {{1, {.gain = .5f}}, {2, {.gain = 1.5f, .tint = {1, .5f, .25f}}}};
  const std::string scene = index(wallsOnFloor(), "scene.sft");
  const std::vector<Surfel> found = bounced(scene, options), plain = bounced(scene, optionsFor(3));

  std::vector<Surfel> changed = wallsOnFloor();
  for (Surfel& surfel : changed) {
    if (surfel.group == 1) surfel.albedo *= .5f;
    if (surfel.group == 2) surfel.albedo *= 1.5f * glm::vec3(1, .5f, .25f);
  }
  const std::vector<Surfel> expected = bounced(index(changed, "changed.sft"), optionsFor(3));
  expectSameLight(found, expected);
  // And it is light that the change of the walls gives the floor, too
  double largest = 0;
  for (std::size_t i = 0; i < found.size(); ++i) {
    if (found[i].group != 0) continue;
    largest = std::max(largest, double(glm::distance(found[i].radiosity, plain[i].radiosity)));
  }
  EXPECT_GT(largest, .01);
}

TEST_F(BounceLookTest, OneGainForAllIsThatOfAnotherAlbedo) {
  BounceOptions options = optionsFor(2);
  options.look.correction = {.gain = 1.25f, .tint = {.5f, 1, .75f}};
  const std::vector<Surfel> found = bounced(index(wallsOnFloor(), "scene.sft"), options);
  std::vector<Surfel> changed = wallsOnFloor();
  for (Surfel& surfel : changed) surfel.albedo *= 1.25f * glm::vec3(.5f, 1, .75f);
  expectSameLight(found, bounced(index(changed, "changed.sft"), optionsFor(2)));
}

TEST_F(BounceLookTest, SaturationMovesColorsFromTheirLuminance) {
  BounceOptions options = optionsFor(1);
  const ColorCorrection all = {.gain = 1.5f, .saturation = .3f, .tint = {1, .9f, .8f}};
  const ColorCorrection walls = {.gain = .5f, .saturation = 4, .tint = {.7f, 1, 1}};
  options.look.correction = all;
  options.group_corrections = {{2, walls}};
  expectReflected(options, [&](const Surfel& surfel, const glm::dvec3& irradiance) {
    const glm::dvec3 reflected = glm::dvec3(surfel.albedo) * correctedInDoubles(all, irradiance);
    return surfel.group == 2 ? correctedInDoubles(walls, reflected) : reflected;
  });
}

TEST_F(BounceLookTest, GreyBounceLightHasNoColor) {
  BounceOptions options = optionsFor(1);
  options.look.correction.saturation = 0;
  expectReflected(options, [](const Surfel& surfel, const glm::dvec3& e) {
    return glm::dvec3(surfel.albedo) * (.2126 * e.r + .7152 * e.g + .0722 * e.b);
  });
}

TEST_F(BounceLookTest, FiltersFallWithDistanceAndAngle) {
  BounceOptions options = optionsFor(1);
  const ColorCorrection red = {.gain = 2, .tint = {1, .2f, .1f}}, dark = {.gain = .1f};
  const glm::dvec3 centre(100.4, 50.2, 20.3);
  BounceFilter near{.correction = red, .centre = centre, .inner_radius = .4f, .outer_radius = 1.3f};
  BounceFilter facing{
      .correction = dark, .direction = {2, 0, 1}, .inner_angle = .5f, .outer_angle = 1.6f};
  BounceFilter both = near;
  both.correction = {.saturation = 0};
  both.outer_radius = .9f;
  both.direction = {0, 0, 3};
  both.inner_angle = both.outer_angle = 1.f;  // a sharp edge
  options.look.filters = {near, facing, both};
  int touched = 0, between = 0;
  expectReflected(options, [&](const Surfel& surfel, glm::dvec3 light) {
    const double distance = glm::distance(glm::dvec3(surfel.position) + origin_, centre);
    const auto angleTo = [](const glm::dvec3& normal, const glm::dvec3& direction) {
      return std::acos(glm::dot(normal, direction) / glm::length(direction));
    };
    const auto angleWeight = [&](const BounceFilter& filter) {
      if (surfel.isSphere()) return 0.0;
      const glm::dvec3 normal(surfel.normal), to(filter.direction);
      const double inner = double(filter.inner_angle), outer = double(filter.outer_angle);
      const double front = smoothFall(angleTo(normal, to), inner, outer);
      const double back = smoothFall(angleTo(-normal, to), inner, outer);
      return surfel.isTwoSided() ? (front + back) / 2 : front;
    };
    const double weights[] = {smoothFall(distance, double(.4f), double(1.3f)), angleWeight(facing),
                              smoothFall(distance, double(.4f), double(.9f)) * angleWeight(both)};
    const ColorCorrection corrections[] = {red, dark, both.correction};
    for (int i = 0; i < 3; ++i) {
      touched += weights[i] > 0;
      between += weights[i] > 0 && weights[i] < 1;
      light = (1 - weights[i]) * light + weights[i] * correctedInDoubles(corrections[i], light);
    }
    return glm::dvec3(surfel.albedo) * light;
  });
  EXPECT_GT(touched, 200);
  EXPECT_GT(between, 100);
}

TEST_F(BounceLookTest, AGatherHasTheLookAtItsReceivers) {
  const std::string scene = directory_.file("room.sft"), receivers = directory_.file("r.ply");
  makeScene(floorAndSphere(30), scene);
  writeTable(receiversOf(2000), receivers);
  GatherOptions options;
  options.mode = GatherMode::kBleeding;
  options.threads = 2;
  options.memory_bytes = 256 << 20;
  options.outputs = kOutputOcclusion | kOutputIrradiance | kOutputFluence;
  const auto gather = [&] {
    const auto stats =
        gatherCloud(scene, receivers, directory_.file("result.ply"), options, progress_);
    EXPECT_TRUE(stats.ok()) << stats.status().message();
    return readTable(directory_.file("result.ply"));
  };
  const Table plain = gather();
  const ColorCorrection all = {.gain = .8f, .saturation = 1.7f, .tint = {1, 1, .5f}};
  const ColorCorrection lamp = {.gain = 3, .tint = {1, .8f, .3f}};
  options.look.correction = all;
  options.look.filters.push_back({.correction = lamp,
                                  .centre = {0, 0, .5},
                                  .inner_radius = .5f,
                                  .outer_radius = 2,
                                  .direction = {0, 0, 1},
                                  .inner_angle = .2f,
                                  .outer_angle = 2.5f});
  const Table found = gather();
  EXPECT_EQ(found.column("occlusion"), plain.column("occlusion"));
  EXPECT_EQ(found.column("fluence_g"), plain.column("fluence_g"));
  const auto light = [](const Table& table, std::size_t i) {
    return glm::dvec3(table.column("irradiance_r")[i], table.column("irradiance_g")[i],
                      table.column("irradiance_b")[i]);
  };
  for (std::size_t i = 0; i < plain.rows.size(); i += 40) {
    const std::vector<double>& row = plain.rows[i];
    const double weight =
        smoothFall(glm::distance(glm::dvec3(row[0], row[1], row[2]), glm::dvec3(0, 0, .5)), .5, 2) *
        smoothFall(std::acos(std::clamp(row[5], -1.0, 1.0)), double(.2f), 2.5);
    const glm::dvec3 corrected = correctedInDoubles(all, light(plain, i));
    const glm::dvec3 expected =
        (1 - weight) * corrected + weight * correctedInDoubles(lamp, corrected);
    for (int c = 0; c < 3; ++c) {
      EXPECT_NEAR(light(found, i)[c], expected[c], 2e-3 * std::abs(expected[c]) + 1e-5) << i;
    }
  }

  // And a program gives it to what it has gathered itself, with the same bits
  std::vector<Receiver> places;
  std::vector<glm::vec3> applied;
  for (std::size_t i = 0; i < plain.rows.size(); ++i) {
    const std::vector<double>& row = plain.rows[i];
    places.push_back({{row[0], row[1], row[2]}, glm::vec3(row[3], row[4], row[5])});
    applied.push_back(glm::vec3(light(plain, i)));
  }
  const glm::dvec3 origin = readSceneInfo(scene)->origin;
  ASSERT_TRUE(applyLook(options.look, origin, places.data(), places.size(), applied.data()).ok());
  for (std::size_t i = 0; i < places.size(); ++i) {
    EXPECT_EQ(applied[i], glm::vec3(light(found, i))) << i;
  }
  options.look.filters[0].outer_radius = .1f;
  EXPECT_EQ(applyLook(options.look, origin, nullptr, 0, nullptr).code(),
            StatusCode::kInvalidArgument);
}

TEST_F(BounceLookTest, ValuesOutOfRangeAreNamed) {
  const std::string scene = index(wallsOnFloor(), "scene.sft");
  const auto refusal = [&](const std::function<void(BounceOptions&)>& change) {
    BounceOptions options = optionsFor(1);
    change(options);
    const Status status =
        bounceScene(scene, directory_.file("none.sft"), options, progress_).status();
    EXPECT_EQ(status.code(), StatusCode::kInvalidArgument) << status.message();
    EXPECT_FALSE(std::filesystem::exists(directory_.file("none.sft")));
    return status.message();
  };
  const auto says = [](const std::string& message, const char* text) {
    EXPECT_NE(message.find(text), std::string::npos) << message;
  };
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  says(refusal([](auto& options) { options.look.correction.gain = -1; }), "gain is -1");
  says(refusal([](auto& options) { options.look.correction.saturation = kNan; }), "saturation");
  says(refusal([](auto& options) {
         options.look.filters.resize(2);
         options.look.filters[1].inner_radius = 2;
         options.look.filters[1].outer_radius = 1;
       }),
       "filter 2");
  says(refusal([](auto& options) {
         options.look.filters.resize(1);
         options.look.filters[0].outer_angle = 4;
       }),
       "0 to pi");
  says(refusal([](auto& options) { options.group_corrections = {{64, {}}}; }), "0 to 63");
  says(refusal([](auto& options) { options.group_corrections = {{1, {}}, {1, {}}}; }), "two");
  says(refusal([](auto& options) { options.group_corrections = {{9, {}}}; }), "found groups 0-3");
}

}  // namespace
}  // namespace surfeit
