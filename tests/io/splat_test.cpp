#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "cloud/ply/ply_rows.h"
#include "cloud/ply/splat_reader.h"
#include "io/row_damage_test.h"

namespace surfeit {
namespace {

struct Splat {
  float position[3] = {1, 2, 3};
  float color[3] = {0, 0, 0};
  float opacity = 0;
  float scale[3] = {-1, -2, -5};
  float rotation[4] = {1, 0, 0, 0};
};

class SplatTest : public RowFileTest {
 protected:
  std::string ply(const std::vector<Splat>& splats, bool has_third_scale = true) const {
    std::string text = "ply\nformat binary_little_endian 1.0\nelement vertex " +
                       std::to_string(splats.size()) + "\n";
    for (const char* name :
         {"x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2", "f_rest_0", "f_rest_1",
          "opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"}) {
      if (has_third_scale || std::string(name) != "scale_2") {
        text += "property float " + std::string(name) + "\n";
      }
    }
    text += "property uchar group\nend_header\n";
    const auto put = [&](const float* values, std::size_t count) {
      text.append(reinterpret_cast<const char*>(values), count * sizeof(float));
    };
    const float unused[3] = {0, 0, 0};
    for (const Splat& splat : splats) {
      put(splat.position, 3);
      put(unused, 3);
      put(splat.color, 3);
      put(unused, 2);
      put(&splat.opacity, 1);
      put(splat.scale, has_third_scale ? 3 : 2);
      put(splat.rotation, 4);
      text += '\x05';
    }
    return text;
  }

  std::unique_ptr<RowReader> openSplats(const std::vector<Splat>& splats,
                                        bool has_third_scale = true) {
    write("a.ply", ply(splats, has_third_scale));
    return openOk(openPlyRows, path("a.ply"));
  }
};

TEST_F(SplatTest, RowsAreDisks) {
  const auto reader = openSplats({Splat()});
  ASSERT_NE(reader, nullptr);
  EXPECT_EQ(reader->formatName(), "PLY of Gaussian splats");
  EXPECT_EQ(describeRow(reader->element()),
            "float x, float y, float z, uchar group, float nx, float ny, float nz, float radius, "
            "float red, float green, float blue, float opacity, float coverage, uchar two_sided");
  const std::vector<std::byte> rows = readAllRows(*reader);
  EXPECT_EQ(valueOf(*reader, rows, 0, "y"), 2);
  EXPECT_EQ(valueOf(*reader, rows, 0, "group"), 5);
  EXPECT_EQ(valueOf(*reader, rows, 0, "nz"), 1);
  EXPECT_EQ(valueOf(*reader, rows, 0, "two_sided"), 1);
  EXPECT_EQ(valueOf(*reader, rows, 0, "opacity"), 0.5);
  EXPECT_EQ(valueOf(*reader, rows, 0, "coverage"), 0.5);
  EXPECT_NEAR(valueOf(*reader, rows, 0, "radius"), std::sqrt(2 * std::exp(-1.0) * std::exp(-2.0)),
              1e-6);
  EXPECT_NEAR(valueOf(*reader, rows, 0, "red"), std::pow((0.5 + 0.055) / 1.055, 2.4), 1e-6);
  bool tells_rest = false;
  for (const std::string& note : reader->notes()) {
    tells_rest = tells_rest || note.find("f_rest_0 to f_rest_1") != std::string::npos;
  }
  EXPECT_TRUE(tells_rest);
}

TEST_F(SplatTest, AreaIsTheIntegralOfTheGaussian) {
  // Summed over a grid: exp(-(u / s1)^2 / 2 - (v / s2)^2 / 2)
  Splat splat;
  const double s1 = 0.3, s2 = 0.1;
  splat.scale[0] = float(std::log(s1));
  splat.scale[1] = float(std::log(s2));
  double integral = 0;
  const double step = 0.005;
  for (double u = -3; u < 3; u += step) {
    for (double v = -1; v < 1; v += step) {
      integral += std::exp(-u * u / (2 * s1 * s1) - v * v / (2 * s2 * s2)) * step * step;
    }
  }
  const auto reader = openSplats({splat});
  ASSERT_NE(reader, nullptr);
  const double radius = valueOf(*reader, readAllRows(*reader), 0, "radius");
  EXPECT_NEAR(3.14159265 * radius * radius, integral, 1e-4);
}

TEST_F(SplatTest, NormalIsTheRotatedShortestAxis) {
  // A quarter turn around z, of length 2, brings x to y; then each axis in turn is the shortest
  const float half = float(std::sqrt(2.0));
  std::vector<Splat> splats(3);
  const float expected[3][3] = {{0, 1, 0}, {-1, 0, 0}, {0, 0, 1}};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    splats[axis].rotation[0] = half;
    splats[axis].rotation[3] = half;
    for (float& scale : splats[axis].scale) scale = 0;
    splats[axis].scale[axis] = -3;
  }
  const auto reader = openSplats(splats);
  ASSERT_NE(reader, nullptr);
  const std::vector<std::byte> rows = readAllRows(*reader);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    EXPECT_NEAR(valueOf(*reader, rows, axis, "nx"), expected[axis][0], 1e-6) << axis;
    EXPECT_NEAR(valueOf(*reader, rows, axis, "ny"), expected[axis][1], 1e-6) << axis;
    EXPECT_NEAR(valueOf(*reader, rows, axis, "nz"), expected[axis][2], 1e-6) << axis;
  }
}

