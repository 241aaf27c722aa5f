#include "sample/direct_light.h"

#include <cmath>
#include <glm/geometric.hpp>

#include "core/spherical_harmonics.h"
#include "sample/scene_files.h"

namespace surfeit {
namespace {

// Irradiance from a parallel rectangle of uniform radiance 1, straight above one of its corners:
// E = pi F, with the corner form factor F of two perpendicular-foot rectangles (Howell C-11).
double cornerIrradiance(double a, double b, double distance) {
  const double x = a / distance, y = b / distance;
  const double p = std::sqrt(1 + x * x), q = std::sqrt(1 + y * y);
  return 0.5 * (x / p * std::atan(y / p) + y / q * std::atan(x / q));
}

class Lighting : public SceneFiles {
 protected:
  void load(const std::string& file) {
    Result<Mesh> mesh = loadMeshes({file}, glm::vec3(0.5f), notes_);
    ASSERT_TRUE(mesh.ok()) << mesh.status().message();
    mesh_ = std::move(*mesh);
    Result<RayScene> scene = RayScene::build(mesh_, 1);
    ASSERT_TRUE(scene.ok()) << scene.status().message();
    scene_ = std::make_unique<RayScene>(std::move(*scene));
  }
  // At a point of the plane y = 0 that faces up.
  float irradiance(const Lights& lights, const glm::vec3& position, int samples = 16,
                   std::uint64_t seed = 1) const {
    SurfacePoint point;
    point.position = position;
    point.normal = point.geometric_normal = {0, 1, 0};
    return DirectLight(mesh_, *scene_, lights).irradiance(point, seed, samples).x;
  }

