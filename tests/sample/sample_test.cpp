#include "surfeit/sample.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <glm/geometric.hpp>
#include <random>

#include "core/long_side.h"
#include "sample/scene_files.h"
#include "surfels/open_surfel_source.h"

namespace surfeit {
namespace {

using ::testing::HasSubstr;

class Sampling : public SceneFiles {
 protected:
  std::vector<Surfel> sample(const std::string& mesh, const SampleOptions& options) {
    Result<SampleStats> stats = sampleMeshes({mesh}, path("out.ply"), options, notes_);
    EXPECT_TRUE(stats.ok()) << stats.status().message();
    if (!stats.ok()) return {};
    stats_ = *stats;
    return readCloud(path("out.ply"));
  }
  static double totalArea(const std::vector<Surfel>& surfels) {
    double area = 0;
    for (const Surfel& surfel : surfels) area += double(surfel.area);
    return area;
  }
  // Is every one of `count` random points of the mesh within the radius of some surfel?
  int holes(const std::string& path, const std::vector<Surfel>& surfels, int count) {
    const Result<Mesh> mesh = loadMeshes({path}, glm::vec3(0.5f), notes_);
    EXPECT_TRUE(mesh.ok());
    std::mt19937 random(11);
    std::uniform_real_distribution<float> unit(0, 1);
    int missing = 0;
    for (int i = 0; i < count; ++i) {
      float u = unit(random), v = unit(random);
      if (u + v > 1) u = 1 - u, v = 1 - v;
      const std::uint32_t triangle = std::uint32_t(random() % mesh->triangle.size());
      const glm::vec3 point = surfacePoint(*mesh, triangle, u, v).position;
      missing += std::none_of(surfels.begin(), surfels.end(), [&](const Surfel& surfel) {
        return glm::distance(surfel.position, point) <= surfel.radius * 1.0001f;
      });
    }
    return missing;
  }

  // A bumpy grid of n x n quads, so 2 n^2 triangles of like size; or with vertices of each quad.
  static std::string gridPly(int n, bool is_split = false) {
    std::vector<glm::vec3> vertices;
    std::vector<std::vector<int>> faces;
    for (int i = 0; i <= n; ++i) {
      for (int k = 0; k <= n; ++k) {
        const float x = float(i) / float(n), z = float(k) / float(n);
        vertices.emplace_back(x, 0.1f * std::sin(9 * x) * std::cos(7 * z), z);
      }
    }
    for (int i = 0; i < n; ++i) {
      for (int k = 0; k < n; ++k) {
        const int a = i * (n + 1) + k;
        faces.push_back({a, a + 1, a + n + 2, a + n + 1});
      }
    }
    if (is_split) {
      std::vector<glm::vec3> own;
      for (std::vector<int>& face : faces) {
        for (int& vertex : face) {
          own.push_back(vertices[std::size_t(vertex)]);
          vertex = int(own.size()) - 1;
        }
      }
      vertices = own;
    }
    return plyText(vertices, faces);
  }

