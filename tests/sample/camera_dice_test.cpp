// Surfels for cameras: sample with a density of cameras.
#include "sample/camera_dice.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <map>
#include <numbers>
#include <random>
#include <set>
#include <tuple>

#include "sample/scene_files.h"
#include "surfeit/sample.h"
#include "surfels/camera_spacing.h"

namespace surfeit {
namespace {

using ::testing::HasSubstr;

// The projection on the pyramid by alternate projections on its four sides (Dykstra 1983).
double slowDistance(const glm::dvec3& place, double slope_x, double slope_y) {
  const glm::dvec3 normals[4] = {
      glm::normalize(glm::dvec3(1, 0, -slope_x)), glm::normalize(glm::dvec3(-1, 0, -slope_x)),
      glm::normalize(glm::dvec3(0, 1, -slope_y)), glm::normalize(glm::dvec3(0, -1, -slope_y))};
  glm::dvec3 at = place, correction[4] = {};
  for (int round = 0; round < 2000; ++round) {
    for (int i = 0; i < 4; ++i) {
      const glm::dvec3 from = at + correction[i];
      at = from - std::max(0.0, glm::dot(from, normals[i])) * normals[i];
      correction[i] = from - at;
    }
  }
  return glm::distance(place, at);
}

TEST(CameraSpacing, DistanceToThePyramidIsThatOfAlternateProjections) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> unit(-3, 3);
  int sides = 0;
  for (int i = 0; i < 300; ++i) {
    const glm::dvec3 place(unit(random), unit(random), unit(random));
    const double slope_x = 0.1 + std::abs(unit(random)), slope_y = 0.1 + std::abs(unit(random));
    const double expected = slowDistance(place, slope_x, slope_y);
    ASSERT_NEAR(distanceToPyramid(place, slope_x, slope_y), expected, 1e-4 + 1e-3 * expected);
    sides += expected > 0 && expected < 0.999 * glm::length(place);
  }
  EXPECT_GT(sides, 50);
  EXPECT_NEAR(distanceToPyramid({0, 0, -2}, 1, 1), 2, 1e-12);
  EXPECT_NEAR(distanceToPyramid({3, 0, 1}, 1, 1), std::sqrt(2), 1e-12);
  EXPECT_EQ(distanceToPyramid({0.9, -0.9, 1}, 1, 1), 0);
}

// To the nearest of many rays of the window.
double slowWindowDistance(const glm::dvec3& place, const glm::dvec2& least,
                          const glm::dvec2& most) {
  double nearest = glm::length(place);
  constexpr int kSteps = 120;
  for (int i = 0; i <= kSteps; ++i) {
    for (int k = 0; k <= kSteps; ++k) {
      const double x = least.x + (most.x - least.x) * i / kSteps;
      const double y = least.y + (most.y - least.y) * k / kSteps;
      const glm::dvec3 ray = glm::normalize(glm::dvec3(x, y, 1));
      nearest = std::min(nearest, glm::distance(place, std::max(0.0, glm::dot(place, ray)) * ray));
    }
  }
  return nearest;
}

TEST(CameraSpacing, DistanceToAWindowIsThatOfItsNearestPlace) {
  std::mt19937 random(9);
  std::uniform_real_distribution<double> unit(-1, 1);
  int inside = 0, sides = 0;
  for (int i = 0; i < 400; ++i) {
    const glm::dvec3 place(unit(random), unit(random), unit(random));
    const glm::dvec2 least(unit(random), unit(random));
    const glm::dvec2 most = least + .1 + glm::dvec2(std::abs(unit(random)), std::abs(unit(random)));
    const double expected = slowWindowDistance(place, least, most);
    const double found = distanceToWindow(place, least, most);
    ASSERT_NEAR(found, expected, 5e-3);
    ASSERT_LE(found, expected + 1e-12);
    inside += found == 0;
    sides += found > 0 && found < 0.999 * glm::length(place);
  }
  EXPECT_GT(inside, 3);
  EXPECT_GT(sides, 100);
  // A window in the middle is the pyramid
  for (int i = 0; i < 1000; ++i) {
    const glm::dvec3 place(unit(random), unit(random), unit(random));
    const double x = .1 + std::abs(unit(random)), y = .1 + std::abs(unit(random));
    ASSERT_NEAR(distanceToWindow(place, {-x, -y}, {x, y}), distanceToPyramid(place, x, y), 1e-12);
  }
}

TEST(CameraSpacing, ACropIsInViewAndWhatIsBesideItIsNot) {
  CameraDensity density;
  density.cameras.push_back({{0, 0, 0}, {0, 0, -1}, {}, 90});
  density.width = density.height = 100;
  const auto whole = CameraSpacing::create(density, UpAxis::kY, glm::dvec3(0), 1e-3);
  density.crop = PixelWindow{50, 0, 100, 25};  // the right half of the upper quarter
  const auto crop = CameraSpacing::create(density, UpAxis::kY, glm::dvec3(0), 1e-3);
  ASSERT_TRUE(whole.ok() && crop.ok());
  for (const glm::dvec3& in : {glm::dvec3(.5, .75, -1), glm::dvec3(.01, .51, -1)}) {
    EXPECT_EQ(crop->areaAt(in), whole->areaAt(in));
  }
  for (const glm::dvec3& out :
       {glm::dvec3(-.5, .75, -1), glm::dvec3(.5, .2, -1), glm::dvec3(.5, -.75, -1)}) {
    EXPECT_GT(crop->areaAt(out), 2 * whole->areaAt(out));
  }
  for (const PixelWindow& wrong : {PixelWindow{-1, 0, 5, 5}, PixelWindow{0, 0, 101, 5},
                                   PixelWindow{5, 0, 5, 5}, PixelWindow{0, 9, 5, 3}}) {
    density.crop = wrong;
    EXPECT_EQ(CameraSpacing::create(density, UpAxis::kY, glm::dvec3(0), 1e-3).status().code(),
              StatusCode::kInvalidArgument);
  }
}

TEST(CameraSpacing, LeastAreaBoundsTheAreasOfASphere) {
  CameraDensity density;
  density.cameras.push_back({{0, 0, 0}, {0, 0, -1}, {}, 40});
  density.cameras.push_back({{3, 1, 0}, {0, 0, -5}, {}, 60});
  const auto spacing = CameraSpacing::create(density, UpAxis::kY, glm::dvec3(0), 1e-3);
  ASSERT_TRUE(spacing.ok());
  std::mt19937 random(6);
  std::uniform_real_distribution<double> unit(-1, 1);
  const auto vector = [&] { return glm::dvec3(unit(random), unit(random), unit(random)); };
  for (int i = 0; i < 200; ++i) {
    const glm::dvec3 centre = 6.0 * vector();
    const double radius = 2 * std::abs(unit(random)), least = spacing->leastArea(centre, radius);
    for (int k = 0; k < 50; ++k) {
      const glm::dvec3 place = centre + radius * std::abs(unit(random)) * glm::normalize(vector());
      ASSERT_GE(spacing->areaAt(place), least * (1 - 1e-9));
    }
  }
}

TEST(CameraDice, RouletteNumbersOfNeighboursAreSpread) {
  for (int k = 1; k <= 10; ++k) {
    for (std::uint64_t m = 0; m < 5; ++m) {
      std::set<std::uint64_t> parts;
      for (std::uint64_t i = m << k; i < (m + 1) << k; ++i) {
        const double number = rouletteNumber(i);
        ASSERT_GE(number, 0);
        ASSERT_LT(number, 1);
        parts.insert(std::uint64_t(std::ldexp(number, k)));
      }
      EXPECT_EQ(parts.size(), std::size_t(1) << k);
    }
  }
}

class CameraSampling : public SceneFiles {
 protected:
  static constexpr double kPi = std::numbers::pi;

