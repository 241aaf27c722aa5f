// Emission textures: map_Ke of MTL.
#include <gmock/gmock.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <string>

#include "sample/direct_light.h"
#include "sample/ray_scene.h"
#include "sample/scene_files.h"
#include "surfeit/sample.h"

namespace surfeit {
namespace {

using ::testing::HasSubstr;

class GlowTest : public SceneFiles {
 protected:
  // A lamp of 2 by 2 at y = 1 that looks down, with a picture of 2 x 1 texels: red left, dark
  // right.
  std::string lamp(const std::string& material) {
    write("lamp.ppm", std::string("P6 2 1 255\n\xff\0\0\x10\0\0", 17));
    write("lamp.mtl", "newmtl lamp\nKd 0 0 0\n" + material + "map_Ke lamp.ppm\n");
    return write("lamp.obj",
                 "mtllib lamp.mtl\nusemtl lamp\nv -1 1 -1\nv 1 1 -1\nv 1 1 1\nv -1 1 1\n"
                 "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3\nf 1/1 3/3 4/4\n");
  }
  Mesh load(const std::string& path) {
    Result<Mesh> mesh = loadMeshes({path}, glm::vec3(0.5f), notes_);
    EXPECT_TRUE(mesh.ok()) << mesh.status().message();
    return mesh.ok() ? std::move(*mesh) : Mesh();
  }

  RecordedNotes notes_;
};

TEST_F(GlowTest, ThePictureMultipliesKe) {
  const Mesh mesh = load(lamp("Ke 3 3 3\n"));
  ASSERT_EQ(mesh.triangle.size(), 2u);
  EXPECT_TRUE(notes_.notes.empty());
  // The middles of both texels, at u = 1/4 and 3/4 and v = 1/4
  const float dark = linearFromSrgb8(0x10);
  const SurfacePoint left = surfacePoint(mesh, 0, 0, 0.25f);
  EXPECT_NEAR(left.emission.r, 3 * std::numbers::pi, 1e-4);
  EXPECT_EQ(left.emission.g, 0);
  const SurfacePoint right = surfacePoint(mesh, 0, 0.5f, 0.25f);
  EXPECT_NEAR(right.emission.r, 3 * std::numbers::pi * double(dark), 1e-5);
}

TEST_F(GlowTest, WithoutKeThePictureIsTheRadiance) {
  const Mesh mesh = load(lamp(""));
  EXPECT_NEAR(surfacePoint(mesh, 0, 0, 0.25f).emission.r, std::numbers::pi, 1e-5);
  ASSERT_EQ(notes_.notes.size(), 1u);
  EXPECT_THAT(notes_.notes[0], HasSubstr("has map_Ke and no Ke"));
}

TEST_F(GlowTest, TheMeanIsThatOfManyPlaces) {
  const Mesh mesh = load(lamp("Ke 1 1 1\n"));
  for (std::uint32_t triangle = 0; triangle < 2; ++triangle) {
    constexpr int kSteps = 700;
    double sum = 0;
    int count = 0;
    for (int i = 0; i < kSteps; ++i) {
      for (int k = 0; k + i < kSteps; ++k, ++count) {
        const float u = (float(i) + 1.0f / 3) / kSteps, v = (float(k) + 1.0f / 3) / kSteps;
        sum += double(surfacePoint(mesh, triangle, u, v).emission.r);
      }
    }
    EXPECT_NEAR(double(meanEmission(mesh, triangle).r) / (sum / count), 1, 0.03);
  }
}

// Under each half of the lamp, against the sum over 400 by 400 pieces of it.
TEST_F(GlowTest, DirectLightIsThatOfThePicture) {
  const Mesh mesh = load(lamp("Ke 1 1 1\n"));
  const Result<RayScene> scene = RayScene::build(mesh, 1);
  ASSERT_TRUE(scene.ok());
  const DirectLight light(mesh, *scene, {});
  ASSERT_TRUE(light.hasLight());
  double least = 1e30, most = 0;
  for (const float x : {-1.0f, -0.3f, 0.4f, 1.0f}) {
    double expected = 0;
    constexpr int kParts = 400;
    for (int i = 0; i < kParts; ++i) {
      for (int k = 0; k < kParts; ++k) {
        const float u = (float(i) + 0.5f) / kParts, v = (float(k) + 0.5f) / kParts;
        const glm::vec3 towards(2 * u - 1 - x, 1, 2 * v - 1);
        const double square = double(glm::dot(towards, towards));
        const double radiance = double(mesh.textures[0].lookup({u, v}).r);
        expected += radiance / (square * square) * 4 / (kParts * kParts);
      }
    }
    SurfacePoint point;
    point.position = {x, 0, 0};
    point.normal = point.geometric_normal = {0, 1, 0};
    const double found = double(light.irradiance(point, 7, 16384).r);
    EXPECT_NEAR(found / expected, 1, 0.01) << x;
    least = std::min(least, found);
    most = std::max(most, found);
  }
  EXPECT_GT(most / least, 2);
}

TEST_F(GlowTest, PhotonsCarryThePowerOfThePicture) {
  lamp("Ke 1 1 1\n");
  write("lamp.mtl", read(path("lamp.mtl")) + "newmtl black\nKd 0 0 0\n");
  const std::string scene = write("scene.obj", read(path("lamp.obj")) +
                                                   "usemtl black\nv -99 0 99\nv 99 0 99\n"
                                                   "v 99 0 -99\nv -99 0 -99\nf 5 6 7 8\n");
  PhotonTracingOptions options;
  options.photons = 100'000;
  const auto stats = tracePhotons({scene}, path("photons.ply"), options, notes_);
  ASSERT_TRUE(stats.ok()) << stats.status().message();
  const Mesh mesh = load(path("lamp.obj"));
  const double power = 2 * double(meanEmission(mesh, 0).r + meanEmission(mesh, 1).r);
  EXPECT_NEAR(stats->emitted_power.r / power, 1, 1e-6);
  EXPECT_NEAR(stats->stored_power.r / power, 1, 0.01);  // the floor takes all
  EXPECT_EQ(stats->emitted_power.g, 0);
}

}  // namespace
}  // namespace surfeit
