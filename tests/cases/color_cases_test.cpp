// Colors of many names and types give the same light, and what is lost is told.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "cases/case_files.h"
#include "cloud/cloud_formats.h"
#include "io/row_stream_test.h"
#include "io/test_directory.h"
#include "surfeit/bake.h"
#include "surfeit/index.h"
#include "surfels/open_surfel_source.h"

namespace surfeit {
namespace {

using testing::Contains;
using testing::HasSubstr;

class ColorCasesTest : public DirectoryTest {
 protected:
  static constexpr const char* kCases = SURFEIT_SHARED_DATA_DIR "/../cases/";

  std::string receivers() const {
    write("receivers.ply",
          "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty "
          "float z\nproperty float nx\nproperty float ny\nproperty float nz\nend_header\n"
          "0 0 0 0 0 1\n");
    return path("receivers.ply");
  }

  void index(const std::string& cloud, Progress& progress, const IndexOptions& options = {}) const {
    const auto stats = indexClouds({cloud}, path("scene.sft"), options, progress);
    ASSERT_TRUE(stats.ok()) << stats.status().message();
  }

  // Means over the receivers of what a gather of the scene gives.
  double gather(const std::string& receivers_path, const char* name, GatherMode mode,
                Progress& progress, GatherSides sides = GatherSides::kFront) const {
    GatherOptions options;
    options.mode = mode;
    options.quality.max_solid_angle = 0;
    options.quality.sides = sides;
    const auto stats =
        gatherCloud(path("scene.sft"), receivers_path, path("result.ply"), options, progress);
    EXPECT_TRUE(stats.ok()) << stats.status().message();
    const auto reader = openRowReader(path("result.ply"));
    EXPECT_TRUE(reader.ok());
    if (!reader.ok()) return -1;
    const std::vector<std::byte> rows = readAllRows(**reader);
    double sum = 0;
    for (std::size_t i = 0; i < (*reader)->element().count; ++i) {
      sum += valueOf(**reader, rows, i, name);
    }
    return sum / double((*reader)->element().count);
  }

  double irradiance(const std::string& cloud, Progress& progress) const {
    index(cloud, progress);
    return gather(receivers(), "irradiance_r", GatherMode::kBleeding, progress);
  }