TEST_F(SplatTest, FlatSplatsHaveTheirThirdAxisAsNormal) {
  Splat splat;
  splat.rotation[0] = splat.rotation[1] = float(std::sqrt(0.5));  // y to z, z to -y
  const auto reader = openSplats({splat}, false);
  ASSERT_NE(reader, nullptr);
  const std::vector<std::byte> rows = readAllRows(*reader);
  EXPECT_NEAR(valueOf(*reader, rows, 0, "ny"), -1, 1e-6);
  EXPECT_NEAR(valueOf(*reader, rows, 0, "radius"), std::sqrt(2 * std::exp(-3.0)), 1e-6);
}

TEST_F(SplatTest, ColorsAndOpacitiesAtTheirEnds) {
  std::vector<Splat> splats(2);
  splats[0].color[0] = -10;                               // darker than black
  splats[0].color[1] = float(0.5 / 0.28209479177387814);  // white
  splats[0].opacity = -1000;
  splats[1].opacity = 1000;
  const auto reader = openSplats(splats);
  ASSERT_NE(reader, nullptr);
  const std::vector<std::byte> rows = readAllRows(*reader);
  EXPECT_EQ(valueOf(*reader, rows, 0, "red"), 0);
  EXPECT_NEAR(valueOf(*reader, rows, 0, "green"), 1, 1e-6);
  EXPECT_EQ(valueOf(*reader, rows, 0, "opacity"), 0);
  EXPECT_EQ(valueOf(*reader, rows, 1, "opacity"), 1);
  EXPECT_FLOAT_EQ(float(valueOf(*reader, rows, 0, "coverage")), 1e-6f);  // an area is above 0
  EXPECT_EQ(valueOf(*reader, rows, 1, "coverage"), 1);
}

TEST_F(SplatTest, NamesOfCloudCompareAreThoseOfSplats) {
  std::string file = ply({Splat()});
  for (const char* name : {"f_dc_0", "f_dc_1", "f_dc_2", "f_rest_0", "f_rest_1", "opacity",
                           "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"}) {
    const std::string word = std::string(" ") + name + "\n";
    file.replace(file.find(word), 1, " scalar_");
  }
  write("a.ply", file);
  const auto reader = openOk(openPlyRows, path("a.ply"));
  ASSERT_NE(reader, nullptr);
  EXPECT_EQ(reader->formatName(), "PLY of Gaussian splats");
  EXPECT_EQ(valueOf(*reader, readAllRows(*reader), 0, "coverage"), 0.5);
}

// Splats as SuperSplat writes them: two chunks, the second short, with ranges of colors or without.
class PackedSplatTest : public RowFileTest {
 protected:
  static constexpr std::size_t kSplats = 300;

  std::string ply(bool has_colors, std::size_t chunks = 2) const {
    std::string text =
        "ply\nformat binary_little_endian 1.0\nelement chunk " + std::to_string(chunks) + "\n";
    std::vector<std::string> names;
    for (const char* what : {"", "scale_"}) {
      for (const char* end : {"min_", "max_"}) {
        for (const char* axis : {"x", "y", "z"}) names.push_back(std::string(end) + what + axis);
      }
    }
    for (const char* name : {"min_r", "min_g", "min_b", "max_r", "max_g", "max_b"}) {
      if (has_colors) names.emplace_back(name);
    }
    for (const std::string& name : names) text += "property float " + name + "\n";
    text += "element vertex " + std::to_string(kSplats) + "\n";
    for (const char* name :
         {"packed_position", "packed_rotation", "packed_scale", "packed_color"}) {
      text += "property uint " + std::string(name) + "\n";
    }
    text += "end_header\n";
    const auto put = [&](auto value) {
      text.append(reinterpret_cast<const char*>(&value), sizeof value);
    };
    for (std::size_t chunk = 0; chunk < chunks; ++chunk) {
      const float x = float(chunk) * 10;
      for (const float value : {x, 0.f, 0.f, x + 2, 4.f, 8.f}) put(value);
      for (const float value : {-1.f, -2.f, -9.f, -1.f, -2.f, -7.f}) put(value);
      for (const float value : {0.f, 0.f, 0.f, 2.f, 1.f, 1.f}) {
        if (has_colors) put(value);
      }
    }
    for (std::size_t i = 0; i < kSplats; ++i) {
      put(std::uint32_t{2047u << 21 | 0u << 11 | 2047u});  // x and z at their most, y at its least
      put(std::uint32_t{1u << 30 | 512u << 20 | 512u << 10 | 512u});  // about x by half a turn
      put(std::uint32_t{0});
      put(std::uint32_t{255u << 24 | 0u << 16 | 0u << 8 | 51u});
    }
    return text;
  }
};

