// Sizes in another unit than places, angles in text, and advice that works as it is written.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "cases/case_files.h"
#include "io/test_directory.h"
#include "surfeit/cloud_info.h"
#include "surfeit/index.h"
#include "surfels/open_surfel_source.h"

namespace surfeit {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;
using testing::Not;

class SizeUnits : public DirectoryTest {
 protected:
  // A grid of 400 points .1 apart with these values behind each place.
  std::string grid(const std::string& properties, const std::string& values) {
    std::string rows;
    for (int i = 0; i < 400; ++i)
      rows += fmt::format("{} {} 0 {}\n", .1 * (i % 20), .1 * (i / 20), values);
    return "ply\nformat ascii 1.0\nelement vertex 400\nproperty float x\nproperty float "
           "y\nproperty "
           "float z\n" +
           properties + "end_header\n" + rows;
  }
  std::vector<std::string> indexed(const std::string& content, const std::string& channels = "") {
    write("a.ply", content);
    Notes notes;
    IndexOptions options;
    options.channels = channels;
    const auto stats = indexClouds({path("a.ply")}, path("a.sft"), options, notes);
    EXPECT_TRUE(stats.ok()) << stats.status().message();
    notes.notes.insert(notes.notes.end(), notes.informed.begin(), notes.informed.end());
    return notes.notes;
  }
};

TEST_F(SizeUnits, SizesInAnotherUnitThanPlacesAreTold) {
  const std::string radius = "property float radius\n";
  for (const auto& [value, advice] : {std::pair("50", "radius *= 1e-3"),
                                      {"800", "radius *= 1e-4"},
                                      {".0004", "radius *= 1e+2"},
                                      {".00002", "radius *= 1e+3"}}) {
    const std::vector<std::string> notes = indexed(grid(radius, value));
    EXPECT_THAT(notes, Contains(AllOf(HasSubstr("half of the radii are"), HasSubstr(advice),
                                      HasSubstr("neighbours lie about 0.08"),
                                      HasSubstr("--channels radius=-"))))
        << value;
    const auto info = readCloudInfo(path("a.ply"), {}, *std::make_unique<Progress>());
    ASSERT_TRUE(info.ok());
    EXPECT_THAT(info->notes, Contains(HasSubstr("half of the radii are"))) << value;
  }
  for (const char* value : {".05", ".1", "1", ".005"}) {
    EXPECT_THAT(indexed(grid(radius, value)), Not(Contains(HasSubstr("radii")))) << value;
  }
  // By the names that the file has
  EXPECT_THAT(indexed(grid("property float pscale\n", "50")),
              Contains(AllOf(HasSubstr("pscale *= 1e-3"), HasSubstr("--channels pscale=-"))));
  EXPECT_THAT(indexed(grid("property float width\n", "90")),
              Contains(AllOf(HasSubstr("width *= 1e-3"), HasSubstr("--channels width=-"))));
  EXPECT_THAT(indexed(grid("property float radius\nproperty float area\n", "50 7800")),
              Contains(AllOf(HasSubstr("radius *= 1e-3"), HasSubstr("area *= 1e-6"),
                             HasSubstr("--channels radius=-,area=-"))));
  EXPECT_THAT(indexed(grid("property float size\n", "50"), "size=radius"),
              Contains(HasSubstr("--channels size=-")));
}

TEST_F(SizeUnits, AlbedosAboveOneNameTheProperty) {
  const std::string sizes = "property float radius\n";
  const auto colors = [&](const char* r, const char* g, const char* b) {
    return sizes +
           fmt::format("property float {}\nproperty float {}\nproperty float {}\n", r, g, b);
  };
  EXPECT_THAT(indexed(grid(colors("red", "green", "blue"), ".05 2.5 .1 .1")),
              Contains(HasSubstr("--channels color=radiosity")));
  EXPECT_THAT(
      indexed(grid(colors("diffuse_red", "diffuse_green", "diffuse_blue"), ".05 2.5 .1 .1")),
      Contains(HasSubstr("--channels color=radiosity")));
  EXPECT_THAT(indexed(grid(colors("a", "b", "c"), ".05 2.5 .1 .1"), "a=red,b=green,c=blue"),
              Contains(HasSubstr("--channels a=radiosity_r,b=radiosity_g,c=radiosity_b")));
  EXPECT_THAT(indexed(grid(colors("albedo_r", "albedo_g", "albedo_b"), ".05 2.5 .1 .1")),
              Contains(HasSubstr("--channels albedo=- leaves the albedo out")));
  // And that works
  EXPECT_THAT(indexed(grid(colors("diffuse_red", "diffuse_green", "diffuse_blue"), ".05 2.5 .1 .1"),
                      "color=radiosity"),
              Not(Contains(HasSubstr("an albedo above 1"))));
  EXPECT_THAT(indexed(grid(colors("a", "b", "c"), ".05 2.5 .1 .1"),
                      "a=radiosity_r,b=radiosity_g,c=radiosity_b"),
              Not(Contains(HasSubstr("an albedo above 1"))));
}

// A splat's channels are made of others, so that --channels has nothing to drop.
TEST_F(SizeUnits, RecordsOfSplatsAreLeftOutByAFilter) {
  std::string splats =
      "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float "
      "z\n";
  for (const char* name : {"f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2",
                           "rot_0", "rot_1", "rot_2", "rot_3"}) {
    splats += fmt::format("property float {}\n", name);
  }
  splats += "end_header\n";
  for (const char* bad :
       {"0 0 0 4 nan -3 -6 1 0 0 0", "0 0 0 nan -3 -3 -6 1 0 0 0", "nan 0 0 4 -3 -3 -6 1 0 0 0"}) {
    const std::vector<std::string> notes =
        indexed(splats + "1 2 3 0 0 0 4 -3 -3 -6 1 0 0 0\n2 2 3 " + bad + "\n");
    EXPECT_THAT(notes, Contains(AllOf(HasSubstr("skipped 1 record"), HasSubstr("--filter leaves"),
                                      Not(HasSubstr("=-")))))
        << bad;
  }
}

class AnglesInText : public SizeUnits {
 protected:
  std::string refusal(const std::string& text) {
    write("a.txt", text);
    const auto source = openSurfelSource(path("a.txt"), false);
    return source.ok() ? "" : source.status().message();
  }
};

TEST_F(AnglesInText, DegreesMinutesAndSecondsAreRefusedAsAngles) {
  for (const char* text :
       {"7°30'12\" 46°30'12\" 400\n",
        "7\xB0"
        "30'12\" 46\xB0"
        "30'12\" 400\n",
        "7.5° 46.5° 400\n", "lon,lat,h\n7°30'12\",46°30'12\",400\n",
        "x,y,z\n7°30'12\",46°30'12\",400\n", "7d30m12s 46d30m12s 400\n", "7:30:12 46:30:12 400\n",
        "7.5E 46.5N 400\n", "7 30 12 E 46 30 12 N 400\n", "-7d30'12.5\" +46d30'12.5\" 400\n"}) {
    EXPECT_THAT(refusal(text), HasSubstr("angles")) << text;
  }
  for (const char* text :
       {"1 2 3\n2 3 4\n", "1E5 2E5 3\n2 3 4\n", "x y z name\n1 2 3 4\n", "E N H\n1 2 3\n"}) {
    EXPECT_EQ(refusal(text), "") << text;
  }
  EXPECT_THAT(refusal("12:30:01 1.5 2.5 3.5\n"), HasSubstr("--channels 2=x,3=y,4=z"));
}

TEST_F(AnglesInText, RowsOfUnitsBelowNamesAreRead) {
  for (const char* text : {"X Y Z\n(m) (m) (m)\n1 2 3\n", "X Y Z\n[m] [m] [m]\n1 2 3\n",
                           "X\tY\tZ\n(mm)\t(mm)\t(mm)\n1\t2\t3\n", "x;y;z\nft;ft;ft\n1;2;3\n"}) {
    EXPECT_EQ(refusal(text), "") << text;
    const auto source = openSurfelSource(path("a.txt"), false);
    EXPECT_EQ((*source)->recordCount(), 1u) << text;
  }
}

TEST_F(SizeUnits, DisksThatLeaveGapsAreTold) {
  const std::string sizes =
      "property float nx\nproperty float ny\nproperty float nz\n"
      "property float radius\nproperty float area\n";
  const auto gaps = Contains(
      AllOf(HasSubstr("leave gaps however they lie"), HasSubstr("--channels radius=-,area=-")));
  EXPECT_THAT(indexed(grid(sizes, "0 0 1 .0564 .01")), gaps);  // as large as the area
  const auto info = readCloudInfo(path("a.ply"), {}, *std::make_unique<Progress>());
  ASSERT_TRUE(info.ok());
  EXPECT_THAT(info->notes, gaps);
  EXPECT_THAT(indexed(grid(sizes, "0 0 1 .0710 .01")), Not(gaps));  // from corner to corner
  EXPECT_THAT(indexed(grid(sizes, "0 0 0 .0564 .01")), Not(gaps));  // spheres
  EXPECT_THAT(indexed(grid(sizes + "property uchar two_sided\n", "0 0 1 .0564 .01 1")), Not(gaps));
}

}  // namespace
}  // namespace surfeit