  // Looks over the floor from the side, 64 pixels high.
  static SampleOptions overFloor() {
    SampleOptions options;
    options.density.cameras.push_back({{0, 1, 0}, {0, 0.6, -4}, {}, 40});
    options.density.width = 96;
    options.density.height = 64;
    options.density.pixels = 1.5;
    return options;
  }

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

  // What a camera sees, worked out anew.
  struct Seen {
    double eye_distance = 0, view_distance = 0;
    bool isInView() const { return view_distance == 0; }
  };
  static Seen look(const CameraDensity& density, std::size_t i, const glm::vec3& position) {
    const DensityCamera& camera = density.cameras[i];
    const glm::dvec3 forward = glm::normalize(camera.look_at - camera.eye);
    const glm::dvec3 right = glm::normalize(glm::cross(forward, glm::dvec3(0, 1, 0)));
    const glm::dvec3 up = glm::cross(right, forward), d = glm::dvec3(position) - camera.eye;
    const double slope = std::tan(camera.fov_degrees / 360 * kPi);
    const glm::dvec3 p(glm::dot(d, right), glm::dot(d, up), glm::dot(d, forward));
    const double slope_x = slope * density.width / density.height;
    const bool is_in = p.z > 0 && std::abs(p.x) <= slope_x * p.z && std::abs(p.y) <= slope * p.z;
    return {glm::length(d), is_in ? 0 : slowDistance(p, slope_x, slope)};
  }
  static double pixelArea(const CameraDensity& density, std::size_t i) {
    const double slope = std::tan(density.cameras[i].fov_degrees / 360 * kPi);
    return std::pow(density.pixels * 2 * slope / density.height, 2);
  }

