#include "sample/reference.h"

#include <cmath>
#include <glm/geometric.hpp>

#include "core/spherical_harmonics.h"
#include "sample/scene_files.h"

namespace surfeit {
namespace {

class Reference : public SceneFiles {
 protected:
  ReferenceScene load(const std::string& file, const Surroundings& surroundings = {}) {
    Result<ReferenceScene> scene = ReferenceScene::load({file}, surroundings, 1, notes_);
    EXPECT_TRUE(scene.ok()) << scene.status().message();
    return std::move(*scene);
  }
  RecordedNotes notes_;
};

const glm::vec3 kUp(0, 1, 0);

TEST_F(Reference, OpenSkyIsUnoccluded) {
  const ReferenceScene scene = load(write("floor.ply", floorPly(4)));
  const ReferenceGather gather = scene.gather({0.3f, 0, 0.1f}, kUp, 1, {});
  EXPECT_EQ(gather.occlusion_front, 0);
  EXPECT_EQ(gather.occlusion_both, 0);
  EXPECT_EQ(scene.occlusion({0.3f, 0, 0.1f}, kUp, 1, {}), 0);
}

TEST_F(Reference, InsideAClosedShellTheIrradianceEqualsTheRadiosity) {
  // Inward walls of exitance pi Ke = pi that reflect nothing
  write("m.mtl", "newmtl a\nKd 0 0 0\nKe 1 1 1\n");
  std::string obj = "mtllib m.mtl\nusemtl a\n";
  for (int i = 0; i < 8; ++i) obj += fmt::format("v {} {} {}\n", i & 1, (i >> 1) & 1, i >> 2);
  obj += "f 2 4 3 1\nf 7 8 6 5\nf 5 6 2 1\nf 4 8 7 3\nf 3 7 5 1\nf 6 8 4 2\n";
  Surroundings surroundings;
  surroundings.lights.with_emission = true;
  const ReferenceScene scene = load(write("m.obj", obj), surroundings);
  const glm::vec3 normal = glm::normalize(glm::vec3(1, 2, -3));
  const ReferenceGather gather = scene.gather({0.4f, 0.5f, 0.7f}, normal, 7, {});
  EXPECT_EQ(gather.occlusion_front, 1);
  EXPECT_EQ(gather.occlusion_both, 1);
  EXPECT_NEAR(gather.irradiance_front.x, kPi, 1e-4f);
  EXPECT_NEAR(gather.irradiance_both.z, kPi, 1e-4f);
}

TEST_F(Reference, BackFacesOccludeOnBothSidesOnly) {
  // From inside a cube that faces outwards every ray meets a back
  const ReferenceScene scene = load(write("cube.ply", cubePly(false)));
  const ReferenceGather gather = scene.gather({0.4f, 0.5f, 0.7f}, kUp, 7, {});
  EXPECT_EQ(gather.occlusion_front, 0);
  EXPECT_EQ(gather.occlusion_both, 1);
  EXPECT_EQ(scene.occlusion({0.4f, 0.5f, 0.7f}, kUp, 7, {}), 1);
}

TEST_F(Reference, ParallelSquareGivesItsFormFactor) {
  // A square of half edge 1 at height 1 that faces down: F = 4 x the corner form factor
  const ReferenceScene scene = load(
      write("m.ply", plyText({{-1, 1, 1}, {1, 1, 1}, {1, 1, -1}, {-1, 1, -1}}, {{3, 2, 1, 0}})));
  const double p = std::sqrt(2.0);
  const double expected = 4 / (2 * 3.14159265358979) * 2 * (1 / p * std::atan(1 / p));
  ReferenceQuality quality;
  quality.rays = 4096;
  quality.offset = 1e-6f;
  double mean = 0;
  for (std::uint64_t seed = 0; seed < 16; ++seed) {
    const ReferenceGather gather = scene.gather({0, 0, 0}, kUp, seed << 32, quality);
    EXPECT_NEAR(double(gather.occlusion_front), expected, 0.01);
    mean += double(gather.occlusion_front) / 16;
  }
  EXPECT_NEAR(mean, expected, 1e-3);
}

TEST_F(Reference, RayCountsThatAreNoSquareAreUnbiased) {
  const ReferenceScene scene = load(
      write("m.ply", plyText({{-1, 1, 1}, {1, 1, 1}, {1, 1, -1}, {-1, 1, -1}}, {{3, 2, 1, 0}})));
  const double p = std::sqrt(2.0);
  const double expected = 4 / (2 * 3.14159265358979) * 2 * (1 / p * std::atan(1 / p));
  for (const int rays : {1, 2, 7, 50}) {
    ReferenceQuality quality;
    quality.rays = rays;
    quality.offset = 1e-6f;
    double mean = 0;
    constexpr int kSeeds = 20000;
    for (int seed = 0; seed < kSeeds; ++seed) {
      mean += double(scene.occlusion({0, 0, 0}, kUp, std::uint64_t(seed) << 32, quality));
    }
    EXPECT_NEAR(mean / kSeeds, expected, 0.015 / std::sqrt(double(rays))) << rays << " rays";
  }
}

TEST_F(Reference, IrradianceIsTheMeanExitanceOfWhatIsSeen) {
  // A floor lit from above by 2 W/m2, reflecting half, seen by a receiver that looks down on it
  Surroundings surroundings;
  surroundings.lights.directionals.push_back({{0, -1, 0}, glm::vec3(2)});
  const ReferenceScene scene = load(write("floor.ply", floorPly(4)), surroundings);
  const ReferenceGather gather = scene.gather({0, 0.5f, 0}, -kUp, 3, {});
  EXPECT_GT(gather.occlusion_front, 0.9f);
  EXPECT_NEAR(gather.irradiance_front.x, gather.occlusion_front, 1e-4f);  // B = 1 where hit
}

}  // namespace
}  // namespace surfeit
