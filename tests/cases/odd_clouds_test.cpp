// Forms that standards do not have and files do: line ends, types, cells and columns.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include "cases/case_files.h"
#include "io/test_directory.h"
#include "sample/meshes/mesh.h"
#include "surfeit/convert.h"
#include "surfels/open_surfel_source.h"

namespace surfeit {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

class OddClouds : public DirectoryTest {
 protected:
  std::string file(const std::string& name, const std::string& content) const {
    write(name, content);
    return path(name);
  }
  static std::vector<std::string> notesOf(const std::string& cloud) {
    const auto source = openSurfelSource(cloud, false);
    return source.ok() ? (*source)->notes() : std::vector{source.status().message()};
  }
  static std::string refusalOf(const std::string& cloud, const std::string& channels = "") {
    RowReaderOptions options;
    options.channels = *parseChannelRenames(channels);
    return openRowReader(cloud, options).status().message();
  }
};

// A value as it stands in files of this machine's byte order, or the other.
template <typename T>
std::string bytesOf(T value, bool is_swapped = false) {
  std::string bytes(sizeof value, '\0');
  std::memcpy(bytes.data(), &value, sizeof value);
  return is_swapped ? std::string(bytes.rbegin(), bytes.rend()) : bytes;
}

TEST_F(OddClouds, LinesOfAPlyMayEndWithCrAlone) {
  const std::string head =
      "ply\rformat ascii 1.0\rcomment up z\relement vertex 2\rproperty float x\r"
      "property float y\rproperty float z\rend_header\r";
  const std::string text = file("a.ply", head + "1.5 2 3\r4.5 5 6\r");
  EXPECT_THAT(columnOf(text, "x"), ElementsAre(1.5, 4.5));
  EXPECT_THAT(columnOf(file("b.ply", head + "1.5 2 3\r\r4.5 5 6"), "z"), ElementsAre(3, 6));
}

TEST_F(OddClouds, DataBehindAHeaderWithCrMayBeginWithALineFeed) {
  const std::string head =
      "ply\rformat binary_little_endian 1.0\relement vertex 1\rproperty uchar first\r"
      "property float x\rproperty float y\rproperty float z\rend_header\r";
  for (const std::string first : {"\n", "\r", "7"}) {
    const std::string cloud =
        file("a.ply", head + first + bytesOf(1.5f) + bytesOf(2.5f) + bytesOf(3.5f));
    EXPECT_THAT(columnOf(cloud, "first"), ElementsAre(first[0]));
    EXPECT_THAT(columnOf(cloud, "y"), ElementsAre(2.5));
  }
}

TEST_F(OddClouds, IntegersOf64BitsInPlyAreDoubles) {
  const auto head = [](const char* format, const char* type, const char* list) {
    return fmt::format(
        "ply\nformat {} 1.0\nelement vertex 2\nproperty float x\nproperty {} id\nproperty float "
        "y\nproperty float z\n{}end_header\n",
        format, type, list);
  };
  for (const bool is_swapped : {false, true}) {
    for (const char* type : {"int64", "uint64", "long"}) {
      for (const char* list : {"", "property list uchar int64 more\n"}) {
        std::string bytes =
            head(is_swapped ? "binary_big_endian" : "binary_little_endian", type, list);
        for (const std::int64_t id : {std::int64_t{5}, (std::int64_t{1} << 53) - 1}) {
          bytes += bytesOf(1.5f, is_swapped) + bytesOf(id, is_swapped) + bytesOf(2.5f, is_swapped) +
                   bytesOf(3.5f, is_swapped);
          if (*list != 0) bytes += '\1' + bytesOf(id, is_swapped);
        }
        const std::string cloud = file("a.ply", bytes);
        EXPECT_THAT(columnOf(cloud, "id"), ElementsAre(5, 9007199254740991.)) << type << list;
        EXPECT_THAT(columnOf(cloud, "z"), ElementsAre(3.5, 3.5)) << type << list;
        EXPECT_THAT(notesOf(cloud), Contains(HasSubstr("exact to 2^53: 'id'")));
      }
    }
  }
  const std::string text = file("t.ply", head("ascii", "int64", "") + "1 -3 2 3\n1 12 2 3\n");
  EXPECT_THAT(columnOf(text, "id"), ElementsAre(-3, 12));
}

TEST_F(OddClouds, FacesMayHaveIndicesOf64Bits) {
  std::string bytes =
      "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float "
      "y\nproperty float z\nelement face 1\nproperty list uchar int64 vertex_indices\nend_header\n";
  for (const float value : {0.f, 0.f, 0.f, 2.f, 0.f, 0.f, 0.f, 3.f, 0.f}) bytes += bytesOf(value);
  bytes += '\3';
  for (const std::int64_t index : {0, 1, 2}) bytes += bytesOf(index);
  Progress quiet;
  const Result<Mesh> mesh = loadMeshes({file("a.ply", bytes)}, glm::vec3(.5f), quiet);
  ASSERT_TRUE(mesh.ok()) << mesh.status().message();
  ASSERT_EQ(mesh->triangle.size(), 1u);
  EXPECT_FLOAT_EQ(triangleArea(*mesh, 0), 3);
}

TEST_F(OddClouds, IntegersOf64BitsInPcdAreTold) {
  const std::string cloud =
      file("a.pcd",
           "VERSION .7\nFIELDS x y z t\nSIZE 4 4 4 8\nTYPE F F F U\nCOUNT 1 1 1 1\nWIDTH 1\nHEIGHT "
           "1\nPOINTS 1\nDATA ascii\n1 2 3 1600000000000000001\n");
  EXPECT_THAT(notesOf(cloud), Contains(HasSubstr("exact to 2^53: 't'")));
}

TEST_F(OddClouds, NumbersOfFortranAndOfOldWindowsAreRead) {
  const std::string rows = "1.5D+00 2.5d1 -1D-2\n-1.#IND 1.#QNAN 2\n1.#INF -1.#INF 3\n1 2 3\n";
  const std::string ply =
      "ply\nformat ascii 1.0\nelement vertex 4\nproperty double x\nproperty float y\nproperty "
      "float z\nend_header\n";
  for (const std::string& cloud : {file("a.ply", ply + rows), file("a.xyz", rows)}) {
    const std::vector<double> x = columnOf(cloud, "x"), y = columnOf(cloud, "y");
    ASSERT_EQ(x.size(), 4u) << cloud << refusalOf(cloud);
    EXPECT_EQ(x[0], 1.5);
    EXPECT_EQ(y[0], 25);
    EXPECT_NEAR(columnOf(cloud, "z")[0], -.01, 1e-9);
    EXPECT_TRUE(std::isnan(x[1]) && std::isnan(y[1]));
    EXPECT_TRUE(std::isinf(x[2]) && x[2] > 0 && std::isinf(y[2]) && y[2] < 0);
  }
  EXPECT_THAT(refusalOf(file("b.xyz", "1 2 3\n1 2 3d\n")), HasSubstr("3d"));
  EXPECT_THAT(refusalOf(file("b.xyz", "1 2 3\n1 2 1.#X\n")), HasSubstr("1.#X"));
}

TEST_F(OddClouds, CellsWithoutAValueAreNanAndTold) {
  const std::string cloud =
      file("a.csv", "x,y,z,class,depth\n1,2,3,4,\n5,6,7,,8\n1,2,3,NA,n/a\n1,2,3,null,2\n");
  const std::vector<double> classes = columnOf(cloud, "class"), heights = columnOf(cloud, "depth");
  ASSERT_EQ(classes.size(), 4u) << refusalOf(cloud);
  EXPECT_EQ(classes[0], 4);
  EXPECT_TRUE(std::isnan(classes[1]) && std::isnan(classes[2]) && std::isnan(classes[3]));
  EXPECT_TRUE(std::isnan(heights[0]) && std::isnan(heights[2]));
  EXPECT_EQ(heights[1], 8);
  EXPECT_EQ(heights[3], 2);
  EXPECT_THAT(notesOf(cloud),
              AllOf(Contains(HasSubstr("column 4 (class) has no value in 3 of 4 rows")),
                    Contains(HasSubstr("--channels 5=-"))));
  // A place needs all of its numbers
  EXPECT_THAT(refusalOf(file("b.csv", "x,y,z\n1,2,3\n1,,3\n")), HasSubstr("line 3"));
  EXPECT_THAT(refusalOf(file("b.csv", "x,y,z\n1,2,3\n1,NA,3\n")), HasSubstr("NA"));
}

TEST_F(OddClouds, NumbersOfPointsAreNotTakenForX) {
  std::string rows, grid;
  for (int i = 0; i < 12; ++i) {
    rows += fmt::format("{} {}.5 {}.25 7.125\n", 1000 + i, i * 3, i % 5);
    grid += fmt::format("{} {} 7.125 {}\n", i % 6, i / 6, i);
  }
  const std::string cloud = file("a.xyz", rows);
  EXPECT_THAT(refusalOf(cloud), AllOf(HasSubstr("counts on from 1000 to 1011"),
                                      HasSubstr("--channels 1=-,2=x,3=y,4=z")));
  EXPECT_THAT(refusalOf(cloud, "1=-,2=x,3=y,4=z"), IsEmpty());
  EXPECT_THAT(refusalOf(cloud, "1=x,2=y,3=z"), IsEmpty());
  EXPECT_THAT(refusalOf(cloud, "4=-"), HasSubstr("counts on from 1000 to 1011"));
  EXPECT_THAT(refusalOf(file("grid.xyz", grid)), IsEmpty());
}

TEST_F(OddClouds, BarsPartValuesAndPercentSignsBeginComments) {
  const std::string cloud = file("a.txt", "% made by a program\n1.5|2|3\n4.5|5|6\n");
  EXPECT_THAT(columnOf(cloud, "x"), ElementsAre(1.5, 4.5));
}

TEST_F(OddClouds, NormalsWithoutASignAreDirections) {
  struct Type {
    const char* name;
    std::string up, down;
  };
  for (const Type& type : {Type{"uchar", "128 128 255", "128 128 0"},
                           Type{"ushort", "32768 32768 65535", "32768 32768 0"}}) {
    const std::string cloud = file(
        "a.ply", fmt::format("ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty "
                             "float y\nproperty float z\nproperty {0} nx\nproperty {0} "
                             "ny\nproperty {0} nz\nend_header\n1 2 3 {1}\n1 2 3 {2}\n",
                             type.name, type.up, type.down));
    const auto source = openSurfelSource(cloud, false);
    ASSERT_TRUE(source.ok()) << source.status().message();
    std::vector<Surfel> surfels(4);
    ASSERT_EQ(*(*source)->read(surfels), 2u);
    EXPECT_EQ(surfels[0].normal, glm::vec3(0, 0, 1)) << type.name;
    EXPECT_EQ(surfels[1].normal, glm::vec3(0, 0, -1)) << type.name;
    EXPECT_THAT(notesOf(cloud), Contains(HasSubstr("read as directions whose 0 is at")));
  }
}

TEST_F(OddClouds, SplatsWithoutAPartAreTold) {
  const std::string cloud = file(
      "a.ply",
      "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float "
      "z\nproperty float f_dc_0\nproperty float f_dc_1\nproperty float f_dc_2\nproperty float "
      "opacity\nproperty float scale_0\nproperty float scale_1\nproperty float "
      "scale_2\nend_header\n1 2 3 0 0 0 2 -3 -3 -9\n");
  EXPECT_THAT(notesOf(cloud), Contains(AllOf(HasSubstr("without rot_0 rot_1 rot_2 rot_3"),
                                             HasSubstr("--channels opacity=-"))));
}

TEST_F(OddClouds, WhatPtcHasNoPlaceForIsTold) {
  const std::string cloud = file(
      "a.ply",
      "ply\nformat ascii 1.0\ncomment crs EPSG:32610\nelement vertex 1\nproperty float x\nproperty "
      "float y\nproperty float z\nend_header\n1 2 3\n");
  Notes notes;
  ASSERT_TRUE(convertClouds({cloud}, path("a.ptc"), {}, notes).ok());
  EXPECT_THAT(notes.notes, Contains(HasSubstr("the coordinate reference system among them")));
}

}  // namespace
}  // namespace surfeit
