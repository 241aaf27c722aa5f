#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <glm/geometric.hpp>
#include <limits>
#include <string>
#include <vector>

#include "batch/gather_options.h"
#include "gather/environment_pictures.h"
#include "gather/test_clouds.h"
#include "gather/test_scene.h"
#include "surfeit/cube.h"

namespace surfeit {
namespace {

constexpr float kNowhere = std::numeric_limits<float>::infinity();
const Receiver kFloor = {{0, 0, 0}, {0, 0, 2}, {0, 0, 0}};

Surfel cubeSurfel(const glm::vec3& position, const glm::vec3& normal, float area) {
  Surfel surfel;
  surfel.position = position;
  surfel.normal = normal;
  surfel.area = area;
  surfel.radius = std::sqrt(2 * area / kPi);
  surfel.radiosity = {3, 2, 1};
  return surfel;
}

// Outward, evenly.
void addCubeSphere(std::vector<Surfel>& cloud, int count, const glm::vec3& centre, float radius) {
  const float area = 4 * kPi * radius * radius / float(count);
  for (int i = 0; i < count; ++i) {
    const float z = 1 - float(2 * i + 1) / float(count), phi = float(i) * 2.39996323f;
    const float rho = std::sqrt(1 - z * z);
    const glm::vec3 outward(rho * std::cos(phi), rho * std::sin(phi), z);
    cloud.push_back(cubeSurfel(centre + radius * outward, outward, area));
  }
}

// A square of the plane z = height around the z axis, which faces down.
void addCeiling(std::vector<Surfel>& cloud, int side, float height, float half) {
  const float step = 2 * half / float(side);
  for (int i = 0; i < side * side; ++i) {
    const glm::vec3 place(float(i % side) + .5f, float(i / side) + .5f, 0);
    cloud.push_back(
        cubeSurfel(step * place + glm::vec3(-half, -half, height), {0, 0, -1}, step * step));
  }
}

std::vector<Surfel> sphereAndCeiling() {
  std::vector<Surfel> cloud;
  addCubeSphere(cloud, 20000, {.5f, .2f, 1.5f}, .6f);
  addCeiling(cloud, 100, 4, 6);
  return cloud;
}

CubeImage cubeOf(const TestScene& scene, const Receiver& receiver, const GatherOptions& options) {
  Progress progress;
  Result<CubeImage> cube = gatherCube(scene.path(), receiver, options, progress);
  EXPECT_TRUE(cube.ok()) << cube.status().message();
  return cube.ok() ? std::move(*cube) : CubeImage{};
}

StatusCode refusalOf(const std::string& path, const Receiver& receiver,
                     const GatherOptions& options) {
  Progress progress;
  return gatherCube(path, receiver, options, progress).status().code();
}

// The gather of the same receiver alone is the integral of the pixels, exactly.
void expectIntegratesToTheGather(TestScene& scene, const Receiver& given,
                                 const GatherOptions& options) {
  Progress progress;
  const auto environment = loadEnvironment(options, kDefaultUpAxis, progress);
  ASSERT_TRUE(environment.ok()) << environment.status().message();
  const GatherRules rules = gatherRules(withDefaults(options), environment->get());
  const CubeImage cube = cubeOf(scene, given, options);
  const LocalReceiver receiver = {glm::vec3(cube.receiver.position), cube.receiver.normal,
                                  cube.receiver.view};
  const GatherResult gathered = scene.gather(receiver, rules);
  EXPECT_EQ(cube.occlusion, gathered.occlusion);
  EXPECT_EQ(cube.irradiance, gathered.irradiance);
  EXPECT_EQ(cube.environment, gathered.environment);
  EXPECT_EQ(cube.contributions, scene.work().patches);
  EXPECT_LE(cube.traced_surfels, cube.contributions);

  double weight_sum = 0, occlusion = 0;
  glm::dvec3 light(0), open_light(0);
  for (const CubePixel& pixel : cube.pixels) {
    const double weight = double(pixel.weight) * double(pixel.solid_angle);
    weight_sum += weight;
    occlusion += weight * double(pixel.occlusion);
    light += weight * glm::dvec3(pixel.light);
    open_light += weight * glm::dvec3(pixel.environment);
  }
  EXPECT_NEAR(occlusion / weight_sum, gathered.occlusion, 2e-6);
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(light[i] / weight_sum, gathered.irradiance[i], 1e-5);
    EXPECT_NEAR(open_light[i] / weight_sum, gathered.environment[i], 1e-4);
  }
}

TEST(GatherCube, PixelsIntegrateToTheGather) {
  TestScene scene(sphereAndCeiling());
  const std::vector<Receiver> receivers = {
      kFloor, {{1, -2, .5f}, {.3f, -.2f, .7f}}, {{-.4f, .1f, 3}, {0, 0, 0}}};
  for (const Receiver& receiver : receivers) {
    for (const float max_solid_angle : {0.f, .1f, .4f}) {
      GatherOptions options;
      options.mode = GatherMode::kBleeding;
      options.quality.max_solid_angle = max_solid_angle;
      expectIntegratesToTheGather(scene, receiver, options);
    }
  }
  GatherOptions options;
  options.mode = GatherMode::kBleeding;
  options.weights.falloff = .3f;
  options.weights.distribution = GatherWeights::Distribution::kUniform;
  options.quality.sides = GatherSides::kBoth;
  options.quality.raster_resolution = 10;
  expectIntegratesToTheGather(scene, receivers[1], options);
}

TEST(GatherCube, ConesAndReflectionsIntegrateToTheGather) {
  TestScene scene(sphereAndCeiling());
  GatherOptions options;
  options.mode = GatherMode::kBleeding;
  for (const float angle : {.3f, 1.3f}) {
    options.weights.cone_angle = angle;
    expectIntegratesToTheGather(scene, {{0, 0, 0}, {.2f, .1f, 1}}, options);
  }
  options = {};
  options.mode = GatherMode::kGlossy;
  options.weights.roughness = .4f;
  options.eye = {-3, 0, 2};
  expectIntegratesToTheGather(scene, kFloor, options);
  options.eye = glm::vec3(std::numeric_limits<float>::quiet_NaN());
  expectIntegratesToTheGather(scene, {{0, 0, 0}, {0, 0, 1}, {.6f, 0, -.8f}}, options);
}

TEST(GatherCube, EnvironmentComesThroughWhatIsOpen) {
  TestScene scene(sphereAndCeiling());
  TestDirectory directory;
  GatherOptions options;
  options.environment.path = directory.file("sky.exr");
  options.outputs = kOutputOcclusion | kOutputIrradiance | kOutputEnvironment;
  writeExr(TestPicture(32, 16, [](int column, int) { return glm::vec3(float(column), 1, 2); }),
           options.environment.path);
  expectIntegratesToTheGather(scene, kFloor, options);
  const CubeImage cube = cubeOf(scene, kFloor, options);
  for (const CubePixel& pixel : cube.pixels) {
    EXPECT_NEAR(pixel.environment.z, 2 * kPi * (1 - pixel.coverage), 1e-3);
  }
}

TEST(GatherCube, PixelsLieAroundTheDirectionsOfTheirFaces) {
  TestScene scene(sphereAndCeiling());
  for (const float angle : {0.f, .5f}) {
    GatherOptions options;
    options.weights.cone_angle = angle;
    const CubeImage cube = cubeOf(scene, {{0, 0, 0}, {1, 2, 3}}, options);
    const int n = cube.resolution;
    ASSERT_EQ(n, options.quality.raster_resolution);
    ASSERT_EQ(cube.faces.size(), angle > 0 ? 1u : 6u);
    ASSERT_EQ(cube.pixels.size(), cube.faces.size() * std::size_t(n * n));
    EXPECT_NEAR(glm::length(cube.receiver.normal), 1, 1e-6);
    double solid_angle = 0;
    for (std::size_t i = 0; i < cube.pixels.size(); ++i) {
      const CubeFace& face = cube.faces[i / std::size_t(n * n)];
      const float a = float(2 * (int(i) % n) + 1) / float(n) - 1;
      const float b = float(2 * (int(i) / n % n) + 1) / float(n) - 1;
      const glm::vec3 expected = glm::normalize(face.forward + a * face.u + b * face.v);
      EXPECT_GT(glm::dot(expected, cube.pixels[i].direction), 1 - 1e-5f) << i;
      solid_angle += double(cube.pixels[i].solid_angle);
    }
    if (angle == 0) {
      EXPECT_NEAR(solid_angle, 4 * double(kPi), 1e-4);
    }
  }
}

TEST(GatherCube, SphereAboveIsSeenWhereItIs) {
  const glm::vec3 centre(.4f, .3f, 2);
  const float radius = .8f, distance = glm::length(centre);
  std::vector<Surfel> cloud;
  addCubeSphere(cloud, 40000, centre, radius);
  TestScene scene(cloud);
  GatherOptions options;
  options.mode = GatherMode::kBleeding;
  options.quality.max_solid_angle = .01f;
  const CubeImage cube = cubeOf(scene, kFloor, options);
  const float rim = std::asin(radius / distance), pixel_angle = 2.f / float(cube.resolution);
  int inside = 0, outside = 0;
  for (const CubePixel& pixel : cube.pixels) {
    const float cosine = glm::dot(pixel.direction, centre) / distance;
    const float angle = std::acos(std::clamp(cosine, -1.f, 1.f));
    if (angle < rim - pixel_angle) {
      // Where the ray meets the sphere
      const float along = cosine * distance;
      const float depth = along - std::sqrt(radius * radius - distance * distance + along * along);
      EXPECT_GT(pixel.coverage, .97f);
      EXPECT_NEAR(pixel.depth, depth, .12f);
      EXPECT_NEAR(pixel.light.x, 3 * pixel.coverage, 1e-4f);
      EXPECT_NE(pixel.kind, CubeKind::kNothing);
      EXPECT_GE(pixel.layers, 1);
      ++inside;
    } else if (angle > rim + pixel_angle) {
      EXPECT_EQ(pixel.coverage, 0);
      EXPECT_EQ(pixel.depth, kNowhere);
      EXPECT_EQ(pixel.layers, 0);
      EXPECT_EQ(pixel.kind, CubeKind::kNothing);
      ++outside;
    }
    EXPECT_EQ(pixel.weight > 0, pixel.direction.z > 0);
  }
  EXPECT_GT(inside, 15);
  EXPECT_GT(outside, 1000);
}

TEST(GatherCube, CeilingIsOneLayerAsFarAsItIs) {
  std::vector<Surfel> cloud;
  addCeiling(cloud, 200, 1, 8);
  TestScene scene(cloud);
  const CubeImage cube = cubeOf(scene, kFloor, {});
  float layers = 0;
  int pixels = 0;
  for (const CubePixel& pixel : cube.pixels) {
    if (pixel.direction.z < .5f) continue;
    EXPECT_NEAR(pixel.coverage, 1, .1f);
    EXPECT_NEAR(pixel.depth * pixel.direction.z, 1, .25f);
    EXPECT_TRUE(pixel.kind == CubeKind::kFlatNode || pixel.kind == CubeKind::kPatch);
    layers += pixel.layers;
    ++pixels;
  }
  EXPECT_NEAR(layers / float(pixels), 1, .1f);
}

TEST(GatherCube, OutlineBeforeACeilingIsTwoLayers) {
  TestScene scene(sphereAndCeiling());
  const CubeImage cube = cubeOf(scene, kFloor, {});
  const auto most =
      std::max_element(cube.pixels.begin(), cube.pixels.end(),
                       [](const CubePixel& a, const CubePixel& b) { return a.layers < b.layers; });
  EXPECT_GE(most->layers, 1.5f);
}

TEST(GatherCube, KindsTellHowThingsWereDrawn) {
  std::vector<Surfel> cloud;
  addCubeSphere(cloud, 5000, {0, 0, 2}, .5f);
  TestScene scene(cloud);
  const auto kindsOf = [&](const GatherQuality& quality) {
    GatherOptions options;
    options.quality = quality;
    std::vector<std::size_t> counts(kCubeKinds);
    for (const CubePixel& pixel : cubeOf(scene, kFloor, options).pixels) {
      ++counts[std::size_t(pixel.kind)];
    }
    return counts;
  };
  GatherQuality quality;
  quality.max_solid_angle = 0;
  quality.near_field_radii = 0;
  const std::vector<std::size_t> patches = kindsOf(quality);
  EXPECT_EQ(patches[std::size_t(CubeKind::kNothing)] + patches[std::size_t(CubeKind::kPatch)],
            std::size_t(6 * 16 * 16));
  EXPECT_GT(patches[std::size_t(CubeKind::kPatch)], 10u);

  quality.near_field_radii = 1e4f;
  const std::vector<std::size_t> traced = kindsOf(quality);
  EXPECT_EQ(traced[std::size_t(CubeKind::kNothing)] + traced[std::size_t(CubeKind::kTraced)],
            std::size_t(6 * 16 * 16));
  EXPECT_GT(traced[std::size_t(CubeKind::kTraced)], 10u);

  // One rough node: a whole sphere
  quality = {};
  quality.max_solid_angle = 6;
  quality.raster_resolution = 2;  // or the pixels would ask for smaller ones
  const std::vector<std::size_t> rough = kindsOf(quality);
  EXPECT_EQ(rough[std::size_t(CubeKind::kNothing)] + rough[std::size_t(CubeKind::kRoughNode)],
            std::size_t(6 * 2 * 2));
}

TEST(GatherCube, WhatCannotWorkIsRefused) {
  TestScene scene(sphereAndCeiling());
  const float nan = std::numeric_limits<float>::quiet_NaN();
  GatherOptions options;
  EXPECT_EQ(refusalOf(scene.path(), {{nan, 0, 0}, {0, 0, 1}}, options),
            StatusCode::kInvalidArgument);
  EXPECT_EQ(refusalOf(scene.path(), {{0, 0, 0}, {0, kNowhere, 1}}, options),
            StatusCode::kInvalidArgument);
  EXPECT_EQ(refusalOf(scene.path() + "x", kFloor, options), StatusCode::kIoError);
  options.quality.raster_resolution = 7;
  EXPECT_EQ(refusalOf(scene.path(), kFloor, options), StatusCode::kInvalidArgument);
  options = {};
  options.memory_bytes = 1 << 20;
  EXPECT_EQ(refusalOf(scene.path(), kFloor, options), StatusCode::kBudgetTooSmall);
  options = {};
  options.mode = GatherMode::kGlossy;
  EXPECT_EQ(refusalOf(scene.path(), kFloor, options), StatusCode::kInvalidArgument);
  options.eye = {1, 0, 1};
  EXPECT_EQ(refusalOf(scene.path(), kFloor, options), StatusCode::kOk);
  EXPECT_EQ(refusalOf(scene.path(), {}, options), StatusCode::kInvalidArgument);
}

TEST(GatherCube, SmallBudgetsGiveTheSamePixels) {
  TestScene scene(sphereAndCeiling());
  GatherOptions options;
  options.mode = GatherMode::kBleeding;
  const CubeImage all = cubeOf(scene, kFloor, options);
  options.memory_bytes = 16 << 20;
  const CubeImage small = cubeOf(scene, kFloor, options);
  ASSERT_EQ(all.pixels.size(), small.pixels.size());
  for (std::size_t i = 0; i < all.pixels.size(); ++i) {
    EXPECT_EQ(all.pixels[i].coverage, small.pixels[i].coverage);
    EXPECT_EQ(all.pixels[i].light, small.pixels[i].light);
    EXPECT_EQ(all.pixels[i].depth, small.pixels[i].depth);
  }
}

TEST(ReadCubeReceiver, FindsTheRowOrTellsWhatIsWrong) {
  TestDirectory directory;
  Progress progress;
  const std::string path = directory.file("receivers.ply");
  std::ofstream file(path);
  file << "ply\nformat ascii 1.0\nelement vertex 5000\nproperty float x\nproperty float y\n"
          "property float z\nproperty float nx\nproperty float ny\nproperty float nz\nend_header\n";
  for (int i = 0; i < 5000; ++i) file << i << (i == 7 ? " nan" : " 2") << " 3 0 1 0\n";
  file.close();
  for (const std::uint64_t number : {0u, 6u, 4999u}) {
    const auto receiver = readCubeReceiver(path, number, "", "", progress);
    ASSERT_TRUE(receiver.ok()) << receiver.status().message();
    EXPECT_EQ(receiver->position, glm::dvec3(double(number), 2, 3));
    EXPECT_EQ(receiver->normal, glm::vec3(0, 1, 0));
  }
  const auto codeOf = [&](const std::string& name, std::uint64_t number) {
    return readCubeReceiver(name, number, "", "", progress).status().code();
  };
  EXPECT_EQ(codeOf(path, 7), StatusCode::kCorruption);
  EXPECT_EQ(codeOf(path, 5000), StatusCode::kInvalidArgument);
  EXPECT_EQ(codeOf(path + "x", 0), StatusCode::kIoError);
}

}  // namespace
}  // namespace surfeit