  // A grid of 2 n^2 triangles on the floor, `size` wide.
  static std::string fineFloor(int n, float size) {
    std::vector<glm::vec3> vertices;
    std::vector<std::vector<int>> faces;
    for (int i = 0; i <= n; ++i) {
      for (int k = 0; k <= n; ++k) {
        vertices.emplace_back(size * (float(k) / float(n) - 0.5f), 0,
                              size * (0.5f - float(i) / float(n)));
      }
    }
    for (int i = 0; i < n; ++i) {
      for (int k = 0; k < n; ++k) {
        const int a = i * (n + 1) + k;
        faces.push_back({a, a + 1, a + n + 2});
        faces.push_back({a, a + n + 2, a + n + 1});
      }
    }
    return plyText(vertices, faces);
  }

  RecordedNotes notes_;
  SampleStats stats_;
};

TEST_F(CameraSampling, SurfelsInViewAreAsLargeAsPixelsAtEveryDistance) {
  const SampleOptions options = overFloor();
  const std::vector<Surfel> surfels = sample(write("floor.ply", floorPly(60)), options);
  EXPECT_NEAR(totalArea(surfels), 3600, 0.4);
  EXPECT_NEAR(stats_.surfel_area, 3600, 0.4);
  std::map<int, std::pair<double, int>> bands;  // by octave of distance: area in pixels, surfels
  for (const Surfel& surfel : surfels) {
    const Seen seen = look(options.density, 0, surfel.position);
    if (!seen.isInView()) continue;
    const double pixels = double(surfel.area) / pixelArea(options.density, 0) /
                          (seen.eye_distance * seen.eye_distance);
    ASSERT_GT(pixels, 0.6);
    ASSERT_LT(pixels, 1.6);
    auto& [sum, count] = bands[int(std::log2(seen.eye_distance))];
    sum += pixels;
    ++count;
  }
  EXPECT_GE(bands.size(), 4u);
  for (const auto& [octave, band] : bands) {
    if (band.second < 100) continue;
    // Root of the area per surfel, over 1.5 pixels
    EXPECT_NEAR(std::sqrt(band.first / band.second), 1, 0.12) << octave;
  }
}

TEST_F(CameraSampling, NeighboursInViewLieAPixelApart) {
  const SampleOptions options = overFloor();
  const std::vector<Surfel> surfels = sample(write("floor.ply", floorPly(12)), options);
  double ratio = 0;
  int count = 0;
  for (std::size_t i = 0; i < surfels.size(); i += 17) {
    const Seen seen = look(options.density, 0, surfels[i].position);
    if (!seen.isInView()) continue;
    float nearest = 1e30f;
    for (const Surfel& other : surfels) {
      if (&other == &surfels[i]) continue;
      nearest = std::min(nearest, glm::distance(other.position, surfels[i].position));
    }
    // Centroids of half squares of area 1 lie 0.94 apart at the least, 0.67 across the diagonal
    ratio += double(nearest) / (std::sqrt(pixelArea(options.density, 0)) * seen.eye_distance);
    ++count;
  }
  ASSERT_GT(count, 50);
  EXPECT_NEAR(ratio / count, 0.75, 0.15);
}

TEST_F(CameraSampling, OrientationDoesNotMatter) {
  // Two squares at the same distances from the eye, one facing it and one edge-on
  const std::string squares = plyText({{-1, -1, -10},
                                       {1, -1, -10},
                                       {1, 1, -10},
                                       {-1, 1, -10},
                                       {0, -1, -11},
                                       {0, -1, -9},
                                       {0, 1, -9},
                                       {0, 1, -11}},
                                      {{0, 1, 2, 3}, {4, 5, 6, 7}});
  SampleOptions options;
  options.density.cameras.push_back({{0, 0, 0}, {0, 0, -1}, {}, 40});
  options.density.height = options.density.width = 400;
  int facing = 0, edge_on = 0;
  for (const Surfel& surfel : sample(write("squares.ply", squares), options)) {
    ++(std::abs(surfel.normal.z) > 0.5f ? facing : edge_on);
  }
  EXPECT_GT(facing, 500);
  // Areas go by twos: those of a whole square at once, while the other has both sizes
  EXPECT_NEAR(std::log2(double(edge_on) / facing), 0, 0.5);
}

TEST_F(CameraSampling, OutOfViewSurfelsGrowWithTheDistanceToTheView) {
  SampleOptions options = overFloor();
  options.density.pixels = 0.5;
  for (const double solid_angle : {0.01, 0.1}) {
    options.density.max_solid_angle = solid_angle;
    std::map<int, std::pair<double, int>> bands;
    for (const Surfel& surfel : sample(write("floor.ply", floorPly(200)), options)) {
      const Seen seen = look(options.density, 0, surfel.position);
      const double part = double(surfel.area) / (seen.view_distance * seen.view_distance);
      const double pixel = pixelArea(options.density, 0) * seen.eye_distance * seen.eye_distance /
                           (seen.view_distance * seen.view_distance);
      if (!(seen.view_distance > 2) || pixel > 0.7 * solid_angle) continue;  // pixels are larger
      ASSERT_LT(part, 1.7 * solid_angle);
      auto& [sum, count] = bands[int(std::log2(seen.view_distance))];
      sum += part;
      ++count;
    }
    EXPECT_GE(bands.size(), 3u);
    for (const auto& [octave, band] : bands) {
      if (band.second < 20) continue;
      EXPECT_NEAR(std::sqrt(band.first / band.second / solid_angle), 1, 0.2) << octave;
    }
  }
}

TEST_F(CameraSampling, TrianglesSmallerThanASurfelKeepTheirAreaInTheMean) {
  SampleOptions options = overFloor();
  options.density.pixels = 6;
  const std::vector<Surfel> surfels = sample(write("floor.ply", fineFloor(200, 20)), options);
  EXPECT_LT(surfels.size(), 8000u);  // of 80,000 triangles
  EXPECT_NEAR(totalArea(surfels) / 400, 1, 0.015);
  EXPECT_NEAR(stats_.area, 400, 0.1);
  // And in each of its parts: 25 squares
  std::map<std::pair<int, int>, double> parts;
  for (const Surfel& surfel : surfels) {
    parts[{int((surfel.position.x + 10) / 4), int((surfel.position.z + 10) / 4)}] +=
        double(surfel.area);
  }
  EXPECT_EQ(parts.size(), 25u);
  for (const auto& [place, area] : parts) EXPECT_NEAR(area / 16, 1, 0.4);
}

TEST_F(CameraSampling, LongThinTrianglesGetNoGiantDisks) {
  // Blades 10 long and 1/500 wide
  std::vector<glm::vec3> vertices;
  std::vector<std::vector<int>> faces;
  for (int i = 0; i < 2000; ++i) {
    const float x = 0.01f * float(i);
    vertices.insert(vertices.end(), {{x, 0, 0}, {x + 0.002f, 0, 0}, {x, 10, 0}});
    faces.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  SampleOptions options;
  options.density.cameras.push_back({{10, 5, 60}, {10, 5, 0}, {}, 40});
  options.density.width = options.density.height = 80;
  const std::vector<Surfel> surfels =
      sample(write("blades.ply", plyText(vertices, faces)), options);
  const double allowed = pixelArea(options.density, 0) * 60 * 60;
  EXPECT_LT(surfels.size(), 1000u);
  EXPECT_NEAR(totalArea(surfels) / stats_.area, 1, 0.05);
  for (const Surfel& surfel : surfels) {
    ASSERT_LT(double(surfel.radius), 2 * std::sqrt(allowed));
  }
}

TEST_F(CameraSampling, TwoCamerasAreAtLeastAsFineAsEach) {
  const std::string floor = write("floor.ply", floorPly(60));
  SampleOptions first = overFloor(), second = overFloor(), both = overFloor();
  second.density.cameras[0] = {{8, 2, -3}, {-3, 0, -8}, {}, 60};
  both.density.cameras.push_back(second.density.cameras[0]);
  const std::size_t one = sample(floor, first).size(), other = sample(floor, second).size();
  const std::vector<Surfel> surfels = sample(floor, both);
  EXPECT_GT(surfels.size(), std::max(one, other));
  EXPECT_LT(surfels.size(), one + other);
  for (const Surfel& surfel : surfels) {
    for (std::size_t i = 0; i < 2; ++i) {
      const Seen seen = look(both.density, i, surfel.position);
      if (seen.view_distance > 0 && seen.view_distance < 0.1) continue;  // at the edge of the view
      const double allowed = std::max(pixelArea(both.density, i) * std::pow(seen.eye_distance, 2),
                                      0.03 * std::pow(seen.view_distance, 2));
      ASSERT_LT(double(surfel.area), 1.6 * allowed);
    }
  }
}

TEST_F(CameraSampling, StereoIsTheUnionOfTwoEyes) {
  const std::string floor = write("floor.ply", floorPly(30));
  SampleOptions stereo = overFloor(), union_of_two = overFloor();
  stereo.density.stereo = 0.5;
  union_of_two.density.cameras[0].eye.x = -0.25;
  union_of_two.density.cameras[0].look_at.x = -0.25;
  union_of_two.density.cameras.push_back({{0.25, 1, 0}, {0.25, 0.6, -4}, {}, 40});
  const std::vector<Surfel> expected = sample(floor, union_of_two);
  EXPECT_GT(expected.size(), sample(floor, overFloor()).size());
  const std::vector<Surfel> surfels = sample(floor, stereo);
  ASSERT_NEAR(double(surfels.size()), double(expected.size()), 2);
}

TEST_F(CameraSampling, WhatIsHiddenIsSampledToo) {
  SampleOptions options = overFloor();
  const std::size_t bare = sample(write("floor.ply", floorPly(30)), options).size();
  const std::string wall =
      plyText({{-3, -0.01f, -2}, {3, -0.01f, -2}, {3, 3, -2}, {-3, 3, -2}}, {{0, 1, 2, 3}});
  write("wall.ply", wall);
  const std::size_t walls = sample(path("wall.ply"), options).size();
  Result<SampleStats> stats =
      sampleMeshes({path("floor.ply"), path("wall.ply")}, path("both.ply"), options, notes_);
  ASSERT_TRUE(stats.ok());
  EXPECT_NEAR(double(stats->surfels), double(bare + walls), 2);
}

TEST_F(CameraSampling, ThreadsDoNotChangeABitAndAMoveChangesFewSurfels) {
  const std::string floor = write("floor.ply", fineFloor(60, 30));
  SampleOptions options = overFloor();
  options.surroundings.lights.points.push_back({{0, 3, -3}, {5, 5, 5}});
  options.threads = 1;
  sample(floor, options);
  const std::string once = read(path("out.ply"));
  options.threads = 4;
  const std::vector<Surfel> surfels = sample(floor, options);
  EXPECT_EQ(read(path("out.ply")), once);

  // A hundredth of a pixel's width per frame changes next to nothing, 2 cm few
  const auto keyOf = [](const Surfel& surfel) {
    return std::tuple(surfel.position.x, surfel.position.z, surfel.radiosity.x);
  };
  std::set<std::tuple<float, float, float>> before;
  for (const Surfel& surfel : surfels) before.insert(keyOf(surfel));
  options.density.cameras[0].eye.z -= 0.02;
  options.density.cameras[0].look_at.z -= 0.02;
  std::size_t same = 0;
  const std::vector<Surfel> moved = sample(floor, options);
  for (const Surfel& surfel : moved) same += before.count(keyOf(surfel));
  EXPECT_GT(double(same), 0.95 * double(moved.size()));
}

TEST_F(CameraSampling, CamerasThatCannotWorkAreRefused) {
  const std::string floor = write("floor.ply", floorPly(3));
  const auto message = [&](const SampleOptions& options) {
    const auto stats = sampleMeshes({floor}, path("out.ply"), options, notes_);
    EXPECT_FALSE(stats.ok());
    return stats.ok() ? std::string() : stats.status().message();
  };
  SampleOptions options = overFloor();
  options.spacing = 0.1;
  EXPECT_THAT(message(options), HasSubstr("both a spacing and cameras"));
  options = overFloor();
  options.density.pixels = 0;
  EXPECT_THAT(message(options), HasSubstr("pixels: found 0"));
  options = overFloor();
  options.density.max_solid_angle = std::nan("");
  EXPECT_THAT(message(options), HasSubstr("max solid angle: found nan"));
  options = overFloor();
  options.density.cameras.push_back({{1, 2, 3}, {1, 2, 3}, {}, 40});
  EXPECT_THAT(message(options), HasSubstr("camera 2: the eye stands on the look-at point"));
  options.density.cameras[1].look_at.y = 9;
  EXPECT_THAT(message(options), HasSubstr("camera 2: the up direction is zero or lies along"));
  options = overFloor();
  options.density.cameras[0].fov_degrees = 0;
  EXPECT_THAT(message(options), HasSubstr("camera 1: the field of view"));
}

TEST_F(CameraSampling, CameraFilesHaveACameraALine) {
  const std::string good =
      write("good.txt", "# eye, look-at, fov\n0 1 2  3 4 5\r\n\n-1,0,0, 0,0,1, 55\n");
  const auto cameras = readDensityCameras(good, 35);
  ASSERT_TRUE(cameras.ok()) << cameras.status().message();
  ASSERT_EQ(cameras->size(), 2u);
  EXPECT_EQ((*cameras)[0].look_at, glm::dvec3(3, 4, 5));
  EXPECT_EQ((*cameras)[0].fov_degrees, 35);
  EXPECT_EQ((*cameras)[1].fov_degrees, 55);
  for (const std::string text : {"1 2 3 4 5\n", "1 2 3 4 5 6 7 8\n", "1 2 3 4 5 x\n"}) {
    const auto bad = readDensityCameras(write("bad.txt", "0 0 0 1 1 1\n" + text), 35);
    ASSERT_FALSE(bad.ok());
    EXPECT_THAT(bad.status().message(), HasSubstr("bad.txt: line 2"));
  }
  EXPECT_FALSE(readDensityCameras(write("empty.txt", "# none\n"), 35).ok());
  EXPECT_FALSE(readDensityCameras(path("absent.txt"), 35).ok());
}

}  // namespace
}  // namespace surfeit