  Mesh mesh_;
  std::unique_ptr<RayScene> scene_;
  RecordedNotes notes_;
};

TEST_F(Lighting, PointLightFollowsTheInverseSquareAndTheCosine) {
  load(write("floor.ply", floorPly(10)));
  Lights lights;
  lights.points.push_back({{0, 2, 0}, glm::vec3(8)});
  EXPECT_NEAR(irradiance(lights, {0, 0, 0}), 2, 1e-5f);
  const float distance_sq = 4 + 9;
  EXPECT_NEAR(irradiance(lights, {3, 0, 0}), 8 * 2 / std::pow(distance_sq, 1.5f), 1e-5f);
  lights.points[0].position.y = -2;
  EXPECT_EQ(irradiance(lights, {0, 0, 0}), 0);  // lit on its normal's side only
}

TEST_F(Lighting, PointLightFollowsTheFalloffAskedFor) {
  load(write("floor.ply", floorPly(10)));
  Lights lights;
  lights.points.push_back({{0, 2, 0}, glm::vec3(8)});
  lights.directionals.push_back({{0, -1, 0}, glm::vec3(.25f)});  // which has none
  for (const float falloff : {0.f, 1.f, 2.f, 3.5f}) {
    lights.falloff = falloff;
    for (const float x : {0.f, 1.f, 4.f}) {
      const float distance = std::sqrt(4 + x * x), cosine = 2 / distance;
      lights.falloff_distance = 1;
      const float expected = 8 * cosine / std::pow(distance, falloff) + .25f;
      EXPECT_NEAR(irradiance(lights, {x, 0, 0}), expected, 1e-5f * expected) << falloff << " " << x;
      // Where the falloffs meet they give what physics has
      lights.falloff_distance = double(distance);
      const float physical = 8 * cosine / (distance * distance) + .25f;
      EXPECT_NEAR(irradiance(lights, {x, 0, 0}), physical, 1e-5f * physical);
    }
  }
}

// A small rectangle is a point of intensity L A cos; beyond it a large one, whose falloff has no
// closed form, is the sum of small ones.
TEST_F(Lighting, RectanglesFollowTheFalloffAskedFor) {
  load(write("floor.ply", floorPly(10)));
  Lights small;
  small.areas.push_back({{0, 2, 0}, {.01f, 0, 0}, {0, 0, .01f}, glm::vec3(1000)});
  for (const float falloff : {0.f, 1.f, 3.f}) {
    small.falloff = falloff;
    const float distance = std::sqrt(4 + 9.f), cosine = 2 / distance;
    const float expected = 1000 * 4e-4f * cosine * cosine / std::pow(distance, falloff);
    EXPECT_NEAR(irradiance(small, {3, 0, 0}, 64), expected, 1e-3f * expected) << falloff;
  }

  Lights large;
  large.areas.push_back({{0, 2, 0}, {2, 0, 0}, {0, 0, 2}, glm::vec3(1)});
  large.falloff = 1;
  double sum = 0;
  constexpr int kCells = 400;
  for (int i = 0; i < kCells * kCells; ++i) {
    const double x = ((i % kCells) + .5) / kCells * 4 - 2, z = ((i / kCells) + .5) / kCells * 4 - 2;
    const double distance_sq = x * x + z * z + 4;
    sum += 16. / (kCells * kCells) * 4 / distance_sq / std::sqrt(distance_sq);
  }
  EXPECT_NEAR(irradiance(large, {0, 0, 0}, 65536), sum, 2e-3 * sum);
  EXPECT_GT(sum, double(kPi));  // more than a physical light can give
}

TEST_F(Lighting, DirectionalLightFollowsTheCosine) {
  load(write("floor.ply", floorPly(10)));
  Lights lights;
  lights.directionals.push_back({{3, -4, 0}, glm::vec3(2)});
  EXPECT_NEAR(irradiance(lights, {0, 0, 0}), 2 * 0.8f, 1e-5f);
  lights.directionals[0].direction = {0, 1, 0};
  EXPECT_EQ(irradiance(lights, {0, 0, 0}), 0);
}

TEST_F(Lighting, RectangleLightGivesItsFormFactor) {
  load(write("floor.ply", floorPly(10)));
  Lights lights;  // emits towards u x v = -y
  lights.areas.push_back({{0, 1.5f, 0}, {1, 0, 0}, {0, 0, 0.5f}, glm::vec3(3)});
  const double expected = 4 * 3 * cornerIrradiance(1, 0.5, 1.5);
  EXPECT_NEAR(irradiance(lights, {0, 0, 0}, 4096), expected, 1e-3 * expected);

  // Few samples: right on average over the seeds, and near it for each
  double mean = 0;
  for (std::uint64_t seed = 0; seed < 1000; ++seed) {
    const double value = double(irradiance(lights, {0, 0, 0}, 16, seed));
    EXPECT_NEAR(value, expected, 0.1 * expected);
    mean += value / 1000;
  }
  EXPECT_NEAR(mean, expected, 2e-3 * expected);

  lights.areas[0].u = {-1, 0, 0};  // turned round: it emits upwards
  EXPECT_EQ(irradiance(lights, {0, 0, 0}), 0);
}

TEST_F(Lighting, IrradianceNextToAnAreaLightStaysBounded) {
  load(write("floor.ply", floorPly(10)));
  Lights lights;
  lights.areas.push_back({{0, 1e-4f, 0}, {1, 0, 0}, {0, 0, 1}, glm::vec3(1)});
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    EXPECT_LE(irradiance(lights, {0, 0, 0}, 16, seed), kPi + 1e-4f);
  }
}

TEST_F(Lighting, GeometryCastsShadows) {
  // A small square at height 1 above the origin
  load(write("blocker.ply",
             plyText({{-1, 1, 1}, {1, 1, 1}, {1, 1, -1}, {-1, 1, -1}}, {{0, 1, 2, 3}})));
  Lights lights;
  lights.points.push_back({{0, 2, 0}, glm::vec3(8)});
  lights.directionals.push_back({{0, -1, 0}, glm::vec3(1)});
  lights.areas.push_back({{0, 2, 0}, {0.1f, 0, 0}, {0, 0, 0.1f}, glm::vec3(1)});
  EXPECT_EQ(irradiance(lights, {0, 0, 0}), 0);
  EXPECT_EQ(irradiance(lights, {0.9f, 0, 0.9f}), 0);
  EXPECT_GT(irradiance(lights, {5, 0, 0}), 1);
}

TEST_F(Lighting, SurfacesDoNotShadowThemselvesAtAnyScaleOrPlace) {
  for (const float scale : {1e-3f, 1.0f, 1e4f}) {
    const glm::vec3 at = glm::vec3(100, 50, -70) * scale;
    load(write("floor.ply",
               plyText({at + scale * glm::vec3(-1, 0, 1), at + scale * glm::vec3(1, 0, 1),
                        at + scale * glm::vec3(1, 0, -1)},
                       {{0, 1, 2}})));
    Lights lights;
    lights.directionals.push_back({{1, -0.02f, 0.3f}, glm::vec3(1)});
    const DirectLight light(mesh_, *scene_, lights);
    for (int i = 1; i < 100; ++i) {
      const SurfacePoint point = surfacePoint(mesh_, 0, float(i) / 250, float(i) / 200);
      EXPECT_GT(light.irradiance(point, 1, 1).x, 0) << scale << " " << i;
    }
  }
}

TEST_F(Lighting, EmissiveTrianglesGiveTheirFormFactor) {
  // A square of radiance 2 at height 1.5 that faces down, cut unevenly, and a dark floor
  write("m.mtl", "newmtl light\nKd 0 0 0\nKe 2 2 2\nnewmtl dark\nKd 0 0 0\n");
  load(write("m.obj",
             "mtllib m.mtl\nv -1 1.5 -1\nv 1 1.5 -1\nv 1 1.5 1\nv -1 1.5 1\nv -0.7 1.5 -1\n"
             "v -1 0 1\nv 1 0 1\nv 1 0 -1\nusemtl light\nf 1 5 4\nf 5 2 3\nf 5 3 4\n"
             "usemtl dark\nf 6 7 8\n"));
  const double expected = 4 * 2 * cornerIrradiance(1, 1, 1.5);
  EXPECT_NEAR(irradiance({}, {0, 0, 0}, 4096), expected, 2e-3 * expected);
  double mean = 0;
  for (std::uint64_t seed = 0; seed < 1000; ++seed) {
    mean += double(irradiance({}, {0, 0, 0}, 16, seed)) / 1000;
  }
  EXPECT_NEAR(mean, expected, 4e-3 * expected);
  EXPECT_EQ(irradiance({}, {0, 2, 0}), 0);  // above its back
}

}  // namespace
}  // namespace surfeit
