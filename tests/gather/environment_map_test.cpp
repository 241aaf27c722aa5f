#include "gather/light/environment_map.h"

#include <OpenEXR/ImfEnvmap.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <functional>
#include <glm/geometric.hpp>
#include <string>
#include <vector>

#include "batch/environment_file.h"
#include "core/spherical_harmonics.h"
#include "gather/environment_pictures.h"

namespace surfeit {
namespace {

using testing::AllOf;
using testing::HasSubstr;

constexpr double kPiExact = 3.14159265358979323846;

class Notes : public Progress {
 public:
  void note(const std::string& message) override { notes.push_back(message); }
  std::vector<std::string> notes;
};

class EnvironmentMapTest : public DirectoryTest {
 protected:
  GatherEnvironment environment(const std::string& name) const {
    GatherEnvironment result;
    result.path = path(name);
    return result;
  }
  // Through a file, as everything.
  EnvironmentMap load(const TestPicture& picture, float rotation = 0, bool y_is_up = false,
                      float intensity = 1) const {
    GatherEnvironment options = environment("map.exr");
    options.rotation = rotation;
    options.up = y_is_up ? UpAxis::kY : UpAxis::kZ;
    options.intensity = intensity;
    writeExr(picture, options.path);
    return load(options);
  }
  static EnvironmentMap load(const GatherEnvironment& options) {
    Progress progress;
    Result<EnvironmentMap> map = loadEnvironmentMap(options, progress);
    EXPECT_TRUE(map.ok()) << map.status().message();
    return std::move(*map);
  }
  Status failure(const GatherEnvironment& options) const {
    Progress progress;
    return loadEnvironmentMap(options, progress).status();
  }
  Status failure(const std::string& name) const { return failure(environment(name)); }
};

// Integral of a lat-long picture over the sphere.
glm::dvec3 powerOf(const TestPicture& picture) {
  glm::dvec3 power(0);
  for (int row = 0; row < picture.height; ++row) {
    const double heights =
        std::cos(kPiExact * row / picture.height) - std::cos(kPiExact * (row + 1) / picture.height);
    for (int column = 0; column < picture.width; ++column) {
      power += heights * 2 * kPiExact / picture.width * glm::dvec3(picture.at(column, row));
    }
  }
  return power;
}

glm::dvec3 powerOf(const EnvironmentCube& cube, const RasterGeometry& geometry) {
  glm::dvec3 power(0);
  for (std::size_t i = 0; i < cube.pixels().size(); ++i) {
    power += double(geometry.pixels()[i].solid_angle) * glm::dvec3(cube.pixels()[i]);
  }
  return power;
}

void expectNear(const glm::dvec3& found, const glm::dvec3& expected, double relative,
                const std::string& what) {
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(found[i], expected[i], relative * std::abs(expected[i]) + 1e-30)
        << what << " " << i;
  }
}

TestPicture constantPicture(int height, const glm::vec3& value) {
  return TestPicture(2 * height, height, [&](int, int) { return value; });
}
TestPicture texelPicture(int height, int column, int row) {
  return TestPicture(2 * height, height, [&](int x, int y) {
    return x == column && y == row ? glm::vec3(1000, 2, 3e7f) : glm::vec3(0);
  });
}
// Reproducible noise with bright spots.
TestPicture noisePicture(int height) {
  std::uint32_t state = 12345;
  return TestPicture(2 * height, height, [&](int, int) {
    glm::vec3 value;
    for (int i = 0; i < 3; ++i) {
      state = state * 1664525u + 1013904223u;
      value[i] = std::exp(float(state >> 8) / float(1 << 24) * 8 - 5);
    }
    return value;
  });
}
// Texels with the mean of what lies in their middle: for smooth functions of direction.
TestPicture smoothPicture(int height, const std::function<glm::vec3(const glm::dvec3&)>& light) {
  return TestPicture(2 * height, height, [&](int x, int y) {
    return light(latLongDirection((x + .5) / (2 * height), (y + .5) / height));
  });
}

std::vector<glm::vec3> directionsAround(int count) {
  std::vector<glm::vec3> directions;
  for (int i = 0; i < count; ++i) {
    const double z = 1 - (2. * i + 1) / count, phi = i * 2.399963229728653;
    const double rho = std::sqrt(1 - z * z);
    directions.push_back(glm::vec3(rho * std::cos(phi), rho * std::sin(phi), z));
  }
  return directions;
}

TEST_F(EnvironmentMapTest, CubeKeepsThePowerOfEveryMapAtEveryRotation) {
  const std::vector<TestPicture> pictures = {constantPicture(1, {1, 2, 3}),
                                             constantPicture(33, {1, 2, 3}),
                                             texelPicture(1, 1, 0),
                                             texelPicture(7, 3, 2),
                                             texelPicture(100, 0, 0),
                                             texelPicture(100, 57, 41),
                                             texelPicture(100, 199, 99),
                                             noisePicture(19),
                                             smoothPicture(64, [](const glm::dvec3& d) {
                                               return glm::vec3(1 + d.x, 2 - d.y, 3 + 2 * d.z);
                                             })};
  for (const TestPicture& picture : pictures) {
    const glm::dvec3 expected = kPiExact * powerOf(picture);
    for (const float rotation : {0.f, .3f, -1.5707964f, 100.f}) {
      const EnvironmentMap map = load(picture, rotation, rotation > 0);
      expectNear(4 * kPiExact * glm::dvec3(map.mean()), expected, 1e-6, "mean");
      for (const int resolution : {2, 12, 64}) {
        const RasterGeometry geometry(resolution);
        const EnvironmentCube cube(map, geometry);
        expectNear(powerOf(cube, geometry), expected, 1e-6, std::to_string(resolution));
      }
    }
  }
}

TEST_F(EnvironmentMapTest, ConstantMapIsConstantInEveryPixel) {
  for (const int height : {1, 5, 128}) {
    const EnvironmentMap map = load(constantPicture(height, {1, .5f, 4}), .7f, false, 2);
    for (int resolution = 2; resolution <= 64; resolution += 2) {
      const EnvironmentCube cube(map, RasterGeometry(resolution));
      for (const glm::vec3& pixel : cube.pixels()) {
        expectNear(pixel, 2 * kPiExact * glm::dvec3(1, .5, 4), 1e-5, std::to_string(resolution));
      }
    }
  }
}

TEST_F(EnvironmentMapTest, PixelsAreMeansOverTheirSolidAngles) {
  // Against many samples of each pixel, found by the definition of the orientation
  const TestPicture picture = noisePicture(9);
  const float rotation = .4f;
  for (const bool y_is_up : {false, true}) {
    const EnvironmentMap map = load(picture, rotation, y_is_up);
    const RasterGeometry geometry(6);
    const EnvironmentCube cube(map, geometry);
    constexpr int kSamples = 40000;
    for (std::size_t i = 0; i < cube.pixels().size(); ++i) {
      const int face = int(i) / 36, axis = face / 2, row = int(i) / 6 % 6, column = int(i) % 6;
      glm::dvec3 sum(0);
      double weights = 0;
      for (int s = 0; s < kSamples; ++s) {
        const auto fraction = [&](double step) { return s * step - std::floor(s * step); };
        glm::dvec3 d;
        d[axis] = face % 2 == 0 ? 1 : -1;
        d[(axis + 1) % 3] = -1 + (column + fraction(.7548776662466927)) / 3;
        d[(axis + 2) % 3] = -1 + (row + fraction(.5698402909980532)) / 3;
        const double weight = std::pow(glm::length(d), -3);
        sum +=
            weight * glm::dvec3(picture.lookup(y_is_up ? glm::dvec3(d.z, d.x, d.y) : d, rotation));
        weights += weight;
      }
      const glm::dvec3 mean = kPiExact / weights * sum;  // up to 20, of which samples miss .002
      for (int c = 0; c < 3; ++c)
        EXPECT_NEAR(cube.pixels()[i][c], mean[c], .005 + .002 * mean[c]) << i;
    }
  }
}

TEST_F(EnvironmentMapTest, OrientationIsAsDocumented) {
  struct Spot {
    int column, row;
    float rotation;
    bool y_is_up;
    glm::vec3 direction;
  };
  constexpr float kRight = kPi / 2;
  // Columns and rows around the middle and at quarters of a map of 64 x 32
  const std::vector<Spot> spots = {
      {32, 16, 0, false, {1, 0, 0}},        {16, 16, 0, false, {0, 1, 0}},
      {48, 16, 0, false, {0, -1, 0}},       {0, 16, 0, false, {-1, 0, 0}},
      {5, 0, 0, false, {0, 0, 1}},          {5, 31, 0, false, {0, 0, -1}},
      {32, 16, kRight, false, {0, 1, 0}},   {32, 16, -kRight, false, {0, -1, 0}},
      {32, 16, 0, true, {0, 0, 1}},         {16, 16, 0, true, {1, 0, 0}},
      {5, 0, 0, true, {0, 1, 0}},           {32, 16, kRight, true, {1, 0, 0}},
      {32, 16, 5 * kRight, true, {1, 0, 0}}};
  for (const Spot& spot : spots) {
    const EnvironmentMap map =
        load(texelPicture(32, spot.column, spot.row), spot.rotation, spot.y_is_up);
    glm::vec3 toward(0);
    const RasterGeometry geometry(32);
    const EnvironmentCube cube(map, geometry);
    for (std::size_t i = 0; i < cube.pixels().size(); ++i) {
      toward +=
          cube.pixels()[i].x * geometry.pixels()[i].solid_angle * geometry.pixels()[i].direction;
    }
    EXPECT_GT(glm::dot(glm::normalize(toward), spot.direction), .99f) << spot.column;
    const auto lookup = [&](const glm::vec3& d) { return map.lookup(d, .01f).x; };
    EXPECT_GT(lookup(spot.direction + .02f * glm::normalize(toward)), 30.f) << spot.column;
    EXPECT_EQ(lookup(-spot.direction), 0) << spot.column;
  }
}

TEST_F(EnvironmentMapTest, OpenSkyGivesPiTimesItsRadiance) {
  const RasterGeometry geometry(12);
  const EnvironmentCube cube(load(constantPicture(64, {3, 1, 0})), geometry);
  const glm::vec3 normal = glm::normalize(glm::vec3(1, 2, 3));
  glm::dvec3 sum(0);
  double weights = 0;
  for (std::size_t i = 0; i < cube.pixels().size(); ++i) {
    const RasterGeometry::Pixel& pixel = geometry.pixels()[i];
    const double weight =
        double(pixel.solid_angle) * std::max(0., double(glm::dot(pixel.direction, normal)));
    sum += weight * glm::dvec3(cube.pixels()[i]);
    weights += weight;
  }
  expectNear(sum / weights, {3 * kPiExact, kPiExact, 0}, 1e-5, "irradiance");
}

TEST_F(EnvironmentMapTest, LookupOfConstantMapIsConstant) {
  const EnvironmentMap map = load(constantPicture(200, {1, 2, 0}), 1);
  std::vector<glm::vec3> directions = directionsAround(20000);
  for (int i = 0; i < 27; ++i) {  // poles, and seams of the square and of the picture
    const glm::vec3 d(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1);
    if (d == glm::vec3(0)) continue;
    directions.push_back(glm::normalize(d));
    directions.push_back(glm::normalize(d + glm::vec3(1e-6f, -1e-6f, 1e-6f)));
  }
  for (const glm::vec3& direction : directions) {
    for (const float solid_angle : {0.f, 1e-4f, 1e-3f, .1f, 3.f, 12.6f}) {
      expectNear(map.lookup(direction, solid_angle), {kPiExact, 2 * kPiExact, 0}, 1e-5, "lookup");
    }
  }
}

TEST_F(EnvironmentMapTest, LookupsKeepThePowerOfTheMap) {
  const std::vector<glm::vec3> directions = directionsAround(400000);
  for (const TestPicture& picture : {texelPicture(50, 13, 25), texelPicture(50, 0, 0),
                                     texelPicture(50, 90, 37), noisePicture(40)}) {
    const EnvironmentMap map = load(picture, .6f);
    for (const float solid_angle : {.01f, .05f, .6f, 20.f}) {
      glm::dvec3 sum(0);
      for (const glm::vec3& d : directions) sum += glm::dvec3(map.lookup(d, solid_angle));
      expectNear(sum / double(directions.size()), map.mean(), .002, std::to_string(solid_angle));
    }
  }
}

TEST_F(EnvironmentMapTest, LookupsSpreadOverTheirSolidAngle) {
  // The share of weights squared tells their effective solid angle
  const EnvironmentMap map = load(texelPicture(512, 300, 200));
  const std::vector<glm::vec3> directions = directionsAround(400000);
  for (const float solid_angle : {.01f, .03f, .1f, .5f}) {
    double sum = 0, sum_sq = 0;
    for (const glm::vec3& d : directions) {
      const double value = double(map.lookup(d, solid_angle).x);
      sum += value;
      sum_sq += value * value;
    }
    const double effective = 4 * kPiExact * sum * sum / (sum_sq * double(directions.size()));
    EXPECT_GT(effective / double(solid_angle), .6);
    EXPECT_LT(effective / double(solid_angle), 1.7);
  }
}

TEST_F(EnvironmentMapTest, LookupOfSmoothLightIsThatLight) {
  const auto light = [](const glm::dvec3& d) {
    return glm::vec3(1 + d.x, 2 + d.y * d.z, 1.5 - d.z);
  };
  const EnvironmentMap map = load(smoothPicture(512, light));
  for (const glm::vec3& d : directionsAround(5000)) {
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(map.lookup(d, 1e-4f)[i], kPi * light(d)[i], .01);
  }
}

TEST_F(EnvironmentMapTest, CubeMapsLieAsOpenExrSays) {
  for (const int edge : {5, 8, 20}) {
    const Imath::Box2i window({0, 0}, {edge - 1, 6 * edge - 1});
    for (const glm::vec3& d : directionsAround(40)) {
      Imf::CubeMapFace face;
      Imath::V2f in_face;
      Imf::CubeMap::faceAndPixelPosition({d.x, d.y, d.z}, window, face, in_face);
      // The middles of its outer pixels are the edges of the cube, for us those of the picture are
      const auto ours = [&](float at) {
        return float(std::min(int(at / float(edge - 1) * float(edge)), edge - 1));
      };
      const Imath::V2f place =
          Imf::CubeMap::pixelPosition(face, window, {ours(in_face.x), ours(in_face.y)});
      TestPicture picture(edge, 6 * edge, [&](int x, int y) {
        return x == int(place.x) && y == int(place.y) ? glm::vec3(1) : glm::vec3(0);
      });
      picture.is_cube_map = true;

      const EnvironmentMap map = load(picture, 0, true);
      const RasterGeometry geometry(32);
      const EnvironmentCube cube(map, geometry);
      glm::vec3 toward(0);
      for (std::size_t i = 0; i < cube.pixels().size(); ++i) {
        toward +=
            cube.pixels()[i].x * geometry.pixels()[i].solid_angle * geometry.pixels()[i].direction;
      }
      EXPECT_GT(glm::dot(glm::normalize(toward), d), 1 - 2 / float(edge * edge) - .002f)
          << edge << ": " << d.x << " " << d.y << " " << d.z;
      expectNear(powerOf(cube, geometry), 4 * kPiExact * glm::dvec3(map.mean()), 1e-6, "power");
    }
  }
}

TEST_F(EnvironmentMapTest, CubeAndLatLongMapsOfOneLightAgree) {
  const auto light = [](const glm::dvec3& d) {
    return glm::vec3(1 + d.x, 2 + d.y, 1.5 + d.z * d.x);
  };
  TestPicture cube_picture = smoothCubePicture(96, light);
  for (const float rotation : {0.f, 1.2f}) {
    const RasterGeometry geometry(12);
    const EnvironmentCube lat_long(load(smoothPicture(128, light), rotation), geometry);
    const EnvironmentCube cube(load(cube_picture, rotation), geometry);
    for (std::size_t i = 0; i < cube.pixels().size(); ++i) {
      for (int c = 0; c < 3; ++c) EXPECT_NEAR(cube.pixels()[i][c], lat_long.pixels()[i][c], .003);
    }
  }
}

TEST_F(EnvironmentMapTest, LargePicturesAreReducedWithTheirPower) {
  for (const int height : {1025, 1400}) {
    const TestPicture picture(2 * height, height, [&](int x, int y) {
      return glm::vec3(x == 777 && y == 1023 ? 1e6f : 0, y == 0 || y == height - 1 ? 1e4f : 1,
                       .25f);
    });
    const EnvironmentMap map = load(picture);
    expectNear(4 * kPiExact * glm::dvec3(map.mean()), kPiExact * powerOf(picture), 1e-6, "power");
    EXPECT_LE(map.memoryBytes(), std::size_t(42) << 20);
    const EnvironmentCube cube(map, RasterGeometry(12));
    for (const glm::vec3& pixel : cube.pixels()) EXPECT_NEAR(pixel.z, kPi / 4, 1e-4);
  }
  TestPicture cube_picture = smoothCubePicture(
      1024, [](const glm::dvec3& d) { return glm::vec3(1, d.x > 0 ? 2 : 0, 1 + d.z); });
  const EnvironmentMap map = load(cube_picture);
  expectNear(map.mean(), glm::dvec3(kPiExact), 1e-4, "mean");
  EXPECT_LE(map.memoryBytes(), std::size_t(42) << 20);
}

TEST_F(EnvironmentMapTest, PixelsThatAreNoLightAreNotedOnce) {
  TestPicture picture = constantPicture(8, glm::vec3(1));
  picture.at(3, 2) = {-1, 1, 1};
  picture.at(4, 2) = {1, std::nanf(""), INFINITY};
  writeExr(picture, path("map.exr"));
  Notes notes;
  const Result<EnvironmentMap> map = loadEnvironmentMap(environment("map.exr"), notes);
  ASSERT_TRUE(map.ok());
  EXPECT_THAT(notes.notes,
              testing::ElementsAre(AllOf(HasSubstr("map.exr"), HasSubstr("2 of 128"))));
  EXPECT_LT(map->mean().y, kPi);
  EXPECT_GT(map->mean().z, .95f * kPi);
}

TEST_F(EnvironmentMapTest, RefusesWhatIsNoEnvironment) {
  writeExr(TestPicture(10, 4, [](int, int) { return glm::vec3(1); }), path("wide.exr"));
  EXPECT_THAT(failure("wide.exr").message(),
              AllOf(HasSubstr("wide.exr: 10 x 4"), HasSubstr("expected a lat-long picture")));
  TestPicture cube = smoothCubePicture(4, [](const glm::dvec3&) { return glm::vec3(1); });
  cube.height -= 1;
  writeExr(cube, path("cube.exr"));
  EXPECT_THAT(failure("cube.exr").message(), HasSubstr("4 x 23 pixels, expected a cube map"));
  EXPECT_EQ(failure("cube.exr").code(), StatusCode::kInvalidArgument);

  writeExr(constantPicture(4, glm::vec3(1e25f)), path("map.exr"));
  GatherEnvironment options = environment("map.exr");
  EXPECT_TRUE(failure(options).ok());
  options.intensity = 1e10f;
  EXPECT_THAT(failure(options).message(), HasSubstr("expected at most 1e+30"));
  for (const float intensity : {-1.f, float(INFINITY), std::nanf("")}) {
    options.intensity = intensity;
    EXPECT_EQ(failure(options).code(), StatusCode::kInvalidArgument);
  }
  options.intensity = 0;
  EXPECT_TRUE(failure(options).ok());
  options.rotation = INFINITY;
  EXPECT_THAT(failure(options).message(), HasSubstr("rotation of the environment: inf"));
}

TEST_F(EnvironmentMapTest, RealMapsKeepTheirPower) {
  const std::filesystem::path directory = std::filesystem::path(SURFEIT_SHARED_DATA_DIR) / "hdr";
  if (!std::filesystem::exists(directory)) GTEST_SKIP() << "no " << directory;
  // Mean luminances of the data's own list
  for (const auto& [name, luminance] : {std::pair("KernerEnvLatLong.exr", .186),
                                        {"empty_warehouse_01_1k.hdr", .775},
                                        {"noon_grass_1k.hdr", .558}}) {
    if (!std::filesystem::exists(directory / name)) continue;
    GatherEnvironment options;
    options.path = (directory / name).string();
    const EnvironmentMap map = load(options);
    const glm::dvec3 mean = glm::dvec3(map.mean()) / kPiExact;
    EXPECT_NEAR(glm::dot(mean, glm::dvec3(.2126, .7152, .0722)), luminance, .001) << name;
    for (const int resolution : {8, 12, 32}) {
      const RasterGeometry geometry(resolution);
      expectNear(powerOf(EnvironmentCube(map, geometry), geometry), 4 * kPiExact * kPiExact * mean,
                 1e-6, name);
    }
  }
}

}  // namespace
}  // namespace surfeit
