// Scans as users have them: every shared case of places far away, laser scans, PCD and splats, and
// real files of other programs.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "cases/case_files.h"
#include "cloud/cloud_formats.h"
#include "io/row_stream_test.h"
#include "io/test_directory.h"
#include "surfeit/bake.h"
#include "surfeit/index.h"

namespace surfeit {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

class ScanCasesTest : public DirectoryTest {
 protected:
  static bool isHere(const std::string& name) { return std::filesystem::exists(sharedCase(name)); }

  std::unique_ptr<RowReader> open(const std::string& name) {
    Result<std::unique_ptr<RowReader>> reader = openRowReader(sharedCase(name));
    EXPECT_TRUE(reader.ok()) << reader.status().message();
    return reader.ok() ? std::move(*reader) : nullptr;
  }
  std::vector<double> valuesOf(RowReader& reader, std::size_t row,
                               const std::vector<std::string>& names) {
    const std::vector<std::byte> rows = readAllRows(reader);
    EXPECT_TRUE(reader.rewind().ok());
    std::vector<double> values;
    for (const std::string& name : names) values.push_back(valueOf(reader, rows, row, name));
    return values;
  }

  // Occlusion of the cloud at its own points.
  std::vector<double> occlusionOf(const std::string& name) {
    const std::string cloud = sharedCase(name);
    EXPECT_TRUE(indexClouds({cloud}, path("scene.sft"), {}, notes_).ok());
    EXPECT_TRUE(gatherCloud(path("scene.sft"), cloud, path("result.ply"), {}, notes_).ok());
    return columnOf(path("result.ply"), "occlusion");
  }
  Notes notes_;
};

TEST_F(ScanCasesTest, ACloudOnAMapGathersAsNearZero) {
  if (!isHere("georef/utm.ply")) GTEST_SKIP() << "shared cases are not here";
  for (const char* extension : {".ply", ".las"}) {
    const std::vector<double> local = occlusionOf(std::string("georef/local") + extension);
    const std::vector<double> utm = occlusionOf(std::string("georef/utm") + extension);
    ASSERT_EQ(local.size(), 3500u);
    ASSERT_EQ(utm.size(), 3500u);
    double sum = 0;
    for (std::size_t i = 0; i < local.size(); ++i) {
      EXPECT_NEAR(local[i], utm[i], 1e-5) << i;
      sum += local[i];
    }
    if (std::string(extension) == ".ply") {
      EXPECT_NEAR(sum / 3500, .1416, .01);
    }
  }
}

TEST_F(ScanCasesTest, ColorsOfSixteenBitsThatBeginDarkAreOfSixteen) {
  if (!isHere("las/dark_first.las")) GTEST_SKIP() << "shared cases are not here";
  const auto reader = open("las/dark_first.las");
  ASSERT_NE(reader, nullptr);
  EXPECT_THAT(reader->notes(), Not(Contains(HasSubstr("8 bits"))));
  EXPECT_EQ(reader->element().find("red")->type, ValueType::kUint16);
}

TEST_F(ScanCasesTest, PcdOfAllKindsHasTheColorsOfItsText) {
  if (!isHere("pcd/compressed.pcd")) GTEST_SKIP() << "shared cases are not here";
  for (const char* name :
       {"pcd/ascii_r_g_b.pcd", "pcd/ascii_rgb_int_in_F.pcd", "pcd/compressed.pcd"}) {
    const auto reader = open(name);
    ASSERT_NE(reader, nullptr);
    EXPECT_EQ(reader->element().count, 64u);
    EXPECT_THAT(valuesOf(*reader, 0, {"red", "green", "blue"}), ElementsAre(69, 182, 59)) << name;
    EXPECT_NEAR(valuesOf(*reader, 1, {"x"})[0], -0.8161681, 1e-6) << name;
  }
  const auto upper = open("pcd/upper.pcd");
  ASSERT_NE(upper, nullptr);
  EXPECT_NEAR(valuesOf(*upper, 1, {"x"})[0], -0.8161681, 1e-6);
}

TEST_F(ScanCasesTest, PackedSplatsAreSplats) {
  if (!isHere("splat/packed.ply")) GTEST_SKIP() << "shared cases are not here";
  const auto reader = open("splat/packed.ply");
  ASSERT_NE(reader, nullptr);
  EXPECT_THAT(reader->notes(), Contains(HasSubstr("Gaussian splats")));
  const std::vector<double> first = valuesOf(*reader, 0, {"nz", "coverage"});
  EXPECT_NEAR(first[0], 1, 1e-4);
  EXPECT_NEAR(first[1], .98, .01);
}

TEST_F(ScanCasesTest, RealFilesAreReadOrRefusedWithTheWayOut) {
  if (!isHere("real/test_pcl_logo.pcd")) GTEST_SKIP() << "shared cases are not here";
  for (const char* name :
       {"real/ellipsoid-1.4.laz", "real/ellipsoid.copc.laz", "real/testWithNormals.e57"}) {
    const auto reader = openRowReader(sharedCase(name));
    ASSERT_FALSE(reader.ok());
    EXPECT_THAT(reader.status().message(), HasSubstr("pdal translate")) << name;
  }
  const auto logo = open("real/test_pcl_logo.pcd");
  EXPECT_THAT(valuesOf(*logo, 0, {"red", "green", "blue"}), ElementsAre(128, 128, 128));
  const auto utm = open("real/test_data_pcd_utm17_space.pcd");
  EXPECT_THAT(valuesOf(*utm, 1, {"x", "y", "z"}), ElementsAre(289814.64, 4320978.84, 170.76));
  const auto text = open("real/models_points_cloudcompare.xyz");
  EXPECT_THAT(valuesOf(*text, 0, {"x", "red", "green", "blue", "alpha"}),
              ElementsAre(665187.522077, 117, 73, 49, 255));
  const auto autzen = open("real/test_data_autzen_autzen-bmx-cc.txt");
  EXPECT_THAT(valuesOf(*autzen, 0, {"x", "y", "z", "nz"}),
              ElementsAre(194506.86, 259235.01, 426.54, testing::DoubleNear(.78, 1e-6)));
}

}  // namespace
}  // namespace surfeit
