#include "sample/traced_cube.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>

#include "core/spherical_harmonics.h"
#include "sample/scene_files.h"

namespace surfeit {
namespace {

class TracedCube : public SceneFiles {
 protected:
  // A pixel per face edge of 8, from the origin along +z.
  static CubeImage cubeLooking(const glm::vec3& normal) {
    constexpr int kSize = 8;
    CubeImage cube;
    cube.receiver.normal = normal;
    cube.resolution = kSize;
    for (int face = 0; face < 6; ++face) {
      const int axis = face / 2;
      CubeFace& made = cube.faces.emplace_back();
      made.forward[axis] = face % 2 == 0 ? 1.f : -1.f;
      made.u[(axis + 1) % 3] = 1;
      made.v[(axis + 2) % 3] = 1;
      for (int i = 0; i < kSize * kSize; ++i) {
        const float a = float(2 * (i % kSize) + 1) / kSize - 1;
        const float b = float(2 * (i / kSize) + 1) / kSize - 1;
        CubePixel& pixel = cube.pixels.emplace_back();
        pixel.direction = glm::normalize(made.forward + a * made.u + b * made.v);
        const float length = std::sqrt(1 + a * a + b * b);
        pixel.solid_angle = 4.f / (kSize * kSize) / (length * length * length);
        pixel.weight = std::max(0.f, glm::dot(pixel.direction, normal));
      }
    }
    return cube;
  }

  // A square of half edge 1 at height 1 that faces down.
  CubeImage trace(const glm::vec3& normal, const TracedCubeOptions& options) {
    write("square.obj", "v -1 -1 1\nv 1 -1 1\nv 1 1 1\nv -1 1 1\nf 4 3 2 1\n");
    Result<Mesh> mesh = loadMeshes({path("square.obj")}, glm::vec3(.5f), notes_);
    EXPECT_TRUE(mesh.ok()) << mesh.status().message();
    Result<RayScene> rays = RayScene::build(*mesh, 1);
    EXPECT_TRUE(rays.ok()) << rays.status().message();
    return traceCube(cubeLooking(normal), *mesh, *rays, options);
  }
  RecordedNotes notes_;
};

TEST_F(TracedCube, SquareAboveFillsItsFace) {
  const CubeImage cube = trace({0, 0, 1}, {});
  for (const CubePixel& pixel : cube.pixels) {
    const glm::vec3& d = pixel.direction;
    const bool is_above = d.z > std::max(std::abs(d.x), std::abs(d.y));
    EXPECT_EQ(pixel.coverage, is_above ? 1.f : 0.f);
    if (is_above) {
      // The nearest of the pixel's rays
      EXPECT_LE(pixel.depth, 1 / d.z);
      EXPECT_GT(pixel.depth, .8f / d.z);
    }
  }
  // Four times the form factor of a square above its corner
  const double corner = 2 / std::sqrt(2.0) * std::atan(1 / std::sqrt(2.0)) / (2 * double(kPi));
  EXPECT_NEAR(cube.occlusion, 4 * corner, .01);
}

TEST_F(TracedCube, SidesAndDistanceChooseWhatCovers) {
  EXPECT_EQ(trace({0, 0, 1}, {.sides = GatherSides::kBack}).occlusion, 0);
  EXPECT_GT(trace({0, 0, 1}, {.sides = GatherSides::kBoth}).occlusion, .5f);
  EXPECT_EQ(trace({0, 0, 1}, {.max_distance = .9f}).occlusion, 0);
}

TEST_F(TracedCube, NothingBelowTheHorizonCounts) {
  for (const CubePixel& pixel : trace({0, 0, -1}, {}).pixels) EXPECT_EQ(pixel.coverage, 0);
  // Without a normal there is no horizon
  EXPECT_GT(trace({0, 0, 0}, {}).pixels[4 * 64 + 27].coverage, 0);
}

}  // namespace
}  // namespace surfeit