  // A dome of disks that face the receiver, all of the same color, 117 73 49 of 255.
  std::string dome(const std::string& type, const std::string& names, double scale = 1) const {
    std::string text =
        "ply\nformat ascii 1.0\nelement vertex 200\nproperty float x\nproperty float y\nproperty "
        "float z\nproperty float nx\nproperty float ny\nproperty float nz\nproperty float "
        "radius\n";
    for (std::size_t at = 0; at < names.size();) {
      const std::size_t end = std::min(names.find(' ', at), names.size());
      text += "property " + type + " " + names.substr(at, end - at) + "\n";
      at = end + 1;
    }
    text += "end_header\n";
    for (int i = 0; i < 200; ++i) {
      const double z = (i + 0.5) / 200, r = std::sqrt(1 - z * z), phi = 2.399963 * i;
      const double x = r * std::cos(phi), y = r * std::sin(phi);
      for (const double value : {x, y, z, -x, -y, -z, 0.12}) text += std::to_string(value) + " ";
      for (const double code : {117., 73., 49.}) {
        const double value = code * scale;
        text += type == "float" || type == "double" ? std::to_string(value)
                                                    : std::to_string(std::lround(value));
        text += ' ';
      }
      text += '\n';
    }
    write("dome.ply", text);
    return path("dome.ply");
  }
};

TEST_F(ColorCasesTest, LightIsTheSameForAllTypesAndNames) {
  Notes plain;
  const double expected = irradiance(dome("uchar", "red green blue"), plain);
  ASSERT_GT(expected, 0.05);
  EXPECT_THAT(plain.notes, Not(Contains(HasSubstr("--color-range"))));
  struct Variant {
    const char* type;
    const char* names;
    double scale;
    bool is_told;
  };
  for (const Variant& variant :
       {Variant{"ushort", "red green blue", 1, true}, Variant{"ushort", "r g b", 257, false},
        Variant{"int", "Red Green Blue", 1, true},
        Variant{"uint", "diffuse_red diffuse_green diffuse_blue", 257, true},
        Variant{"char", "red green blue", 1, true},
        Variant{"float", "scalar_R scalar_G scalar_B", 1, true},
        Variant{"double", "Rf Gf Bf", 1, true}}) {
    Notes notes;
    const double found = irradiance(dome(variant.type, variant.names, variant.scale), notes);
    EXPECT_NEAR(found, expected, 1e-4) << variant.type << " " << variant.names;
    const auto told = std::count_if(notes.notes.begin(), notes.notes.end(), [](const auto& note) {
      return note.find("read as sRGB") != note.npos;
    });
    EXPECT_EQ(told, variant.is_told ? 1 : 0) << variant.type << " " << variant.names;
  }
}

TEST_F(ColorCasesTest, LightInRealsStaysLight) {
  Notes notes;
  const double one = irradiance(dome("float", "red green blue", 0.01), notes);  // 1.17
  const double many = irradiance(dome("float", "red green blue", 3.3), notes);  // 386.1
  EXPECT_NEAR(many / one, 330, 1);
}

TEST_F(ColorCasesTest, DarkScenesAreTold) {
  Notes notes;
  EXPECT_EQ(irradiance(dome("uchar", "foo_red foo_green foo_blue"), notes), 0);
  EXPECT_THAT(notes.notes, Contains(HasSubstr("foo_red foo_green foo_blue look like a color")));
  EXPECT_THAT(notes.notes, Contains(HasSubstr("no surfel sends light")));
  Notes occlusion;
  gather(receivers(), "occlusion", GatherMode::kOcclusion, occlusion);
  EXPECT_THAT(occlusion.notes, Not(Contains(HasSubstr("no surfel sends light"))));
}

// Form factor of the rectangle 0..2 x 0..2 at a distance above (x, y), which faces it.
double sheetAbove(double x, double y, double distance) {
  const auto corner = [&](double a, double b) {
    const double u = std::hypot(a, distance), v = std::hypot(b, distance);
    return (a / u * std::atan(b / u) + b / v * std::atan(a / v)) / (2 * std::numbers::pi);
  };
  return corner(x, y) + corner(2 - x, y) + corner(x, 2 - y) + corner(2 - x, 2 - y);
}

// A sheet of random splats over receivers, as splat/*.ply.
TEST_F(ColorCasesTest, OpacityOfSplatsIsWhatTheyHide) {
  write(
      "below.ply",
      "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float "
      "z\nproperty float nx\nproperty float ny\nproperty float nz\nend_header\n"
      "0.9 0.9 -0.3 0 0 1\n1.1 1.2 -0.3 0 0 1\n");
  const auto hidden = [&](double opacity) {
    std::mt19937 random(1);
    std::uniform_real_distribution<float> place(0, 2);
    std::string text = "ply\nformat binary_little_endian 1.0\nelement vertex 400\n";
    for (const char* name : {"x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0",
                             "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"}) {
      text += "property float " + std::string(name) + "\n";
    }
    text += "end_header\n";
    const auto logit = float(std::log(opacity / (1 - opacity)));
    for (int i = 0; i < 400; ++i) {
      const float x = place(random), y = place(random);
      const float row[] = {x, y, 0, 0, 0, 0, logit, -2.5f, -2.5f, -6, 1, 0, 0, 0};
      text.append(reinterpret_cast<const char*>(row), sizeof row);
    }
    write("splats.ply", text);
    Notes notes;
    index(path("splats.ply"), notes);
    EXPECT_THAT(notes.notes, Contains(HasSubstr("their opacity becomes")));
    return gather(path("below.ply"), "occlusion", GatherMode::kOcclusion, notes,
                  GatherSides::kBoth);
  };
  // Opaque splats leave gaps. The areas of faint ones add up to their part of the whole sheet
  const double opaque = hidden(0.999),
               whole = (sheetAbove(.9, .9, .3) + sheetAbove(1.1, 1.2, .3)) / 2;
  EXPECT_GT(opaque, 0.8);
  EXPECT_NEAR(hidden(0.98), opaque, 0.03);
  EXPECT_LT(opaque, whole);
  EXPECT_NEAR(hidden(0.5), whole / 2, 0.02);
  EXPECT_NEAR(hidden(0.01), opaque / 100, 0.001);
}

TEST_F(ColorCasesTest, SharedPlyCasesAreAsPlain) {
  const std::string directory = std::string(kCases) + "ply/";
  if (!std::filesystem::exists(directory)) GTEST_SKIP() << "no shared cases in " << directory;
  Notes notes;
  const double expected = irradiance(directory + "plain.ply", notes);
  for (const char* name : {"rgb_names.ply", "float255.ply", "ushort255.ply", "int255.ply",
                           "upper_names.ply", "space_magic.ply", "normal_xyz.ply"}) {
    EXPECT_NEAR(irradiance(directory + name, notes), expected, 1e-6) << name;
  }
}

TEST_F(ColorCasesTest, SharedSplatCasesHideTheirOpacity) {
  const std::string directory = std::string(kCases) + "splat/";
  if (!std::filesystem::exists(directory)) GTEST_SKIP() << "no shared cases in " << directory;
  const auto hidden = [&](const char* name) {
    Notes notes;
    index(directory + name, notes);
    return gather(directory + "below.ply", "occlusion", GatherMode::kOcclusion, notes,
                  GatherSides::kBoth);
  };
  EXPECT_NEAR(hidden("plain.ply"), 0.86, 0.01);
  // By the form factor of a rectangle the whole sheet hides .9137 of what the receivers see: half
  // of it .457, a hundredth .0091. (The table of cases has half of .86, which random splats that
  // are opaque hide.)
  EXPECT_NEAR(hidden("half.ply"), 0.457, 0.015);
  EXPECT_NEAR(hidden("clear.ply"), 0.0091, 0.0002);
  EXPECT_NEAR(hidden("cloudcompare_names.ply"), 0.86, 0.01);
}

TEST_F(ColorCasesTest, SharedLasCasesAreLight) {
  const std::string autzen = SURFEIT_SHARED_DATA_DIR "/points/autzen_trim.las";
  const std::string directory = std::string(kCases) + "las/";
  if (!std::filesystem::exists(directory)) GTEST_SKIP() << "no shared cases in " << directory;
  const auto meanRed = [&](const std::string& file) {
    const auto source = openSurfelSource(file, false);
    EXPECT_TRUE(source.ok());
    std::vector<Surfel> surfels((*source)->recordCount());
    const auto count = (*source)->read(surfels);
    double sum = 0;
    for (std::size_t i = 0; i < *count; ++i) sum += double(surfels[i].radiosity.x);
    return sum / double(*count);
  };
  EXPECT_NEAR(meanRed(directory + "rgb8.las"), meanRed(directory + "rgb16.las"), 1e-3);
  EXPECT_NEAR(meanRed(directory + "rgb8_pf7.las"), meanRed(directory + "rgb16.las"), 1e-3);
  if (!std::filesystem::exists(autzen)) GTEST_SKIP() << "no " << autzen;
  const double mean = meanRed(autzen);
  EXPECT_GT(mean, 0.05);
  EXPECT_LT(mean, 0.5);
}

}  // namespace
}  // namespace surfeit
