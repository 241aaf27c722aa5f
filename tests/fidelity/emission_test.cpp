// Lamps of surfels: what a gather finds of emissive surfaces, against shadow rays to the true
// triangles. Everything else is black.
#include <fmt/format.h>

#include <cmath>
#include <fstream>
#include <glm/geometric.hpp>
#include <string>
#include <vector>

#include "fidelity/fidelity_case.h"
#include "sample/ray_scene.h"

namespace surfeit {
namespace {

class SurfelLamp : public Fidelity {
 protected:
  // A picture of 4 x 4 texels, bright and dark.
  void writePicture() {
    std::ofstream file(path("lamp.ppm"), std::ios::binary);
    file << "P6 4 4 255\n";
    for (int i = 0; i < 16; ++i) {
      const bool is_bright = (i + i / 4) % 2 == 0;
      file << char(is_bright ? 255 : 80) << char(is_bright ? 220 : 60) << char(120);
    }
  }
  static void addSquare(std::string& obj, int& vertices, const glm::vec3& centre,
                        const glm::vec3& u, const glm::vec3& v) {
    const glm::vec3 corners[] = {centre - u - v, centre + u - v, centre + u + v, centre - u + v};
    for (const glm::vec3& c : corners) obj += fmt::format("v {} {} {}\n", c.x, c.y, c.z);
    obj += fmt::format("f {}/1 {}/2 {}/3 {}/4\n", vertices + 1, vertices + 2, vertices + 3,
                       vertices + 4);
    vertices += 4;
  }

  // A lamp of 1 by 1 two above a floor, perhaps with a plate of .5 by .5 halfway.
  std::string scene(bool has_plate) {
    writePicture();
    std::ofstream(path("s.mtl")) << "newmtl black\nKd 0 0 0\nnewmtl lamp\nKd 0 0 0\nKe 2 2 2\n"
                                    "map_Ke lamp.ppm\n";
    std::string obj = "mtllib s.mtl\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl lamp\n";
    int vertices = 0;
    addSquare(obj, vertices, {0, 2, 0}, {.5f, 0, 0}, {0, 0, .5f});
    obj += "usemtl black\n";
    if (has_plate) {  // two sides, a little apart
      addSquare(obj, vertices, {0, 1, 0}, {.25f, 0, 0}, {0, 0, .25f});
      addSquare(obj, vertices, {0, 1.01f, 0}, {0, 0, .25f}, {.25f, 0, 0});
    }
    std::ofstream(path("scene.obj")) << obj;
    std::string floor = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";
    vertices = 0;
    addSquare(floor, vertices, {0, 0, 0}, {0, 0, 1.5f}, {1.5f, 0, 0});
    std::ofstream(path("floor.obj")) << floor;
    return path("scene.obj");
  }

  // Relative RMSE of irradiance over the floor.
  double errorOf(bool has_plate, const GatherQuality& quality) {
    const std::string mesh = scene(has_plate);
    SampleOptions options;
    options.count = 800;
    EXPECT_TRUE(sampleMeshes({path("floor.obj")}, path("receivers.ply"), options, progress_).ok());
    options.count = 100'000;
    options.surroundings.lights.with_emission = true;
    EXPECT_TRUE(sampleMeshes({mesh}, path("cloud.ply"), options, progress_).ok());
    EXPECT_TRUE(indexClouds({path("cloud.ply")}, path("scene.sft"), {}, progress_).ok());
    GatherOptions gather;
    gather.mode = GatherMode::kBleeding;
    gather.quality = quality;
    EXPECT_TRUE(
        gatherCloud(path("scene.sft"), path("receivers.ply"), path("baked.ply"), gather, progress_)
            .ok());

    const auto reference = ReferenceScene::load({mesh}, {}, 2, progress_);
    EXPECT_TRUE(reference.ok());
    if (!reference.ok()) return 1;
    double square = 0, mean = 0, sum = 0;
    const std::vector<Baked> baked = readBaked();
    for (std::size_t i = 0; i < baked.size(); ++i) {
      SurfacePoint point;
      point.position = glm::vec3(glm::dvec3(baked[i].position) - reference->mesh().origin);
      point.normal = point.geometric_normal = baked[i].normal;
      const glm::vec3 truth = reference->light().irradiance(point, i, 2048);
      const double error = double(baked[i].irradiance.g) - double(truth.g);
      square += error * error;
      sum += error;
      mean += double(truth.g);
    }
    const double n = double(baked.size()), rmse = std::sqrt(square / n) / (mean / n);
    fmt::print(
        "lamp of surfels, {}, raster {}, {:.2g} sr: irradiance relative RMSE {:.4f} bias {:+.4f}\n",
        has_plate ? "with a plate" : "alone", quality.raster_resolution, quality.max_solid_angle,
        rmse, sum / mean);
    return rmse;
  }
};

GatherQuality qualityOf(QualityPreset preset) {
  GatherQuality quality;
  setQuality(preset, quality);
  return quality;
}

// Finer than final.
GatherQuality finest() {
  GatherQuality quality = qualityOf(QualityPreset::kFinal);
  quality.max_solid_angle = 0.01f;
  quality.raster_resolution = 64;
  return quality;
}

TEST_F(SurfelLamp, ATexturedLampLightsAsItsTrianglesDo) {
  EXPECT_LT(errorOf(false, qualityOf(QualityPreset::kStandard)), 0.04);
  EXPECT_LT(errorOf(false, qualityOf(QualityPreset::kFinal)), 0.02);
  EXPECT_LT(errorOf(false, finest()), 0.01);
}

TEST_F(SurfelLamp, SoftShadowsOfALampComeCloseToShadowRays) {
  EXPECT_LT(errorOf(true, qualityOf(QualityPreset::kStandard)), 0.05);
  EXPECT_LT(errorOf(true, qualityOf(QualityPreset::kFinal)), 0.025);
  EXPECT_LT(errorOf(true, finest()), 0.01);
}

}  // namespace
}  // namespace surfeit