TEST_F(PackedSplatTest, RangesOfChunksGiveValues) {
  write("a.ply", ply(false));
  const auto reader = openOk(openPlyRows, path("a.ply"));
  ASSERT_NE(reader, nullptr);
  EXPECT_EQ(reader->formatName(), "PLY, compressed by SuperSplat, of Gaussian splats");
  const std::vector<std::byte> rows = readAllRows(*reader);
  ASSERT_EQ(reader->element().count, kSplats);
  for (const std::size_t row : {std::size_t{0}, std::size_t{255}, std::size_t{256}, kSplats - 1}) {
    EXPECT_EQ(valueOf(*reader, rows, row, "x"), row < 256 ? 2 : 12) << row;
    EXPECT_EQ(valueOf(*reader, rows, row, "y"), 0);
    EXPECT_EQ(valueOf(*reader, rows, row, "z"), 8);
    EXPECT_NEAR(valueOf(*reader, rows, row, "radius"), std::sqrt(2 * std::exp(-3.0)), 1e-6);
    EXPECT_NEAR(valueOf(*reader, rows, row, "nz"), -1, 1e-5);  // z turned by half a turn about x
    EXPECT_NEAR(valueOf(*reader, rows, row, "red"), 1, 1e-6);
    EXPECT_NEAR(valueOf(*reader, rows, row, "green"), 0, 1e-6);
    EXPECT_NEAR(valueOf(*reader, rows, row, "coverage"), 0.2, 1e-6);
  }
}

TEST_F(PackedSplatTest, RangesOfColorsCount) {
  write("a.ply", ply(true));
  const auto reader = openOk(openPlyRows, path("a.ply"));
  ASSERT_NE(reader, nullptr);
  const double code = 2;  // a red from 0 to 2, at its most
  EXPECT_NEAR(valueOf(*reader, readAllRows(*reader), 0, "red"),
              std::pow((code + 0.055) / 1.055, 2.4), 1e-4);
}

TEST_F(PackedSplatTest, ReadersKeepTheirContract) {
  write("a.ply", ply(true));
  const auto reader = openOk(openPlyRows, path("a.ply"));
  ASSERT_NE(reader, nullptr);
  EXPECT_TRUE(reader->isSeekable());
  expectReaderKeepsContract(*reader);
}

TEST_F(PackedSplatTest, TooFewChunksAreRefused) {
  write("a.ply", ply(false, 1));
  const Result<std::unique_ptr<RowReader>> reader = openPlyRows(path("a.ply"), {});
  ASSERT_FALSE(reader.ok());
  EXPECT_NE(reader.status().message().find("found 1 rows, expected 2"), std::string::npos)
      << reader.status().message();
}

TEST_F(PackedSplatTest, EveryTruncationIsRefused) {
  const std::string file = ply(false);
  expectEveryTruncationFails(openPlyRows, file, file.size());
}

TEST_F(SplatTest, ManySplatsKeepTheContractOfReaders) {
  std::vector<Splat> splats(10'000);
  for (std::size_t i = 0; i < splats.size(); ++i) splats[i].position[0] = float(i);
  const auto reader = openSplats(splats);
  ASSERT_NE(reader, nullptr);
  expectReaderKeepsContract(*reader);
}

TEST_F(SplatTest, BrokenRotationsBecomeNotANumber) {
  Splat splat;
  splat.rotation[0] = 0;
  const auto reader = openSplats({splat});
  ASSERT_NE(reader, nullptr);
  EXPECT_TRUE(std::isnan(valueOf(*reader, readAllRows(*reader), 0, "nx")));
}

TEST_F(SplatTest, OtherCloudsAreLeftAlone) {
  write("a.ply",
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty "
        "float z\nproperty float opacity\nend_header\n1 2 3 4\n");
  const auto reader = openOk(openPlyRows, path("a.ply"));
  ASSERT_NE(reader, nullptr);
  EXPECT_EQ(reader->formatName(), "PLY");
  EXPECT_EQ(describeRow(reader->element()), "float x, float y, float z, float opacity");
}

TEST_F(SplatTest, EveryTruncationIsRefused) {
  const std::string file = ply({Splat(), Splat()});
  expectEveryTruncationFails(openPlyRows, file, file.size());
}

}  // namespace
}  // namespace surfeit
