// What modes, weights and outputs give where the answer is known. Packets of equal receivers; that
// these are the scalar gather is tested elsewhere.
#include <fmt/format.h>

#include <glm/gtc/constants.hpp>

#include "gather/packet_clouds.h"

namespace surfeit {
namespace {

using Distribution = GatherWeights::Distribution;
using FalloffMode = GatherWeights::FalloffMode;

constexpr float kHalfPi = kPi / 2;

// What a closed shell of disks may leave open in its very middle, where it shows most (docs/
// benchmarks.md, "Errors and rates"), and in the mean over the places within.
constexpr float kShellGap = .025f, kMeanShellGap = .005f, kMeanShellGapAlone = .0055f;

// A sphere of disks that face its middle, or turn their backs on it, of radiosity `radiosity`.
Cloud shell(float radius, float facing, const glm::vec3& radiosity, int count = 20000) {
  Cloud cloud;
  addSphere(cloud, count, glm::vec3(0), radius);
  for (Surfel& surfel : cloud) {
    surfel.normal *= facing;
    surfel.radiosity = radiosity;
  }
  return cloud;
}

// A sphere around a point, seen from the origin within this angle.
Cloud distantSphere(const glm::vec3& centre, float angle, const glm::vec3& radiosity) {
  Cloud cloud;
  addSphere(cloud, 20000, centre, glm::length(centre) * std::sin(angle));
  for (Surfel& surfel : cloud) surfel.radiosity = radiosity;
  return cloud;
}

// A square of this side with its middle here, in the plane of unit axes u and v; faces u x v.
Cloud square(const glm::vec3& middle, const glm::vec3& u, const glm::vec3& v, float side,
             const glm::vec3& radiosity, int count = 300) {
  Cloud cloud;
  const float step = side / float(count);
  for (int i = 0; i < count * count; ++i) {
    Surfel surfel;
    surfel.position = middle + ((float(i % count) + .5f) * step - side / 2) * u +
                      ((float(i / count) + .5f) * step - side / 2) * v;
    surfel.normal = glm::cross(u, v);
    surfel.area = step * step;
    surfel.radius = .75f * step;
    surfel.radiosity = radiosity;
    cloud.push_back(surfel);
  }
  return cloud;
}

GatherRules rulesOf(GatherMode mode, std::uint32_t outputs = 0) {
  GatherRules rules(mode, {});
  if (outputs != 0) rules.outputs = outputs;
  return rules;
}

GatherResult gatherAt(TestScene& scene, const LocalReceiver& receiver, const GatherRules& rules) {
  PacketGatherer gatherer(rules);
  return gatherPacket(gatherer, scene, std::vector<LocalReceiver>(kPacketReceivers, receiver))[0];
}

constexpr LocalReceiver kUpwards = {{0, 0, 0}, {0, 0, 1}};
constexpr LocalReceiver kSpherical = {{0, 0, 0}, {0, 0, 0}};

// Part of the weight of a cone that a sphere in its middle covers.
TEST(GatherWeightsTest, SphereAboveCoversItsPartOfConeAndDistribution) {
  for (const float angle : {.2f, .5f}) {
    TestScene scene(distantSphere({0, 0, 5}, angle, glm::vec3(1)));
    const auto sineSq = [](float x) { return std::sin(x) * std::sin(x); };
    const auto cap = [](float x) { return 1 - std::cos(x); };
    for (const float cone : {.3f, .8f, 1.2f, kHalfPi}) {
      GatherRules rules = rulesOf(GatherMode::kOcclusion);
      rules.weights.cone_angle = cone;
      const float covered = std::min(angle, cone);
      EXPECT_NEAR(gatherAt(scene, kUpwards, rules).occlusion, sineSq(covered) / sineSq(cone),
                  .04f * sineSq(covered) / sineSq(cone) + .002f)
          << angle << " " << cone;
      rules.weights.distribution = Distribution::kUniform;
      EXPECT_NEAR(gatherAt(scene, kUpwards, rules).occlusion, cap(covered) / cap(cone),
                  .04f * cap(covered) / cap(cone) + .002f)
          << angle << " " << cone;
    }
  }
}

TEST(GatherWeightsTest, AClosedShellIsClosed) {
  TestScene scene(shell(2, -1, glm::vec3(1), 200000));
  PacketGatherer gatherer(rulesOf(GatherMode::kOcclusion));
  constexpr std::size_t kPackets = 32;
  double open = 0, open_alone = 0;  // gathered as packets, and one by one
  for (std::size_t packet = 0; packet < kPackets; ++packet) {
    std::vector<LocalReceiver> receivers;
    for (std::size_t i = 0; i < kPacketReceivers; ++i) {
      // Spread evenly within, looking anywhere
      const auto turn = static_cast<float>(packet * kPacketReceivers + i);
      const glm::vec3 place(std::cos(turn), std::sin(turn), std::cos(.7f * turn));
      const glm::vec3 normal(std::sin(2.1f * turn), std::cos(2.1f * turn), std::sin(1.3f * turn));
      const float radius =
          1.6f * std::cbrt((turn + .5f) / static_cast<float>(kPackets * kPacketReceivers));
      receivers.push_back({radius * glm::normalize(place), glm::normalize(normal)});
      open_alone += 1 - double(gatherPacket(gatherer, scene, {receivers.back()})[0].occlusion);
    }
    for (const GatherResult& result : gatherPacket(gatherer, scene, receivers)) {
      open += 1 - double(result.occlusion);
    }
  }
  open /= double(kPackets * kPacketReceivers);
  open_alone /= double(kPackets * kPacketReceivers);
  fmt::print("covered in packets {:.4f}, alone {:.4f}\n", 1 - open, 1 - open_alone);
  EXPECT_NEAR(open, 0, kMeanShellGap);
  EXPECT_NEAR(open_alone, 0, kMeanShellGapAlone);
}

TEST(GatherWeightsTest, OcclusionFadesWithDistance) {
  TestScene scene(shell(2, -1, glm::vec3(1)));
  GatherRules rules = rulesOf(GatherMode::kOcclusion);
  const float all = gatherAt(scene, kUpwards, rules).occlusion;
  EXPECT_NEAR(all, 1, kShellGap);
  rules.weights.falloff = .4f;
  EXPECT_NEAR(gatherAt(scene, kUpwards, rules).occlusion, all * std::exp(-.8f), .003f);
  rules.weights.falloff_mode = FalloffMode::kPolynomial;
  rules.quality.max_distance = 5;
  rules.weights.falloff = 2;
  EXPECT_NEAR(gatherAt(scene, kUpwards, rules).occlusion, all * .36f, .003f);
  rules.weights.cone_angle = .4f;
  EXPECT_NEAR(gatherAt(scene, kUpwards, rules).occlusion, .36f, .36f * kShellGap);
}

TEST(GatherWeightsTest, OnlyTheChosenSidesCover) {
  for (const float facing : {-1.f, 1.f}) {
    TestScene scene(shell(2, facing, glm::vec3(1)));
    GatherRules rules = rulesOf(GatherMode::kBleeding);
    rules.quality.sides = GatherSides::kFront;
    EXPECT_NEAR(gatherAt(scene, kUpwards, rules).occlusion, facing < 0 ? 1 : 0, kShellGap);
    rules.quality.sides = GatherSides::kBack;
    EXPECT_NEAR(gatherAt(scene, kUpwards, rules).occlusion, facing < 0 ? 0 : 1, kShellGap);
    EXPECT_EQ(gatherAt(scene, kUpwards, rules).irradiance, glm::vec3(0));
    rules.quality.sides = GatherSides::kBoth;
    EXPECT_NEAR(gatherAt(scene, kUpwards, rules).occlusion, 1, kShellGap);
  }
}

// The quarter of a sphere that a wall leaves open has its mean direction, by cosine, along
// (-2/3, 0, pi/3).
TEST(GatherOutputsTest, BentNormalLeansAwayFromAWall) {
  TestScene scene(square({.01f, 0, 0}, {0, 0, 1}, {0, 1, 0}, 40, glm::vec3(1), 600));
  const GatherRules rules = rulesOf(GatherMode::kOcclusion, kOutputOcclusion | kOutputBentNormal);
  const GatherResult result = gatherAt(scene, kUpwards, rules);
  EXPECT_NEAR(result.occlusion, .5f, .01f);
  const glm::vec3 expected = glm::normalize(glm::vec3(-2.f / 3, 0, kPi / 3));
  EXPECT_GT(glm::dot(result.bent_normal, expected), .9995f);
}

TEST(GatherOutputsTest, OpenSkyBendsNothingAndAClosedShellHasNoBentNormal) {
  TestScene far_away(distantSphere({0, 0, -5}, .1f, glm::vec3(1)));
  const GatherRules rules = rulesOf(GatherMode::kOcclusion, kOutputBentNormal);
  const glm::vec3 normal = glm::normalize(glm::vec3(1, 2, 3));
  EXPECT_GT(glm::dot(gatherAt(far_away, {{0, 0, 0}, normal}, rules).bent_normal, normal), .9999f);
}

TEST(GatherOutputsTest, IlluminationComesFromTheLight) {
  const glm::vec3 direction = glm::normalize(glm::vec3(2, -1, 3));
  TestScene scene(distantSphere(4.f * direction, .05f, {3, 2, 1}));
  const GatherRules rules =
      rulesOf(GatherMode::kBleeding, kOutputIlluminationDirection | kOutputIrradiance);
  const GatherResult result = gatherAt(scene, kUpwards, rules);
  EXPECT_GT(glm::dot(result.illumination_direction, direction), .9995f);
  // The form factor of a sphere: cosine * sine^2
  const float factor = direction.z * std::sin(.05f) * std::sin(.05f);
  EXPECT_NEAR(result.irradiance.r, 3 * factor, .05f * 3 * factor);
}

TEST(GatherOutputsTest, VolumesReceiveFluenceAndHarmonics) {
  const glm::vec3 radiosity = {1, 2, 4};
  TestScene scene(shell(2, -1, radiosity));
  const GatherRules rules =
      rulesOf(GatherMode::kBleeding, kOutputIrradiance | kOutputFluence | kOutputRadianceSh);
  const GatherResult result = gatherAt(scene, kSpherical, rules);
  for (int c = 0; c < 3; ++c) {
    // Radiance B / pi from everywhere
    EXPECT_NEAR(result.irradiance[c], radiosity[c], kShellGap * radiosity[c]);
    EXPECT_NEAR(result.fluence[c], 4 * radiosity[c], 4 * kShellGap * radiosity[c]);
    EXPECT_NEAR(result.radiance_sh[0][c], 4 * kPi * .282095f * radiosity[c],
                4 * kShellGap * radiosity[c]);
    for (std::size_t i = 1; i < kShCount; ++i) {
      EXPECT_NEAR(result.radiance_sh[i][c], 0, .03f * radiosity[c]) << i;
    }
  }
}

TEST(GatherOutputsTest, HarmonicsOfASmallLightAreThoseOfItsDirection) {
  const glm::vec3 direction = glm::normalize(glm::vec3(-1, 2, -3));
  TestScene scene(distantSphere(4.f * direction, .1f, glm::vec3(5)));
  const GatherRules rules = rulesOf(GatherMode::kBleeding, kOutputRadianceSh);
  const GatherResult result = gatherAt(scene, kSpherical, rules);
  const float power = 5 * 2 * kPi * (1 - std::cos(.1f));
  const ShCoefficients basis = shBasis(direction);
  for (std::size_t i = 0; i < kShCount; ++i) {
    EXPECT_NEAR(result.radiance_sh[i].g, power * basis[i], .04f * power) << i;
  }
}

// Irradiance below the middle of a rectangle that faces down: four times that of a corner. Its
// sides are 2 a and 2 b times its height.
float rectangleFactor(float a, float b) {
  const auto term = [](float x, float y) {
    const float root = std::sqrt(1 + x * x);
    return x / root * std::atan(y / root);
  };
  return 2 / kPi * (term(a, b) + term(b, a));
}

// memo 7.1: a light is surfels that send, of any shape and texture; what blocks it is black.
TEST(AreaLight, RectangleGivesItsAnalyticIrradianceAndHalfOfItBehindAScreen) {
  const Cloud light = square({0, 0, 2}, {1, 0, 0}, {0, -1, 0}, 3, {6, 3, 1});
  const float factor = rectangleFactor(.75f, .75f);
  const GatherRules rules = rulesOf(GatherMode::kBleeding);
  TestScene open(light);
  const GatherResult lit = gatherAt(open, kUpwards, rules);
  EXPECT_NEAR(lit.irradiance.r, 6 * factor, .015f * 6 * factor);
  EXPECT_NEAR(lit.irradiance.b, 1 * factor, .015f * factor);

  // A screen from x = 0 on, lower and larger
  Cloud half = light;
  const Cloud screen = square({2, 0, 1}, {1, 0, 0}, {0, -1, 0}, 4, glm::vec3(0));
  half.insert(half.end(), screen.begin(), screen.end());
  TestScene shaded(half);
  EXPECT_NEAR(gatherAt(shaded, kUpwards, rules).irradiance.r, 3 * factor, .04f * 3 * factor);
  // Far behind its edge the shadow is full
  EXPECT_LT(gatherAt(shaded, {{2.5f, 0, 0}, {0, 0, 1}}, rules).irradiance.r, .02f * 6 * factor);
}

// A penumbra on the floor below a blocker's straight edge: the visible part of the light is a
// rectangle again.
TEST(AreaLight, PenumbraFollowsTheVisiblePartOfTheLight) {
  Cloud cloud = square({0, 0, 2}, {1, 0, 0}, {0, -1, 0}, 1, glm::vec3(10));
  const Cloud screen = square({2, 0, 1}, {1, 0, 0}, {0, -1, 0}, 4, glm::vec3(0));
  cloud.insert(cloud.end(), screen.begin(), screen.end());
  TestScene scene(cloud);
  // Corner formula of the part of the light between x0 and x1, seen from x
  const auto corner = [](float a, float b) { return .25f * rectangleFactor(a, b); };
  for (const float x : {-.6f, -.3f, -.1f, .1f, .3f}) {
    // The edge x = 0 at height 1 hides what lies beyond -x at height 2
    const float end = std::clamp(-x, -.5f, .5f);
    const float expected = 10 * 2 * (corner((end - x) / 2, .25f) - corner((-.5f - x) / 2, .25f));
    const GatherRules rules = rulesOf(GatherMode::kBleeding);
    EXPECT_NEAR(gatherAt(scene, {{x, 0, 0}, {0, 0, 1}}, rules).irradiance.g, expected, .06f) << x;
  }
}

// A floor that mirrors a light: it is seen where the mirrored view meets it.
TEST(GatherGlossy, ReflectsWhatTheMirroredViewMeets) {
  Cloud cloud = square({3, 0, 4}, {1, 0, 0}, {0, -1, 0}, 1.7f, {7, 5, 3}, 300);
  TestScene scene(cloud);
  GatherRules rules = rulesOf(GatherMode::kGlossy);
  rules.weights.roughness = 1;
  for (const float cone : {.02f, .05f, .1f}) {
    rules.weights.cone_angle = cone;
    rules.eye = {-3, 0, 4};
    const GatherResult seen = gatherAt(scene, kUpwards, rules);
    EXPECT_NEAR(seen.occlusion, 1, .01f) << cone;
    EXPECT_NEAR(seen.irradiance.r, 7, .07f) << cone;
    EXPECT_NEAR(seen.irradiance.b, 3, .03f) << cone;
    rules.eye = {-3, 2, 4};
    const GatherResult missed = gatherAt(scene, kUpwards, rules);
    EXPECT_EQ(missed.occlusion, 0) << cone;
    // A view of its own goes before the camera's
    const LocalReceiver viewed = {{0, 0, 0}, {0, 0, 1}, glm::normalize(glm::vec3(3, 0, -4))};
    EXPECT_NEAR(gatherAt(scene, viewed, rules).irradiance.r, 7, .07f) << cone;
  }
}

// The light covers the half of the cone on one side of its edge.
TEST(GatherGlossy, NarrowConesResolveEdges) {
  TestScene scene(square({2.5f, 0, 4}, {1, 0, 0}, {0, -1, 0}, 5, glm::vec3(2), 1000));
  GatherRules rules = rulesOf(GatherMode::kGlossy);
  rules.weights.roughness = 1;
  rules.weights.cone_angle = .1f;
  rules.eye = {0, 0, 4};  // straight up, at the edge x = 0
  EXPECT_NEAR(gatherAt(scene, kUpwards, rules).occlusion, .5f, .02f);
}

// The lobe's own integral: cos^n over a cap of angle a holds 1 - cos(a)^(n + 1) of it.
TEST(GatherGlossy, LobesWeighDirectionsByTheirPower) {
  for (const float angle : {.05f, .1f, .2f}) {
    TestScene scene(distantSphere({0, 0, 5}, angle, glm::vec3(1)));
    GatherRules rules = rulesOf(GatherMode::kGlossy);
    rules.eye = {0, 0, 9};
    rules.weights = withConeAngle({.roughness = .15f}, GatherMode::kGlossy);
    const float n = lobeExponent(.15f);
    const float all = 1 - std::pow(std::cos(rules.weights.cone_angle), n + 1);
    const float part = (1 - std::pow(std::cos(angle), n + 1)) / all;
    EXPECT_NEAR(gatherAt(scene, kUpwards, rules).occlusion, part, .03f) << angle;
  }
}

// A wide lobe is drawn to the cube, one a little narrower to a raster of its own.
TEST(GatherGlossy, RastersAgreeWhereTheyMeet) {
  TestScene scene(mixedCloud());
  GatherRules rules = rulesOf(GatherMode::kGlossy);
  rules.eye = {3, -9, 4};
  rules.weights.roughness = 1;
  rules.quality.raster_resolution = 32;
  rules.quality.max_solid_angle = .02f;
  for (const glm::vec3 at : {glm::vec3(1, 0, 0), glm::vec3(-2, 1.5f, 0), glm::vec3(0, -2, 0)}) {
    rules.weights.cone_angle = kWidestConeRaster;
    const GatherResult cone = gatherAt(scene, {at, {0, 0, 1}}, rules);
    rules.weights.cone_angle = std::nextafter(kWidestConeRaster, 2.f);
    const GatherResult cube = gatherAt(scene, {at, {0, 0, 1}}, rules);
    EXPECT_NEAR(cone.occlusion, cube.occlusion, .02f);
    EXPECT_NEAR(cone.irradiance.g, cube.irradiance.g, .02f);
  }
}

}  // namespace
}  // namespace surfeit