  RecordedNotes notes_;
  SampleStats stats_;
};

TEST_F(Sampling, CountAndAreaAreExact) {
  const std::string cube = write("cube.ply", cubePly(false));
  for (const std::uint64_t count : {1, 5, 12, 100, 20000}) {
    SampleOptions options;
    options.count = count;
    const std::vector<Surfel> surfels = sample(cube, options);
    EXPECT_EQ(surfels.size() - stats_.sliver_surfels, count);
    EXPECT_NEAR(totalArea(surfels), 6, 6e-5);
    EXPECT_NEAR(stats_.area, 6, 1e-6);
  }
  EXPECT_EQ(stats_.sliver_surfels, 0u);
}

TEST_F(Sampling, SpacingSetsTheAreaPerSurfel) {
  SampleOptions options;
  options.spacing = 0.05;
  const std::vector<Surfel> surfels = sample(write("cube.ply", cubePly(false)), options);
  EXPECT_EQ(surfels.size(), 2400u);
  for (const Surfel& surfel : surfels) EXPECT_NEAR(surfel.area, 0.0025f, 1e-6f);
}

TEST_F(Sampling, FewSurfelsOnManyTrianglesKeepTheArea) {
  const std::string grid = write("grid.ply", gridPly(50));
  SampleOptions options;
  options.count = 317;
  const std::vector<Surfel> surfels = sample(grid, options);
  EXPECT_EQ(surfels.size(), 317u);
  EXPECT_NEAR(totalArea(surfels) / stats_.area, 1, 1e-5);
  for (const Surfel& surfel : surfels) {
    EXPECT_LT(double(surfel.area), 2.1 * stats_.spacing * stats_.spacing);
    EXPECT_LE(double(surfel.radius), 2.001 * stats_.spacing);
  }
}

TEST_F(Sampling, DisksLeaveNoHoles) {
  const std::string cube = write("cube.ply", cubePly(false));
  const std::string grid = write("grid.ply", gridPly(30));
  const std::string split = write("split.ply", gridPly(30, true));
  SampleOptions options;
  options.count = 5000;  // more than triangles: the pieces' own circles
  EXPECT_EQ(holes(cube, sample(cube, options), 2000), 0);
  EXPECT_EQ(holes(grid, sample(grid, options), 2000), 0);
  // Fewer than triangles: widened over those without surfels, also where the curve jumps
  for (const int count : {1700, 1000, 300}) {
    options.count = std::uint64_t(count);
    EXPECT_EQ(holes(grid, sample(grid, options), 20000), 0) << count;
    EXPECT_EQ(holes(split, sample(split, options), 20000), 0) << count;
  }
}

TEST_F(Sampling, RadiusIsBoundedOnSlivers) {
  // A fan of needles 10 long and 0.001 wide
  std::vector<glm::vec3> vertices = {{0, 0, 0}};
  std::vector<std::vector<int>> faces;
  for (int i = 0; i <= 100; ++i) vertices.emplace_back(10.0f, 0.001f * float(i), 0.0f);
  for (int i = 1; i <= 100; ++i) faces.push_back({0, i, i + 1});
  SampleOptions options;
  options.count = 200;
  const std::vector<Surfel> surfels = sample(write("fan.ply", plyText(vertices, faces)), options);
  EXPECT_GT(stats_.sliver_surfels, 0u);
  EXPECT_NEAR(totalArea(surfels) / stats_.area, 1, 1e-5);
  for (const Surfel& surfel : surfels) {
    EXPECT_LE(double(surfel.radius), 1.5 * stats_.spacing);
  }
}

TEST_F(Sampling, ThreadsDoNotChangeABit) {
  const std::string grid = write("grid.ply", gridPly(40));
  SampleOptions options;
  options.count = 30000;
  options.surroundings.ground.enabled = true;
  options.surroundings.lights.areas.push_back(
      {{0.5f, 2, 0.5f}, {0.5f, 0, 0}, {0, 0, 0.5f}, glm::vec3(3)});
  std::string bytes;
  for (const int threads : {1, 2, 5}) {
    options.threads = threads;
    sample(grid, options);
    const std::string now = read(path("out.ply"));
    EXPECT_TRUE(bytes.empty() || bytes == now) << threads << " threads";
    bytes = now;
  }
}

TEST_F(Sampling, RadiosityIsAlbedoTimesIrradiance) {
  SampleOptions options;
  options.count = 2000;
  options.surroundings.default_albedo = {0.2f, 0.5f, 0.8f};
  options.surroundings.lights.points.push_back({{0, 3, 0}, glm::vec3(10)});
  for (const Surfel& surfel : sample(write("floor.ply", floorPly(4)), options)) {
    const glm::vec3 towards = glm::vec3(0, 3, 0) - surfel.position;
    const float irradiance = 10 * 3 / std::pow(glm::length(towards), 3.0f);
    ASSERT_NEAR(surfel.radiosity.x, 0.2f * irradiance, 1e-5f);
    ASSERT_NEAR(surfel.radiosity.z, 0.8f * irradiance, 1e-5f);
    ASSERT_EQ(surfel.albedo, options.surroundings.default_albedo);
    ASSERT_NEAR(glm::distance(surfel.normal, glm::vec3(0, 1, 0)), 0, 1e-6f);
  }
}

TEST_F(Sampling, TwoSidedMeshesShowBothSidesAndHaveLongSides) {
  const std::string grid = write("grid.ply", gridPly(8));
  SampleOptions options;
  options.count = 2000;
  options.surroundings.lights.directionals = {{{0, -1, 0}, glm::vec3(2)}};
  const std::vector<Surfel> front = sample(grid, options);
  options.surroundings.lights.directionals = {{{0, 1, 0}, glm::vec3(2)}};
  const std::vector<Surfel> back = sample(grid, options);
  options.is_two_sided = true;
  const std::vector<Surfel> both = sample(grid, options);
  ASSERT_EQ(both.size(), front.size());
  for (std::size_t i = 0; i < both.size(); ++i) {
    ASSERT_TRUE(both[i].isTwoSided() && !front[i].isTwoSided());
    ASSERT_NE(both[i].long_side, kNoLongSide);
    ASSERT_EQ(front[i].long_side, kNoLongSide);
    ASSERT_NEAR(std::abs(glm::dot(directionOf(both[i].long_side), both[i].normal)), 0, .1f);
    // One of the two is lit, and the mean is half of that
    const float lit = std::max(front[i].radiosity.x, back[i].radiosity.x);
    ASSERT_GT(lit, 0);
    ASSERT_NEAR(both[i].radiosity.x, .5f * lit, .02f);
  }
}

TEST_F(Sampling, WithoutLightThereIsNoRadiosity) {
  SampleOptions options;
  options.count = 100;
  sample(write("floor.ply", floorPly(4)), options);
  EXPECT_EQ(read(path("out.ply")).find("radiosity_r"), std::string::npos);
  ASSERT_EQ(notes_.notes.size(), 1u);
  EXPECT_THAT(notes_.notes[0], HasSubstr("no light"));
}

TEST_F(Sampling, BadOptionsAreRefusedAndLeaveNothing) {
  const std::string floor = write("floor.ply", floorPly(4));
  const auto code = [&](const SampleOptions& options) {
    return sampleMeshes({floor}, path("out.ply"), options, notes_).status().code();
  };
  SampleOptions options;
  options.count = 0;
  EXPECT_EQ(code(options), StatusCode::kInvalidArgument);
  options = {};
  options.spacing = -1;
  EXPECT_EQ(code(options), StatusCode::kInvalidArgument);
  options.spacing = 1e-9;
  EXPECT_EQ(code(options), StatusCode::kInvalidArgument);
  options = {};
  options.surroundings.lights.areas.emplace_back();
  EXPECT_EQ(code(options), StatusCode::kInvalidArgument);
  options = {};
  options.surroundings.lights.directionals.push_back({{0, 0, 0}, glm::vec3(1)});
  EXPECT_EQ(code(options), StatusCode::kInvalidArgument);
  options = {};
  options.surroundings.lights.points.push_back({{0, INFINITY, 0}, glm::vec3(1)});
  EXPECT_EQ(code(options), StatusCode::kInvalidArgument);
  EXPECT_FALSE(std::filesystem::exists(path("out.ply")));
}

TEST_F(Sampling, CancelledWorkLeavesNothing) {
  CancelAfter progress(10000);
  const Result<SampleStats> stats =
      sampleMeshes({write("floor.ply", floorPly(4))}, path("out.ply"), SampleOptions{}, progress);
  EXPECT_EQ(stats.status().code(), StatusCode::kInterrupted);
  EXPECT_FALSE(std::filesystem::exists(path("out.ply")));
}

// A unit square with uv from 0 to 1.
std::string squareOf(const std::string& material) {
  return "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 "
         "1\nusemtl " +
         material + "\nf 1/1 2/2 3/3 4/4\n";
}

TEST_F(Sampling, OnlyWhatIsThereBecomesSurfels) {
  // A quarter of the mask is white
  write("mask.ppm", std::string("P6\n2 2\n255\n\xff\xff\xff") + std::string(9, '\0'));
  write("m.mtl", "newmtl leaf\nmap_d mask.ppm\nnewmtl glass\nd 0.3\n");
  SampleOptions options;
  options.count = 20000;
  const std::vector<Surfel> leaf = sample(write("leaf.obj", squareOf("leaf")), options);
  EXPECT_NEAR(totalArea(leaf), .25, .002);
  EXPECT_EQ(stats_.surfels + stats_.clear_surfels, 20000u);
  const std::vector<Surfel> glass = sample(write("glass.obj", squareOf("glass")), options);
  EXPECT_EQ(glass.size(), 20000u);
  EXPECT_NEAR(totalArea(glass), 1, 1e-4);
  for (const Surfel& surfel : glass) ASSERT_NEAR(surfel.opacity(), .3, 1e-4);
}

TEST_F(Sampling, ShadowsAreAsDenseAsWhatCastsThem) {
  write("m.mtl", "newmtl glass\nd 0.3\n");
  // The plate far above a floor, under a sun
  write("plate.obj",
        "mtllib m.mtl\nv -2 3 2\nv 2 3 2\nv 2 3 -2\nv -2 3 -2\nusemtl glass\nf 1 2 3 4\n");
  SampleOptions options;
  options.count = 20000;
  options.surroundings.lights.directionals.push_back({{0, -1, 0}, glm::vec3(1)});
  ASSERT_TRUE(sampleMeshes({write("floor.ply", floorPly(2)), path("plate.obj")}, path("out.ply"),
                           options, notes_)
                  .ok());
  double light = 0;
  int count = 0;
  for (const Surfel& surfel : readCloud(path("out.ply"))) {
    if (surfel.position.y > 1) continue;
    light += double(surfel.radiosity.x) / .5;
    ++count;
  }
  EXPECT_NEAR(light / count, .7, .02);
}

// Red glass, by its Tf; and half of it is there, by a mask.
TEST_F(Sampling, ShadowsOfTintsHaveTheirColor) {
  for (const bool has_mask : {false, true}) {
    write("mask.ppm", std::string("P6\n2 1\n255\n\xff\xff\xff") + std::string(3, '\0'));
    write("m.mtl",
          std::string("newmtl glass\nd .2\nTf 1 .25 .25\n") + (has_mask ? "map_d mask.ppm\n" : ""));
    write("plate.obj",
          "mtllib m.mtl\nv -2 3 2\nv 2 3 2\nv 2 3 -2\nv -2 3 -2\nvt 0 0\nvt 8 0\nvt 8 8\nvt 0 8\n"
          "usemtl glass\nf 1/1 2/2 3/3 4/4\n");
    SampleOptions options;
    options.count = 20000;
    options.surroundings.lights.directionals.push_back({{0, -1, 0}, glm::vec3(1)});
    ASSERT_TRUE(sampleMeshes({write("floor.ply", floorPly(2)), path("plate.obj")}, path("out.ply"),
                             options, notes_)
                    .ok());
    glm::dvec3 light(0);
    double glass_area = 0;
    int count = 0;
    for (const Surfel& surfel : readCloud(path("out.ply"))) {
      if (surfel.position.y > 1) {
        EXPECT_NEAR(surfel.opacity(0), .2, 1e-4);
        EXPECT_NEAR(surfel.opacity(1), .8, 1e-4);
        EXPECT_NEAR(surfel.opacity(2), .8, 1e-4);
        glass_area += double(surfel.area);
        continue;
      }
      light += glm::dvec3(surfel.radiosity) / .5;
      ++count;
    }
    const double part = has_mask ? .5 : 1;
    EXPECT_NEAR(glass_area, 16 * part, .1);
    EXPECT_NEAR(light.r / count, 1 - .2 * part, .02);
    EXPECT_NEAR(light.g / count, 1 - .8 * part, .02);
    EXPECT_NEAR(light.b / count, 1 - .8 * part, .02);
  }
}

TEST_F(Sampling, AMeshOnAMapGivesTheSurfelsOfThatAtZero) {
  const auto mesh = [](double x, double y) {
    std::string text;
    for (const auto& [u, v] : {std::pair(0, 0), {1, 0}, {1, 1}, {0, 1}}) {
      text += fmt::format("v {:.3f} {:.3f} 0\n", x + u, y + v);
    }
    return text + "f 1 2 3 4\n";
  };
  SampleOptions options;
  options.count = 200;
  options.surroundings.lights.points.push_back({{.5, .5, 1}, glm::vec3(1)});
  ASSERT_TRUE(
      sampleMeshes({write("near.obj", mesh(0, 0))}, path("near.ply"), options, notes_).ok());
  options.surroundings.lights.points[0].position += glm::dvec3(500000, 5000000, 0);
  ASSERT_TRUE(
      sampleMeshes({write("far.obj", mesh(500000, 5000000))}, path("far.ply"), options, notes_)
          .ok());
  const Result<std::unique_ptr<SurfelSource>> far = openSurfelSource(path("far.ply"), true);
  ASSERT_TRUE(far.ok());
  (*far)->setOrigin({500000, 5000000, 0});
  std::vector<Surfel> moved(200);
  ASSERT_EQ(*(*far)->read(moved), 200u);
  const std::vector<Surfel> near = readCloud(path("near.ply"));
  // The order of triangles is along the curve of another cube
  const auto differs = [](const Surfel& a, const Surfel& b) {
    return glm::distance(a.position, b.position) > 1e-6f ||
           glm::distance(a.radiosity, b.radiosity) > 1e-6f;
  };
  for (const Surfel& surfel : near) {
    EXPECT_EQ(std::count_if(moved.begin(), moved.end(),
                            [&](const Surfel& other) { return !differs(surfel, other); }),
              1);
  }
  EXPECT_TRUE(notes_.notes.empty());
}

}  // namespace
}  // namespace surfeit
