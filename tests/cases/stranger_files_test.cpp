// Files of kinds that public bug reports describe, each in variants: what they say is read, told or
// refused with the way out.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <string>
#include <vector>

#include "cases/case_files.h"
#include "io/test_directory.h"
#include "surfeit/sample.h"
#include "surfels/open_surfel_source.h"

namespace surfeit {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

class StrangerFiles : public DirectoryTest {
 protected:
  // What is told of a file, or why it is refused.
  std::vector<std::string> told(const std::string& name, const std::string& content,
                                const std::string& channels = "") {
    write(name, content);
    RowReaderOptions options;
    options.channels = *parseChannelRenames(channels);
    const auto source = openSurfelSource(path(name), false, options);
    if (!source.ok()) return {source.status().message()};
    count_ = (*source)->recordCount();
    std::vector<std::string> notes = (*source)->notes();
    for (std::vector<Surfel> surfels(100);;) {
      const Result<std::size_t> count = (*source)->read(surfels);
      if (!count.ok()) return {count.status().message()};
      if (*count == 0) return notes;
    }
  }
  std::vector<Surfel> surfelsOf(const std::string& name, const std::string& content,
                                const std::string& channels = "") {
    write(name, content);
    RowReaderOptions options;
    options.channels = *parseChannelRenames(channels);
    const auto source = openSurfelSource(path(name), false, options);
    EXPECT_TRUE(source.ok()) << source.status().message();
    if (!source.ok()) return {};
    std::vector<Surfel> surfels((*source)->recordCount());
    surfels.resize(*(*source)->read(surfels));
    return surfels;
  }
  // The area that is sampled of a mesh, and what is told.
  double sampled(const std::string& name, const std::string& content) {
    write(name, content);
    SampleOptions options;
    options.count = 50;
    notes_ = {};
    const Result<SampleStats> stats =
        sampleMeshes({path(name)}, path("surfels.ply"), options, notes_);
    EXPECT_TRUE(stats.ok()) << stats.status().message();
    return stats.ok() ? stats->area : 0;
  }
  std::vector<std::string> sampledComments() const {
    const auto reader = openRowReader(path("surfels.ply"));
    EXPECT_TRUE(reader.ok());
    return reader.ok() ? (*reader)->comments() : std::vector<std::string>();
  }

  Notes notes_;
  std::uint64_t count_ = 0;
};

std::string ply(const std::string& comments, const std::string& properties, std::size_t count,
                const std::string& rows) {
  return fmt::format(
      "ply\nformat ascii 1.0\n{}element vertex {}\nproperty float x\nproperty float y\nproperty "
      "float z\n{}end_header\n{}",
      comments, count, properties, rows);
}

// --- Comments that say how places are meant

TEST_F(StrangerFiles, CommentsNameUnitsThatAreNotMetres) {
  for (const char* comment : {"units mm", "Units: mm", "File units = millimeters", "unit=MM",
                              "units in mm", "lengths have the unit mm"}) {
    EXPECT_THAT(told("a.ply", ply(fmt::format("comment {}\n", comment), "", 1, "1 2 3\n")),
                ElementsAre(AllOf(HasSubstr("lengths are in millimetres"),
                                  HasSubstr("convert --units mm:m"))))
        << comment;
    EXPECT_THAT(told("a.xyz", fmt::format("# {}\n1 2 3\n", comment)),
                ElementsAre(HasSubstr("convert --units mm:m")))
        << comment;
    sampled("a.obj", fmt::format("# {}\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", comment));
    EXPECT_THAT(notes_.notes, Contains(HasSubstr("convert --units mm:m"))) << comment;
  }
  EXPECT_THAT(told("a.xyz", "# units: in\n1 2 3\n"), ElementsAre(HasSubstr("--units in:m")));
  for (const char* comment : {"units m", "units in metres", "unit of work", "unity",
                              "made in a unit test by us", "up z", "group 1 units of mm"}) {
    EXPECT_THAT(told("a.ply", ply(fmt::format("comment {}\n", comment), "", 1, "1 2 3\n")),
                IsEmpty())
        << comment;
  }
}

TEST_F(StrangerFiles, CommentsNameShiftsThatAreNotApplied) {
  for (const char* comment : {"offset 500000 5400000 0", "Global shift: -500000.0 -5400000.0 0.0",
                              "shift (1e5, +2, 3)"}) {
    EXPECT_THAT(told("a.ply", ply(fmt::format("comment {}\n", comment), "", 1, "1 2 3\n")),
                ElementsAre(AllOf(HasSubstr("is not applied"), HasSubstr("convert --transform"))))
        << comment;
  }
  for (const char* comment : {"offset 0 0 0", "offset 12", "shift of 3 4 5 6", "no offset"}) {
    EXPECT_THAT(told("a.ply", ply(fmt::format("comment {}\n", comment), "", 1, "1 2 3\n")),
                IsEmpty())
        << comment;
  }
}

TEST_F(StrangerFiles, WellKnownTextNamesUnitsInAnyFormat) {
  const std::string crs =
      "crs PROJCS[\"a\",GEOGCS[\"b\",UNIT[\"degree\",0.017]],UNIT[\"foot\",0.3048]]";
  EXPECT_THAT(told("a.ply", ply("comment " + crs + "\n", "", 1, "1 2 3\n")),
              ElementsAre(HasSubstr("convert --units ft:m")));
  EXPECT_THAT(told("a.xyz", "# " + crs + "\n1 2 3\n"),
              ElementsAre(HasSubstr("convert --units ft:m")));
  const std::string metres = "crs PROJCS[\"a\",UNIT[\"metre\",1]]";
  EXPECT_THAT(told("a.xyz", "# " + metres + "\n1 2 3\n"), IsEmpty());
}

TEST_F(StrangerFiles, TheLastCommentInFrontOfRowsCounts) {
  for (const char* text :
       {"# up z\n1 2 3\n", "# a\n# up z\n1,2,3\n", "# up z\n\n1 2 3\n", "# up z\nx y z\n1 2 3\n"}) {
    write("a.xyz", text);
    const auto source = openSurfelSource(path("a.xyz"), false);
    ASSERT_TRUE(source.ok());
    EXPECT_EQ((*source)->up(), UpAxis::kZ) << text;
  }
}

TEST_F(StrangerFiles, SystemsAboutTheCentreOfTheEarthHaveNoUp) {
  for (const char* crs : {"geocentric EPSG:4978", "GEOCCS[\"WGS 84\",UNIT[\"metre\",1]]"}) {
    EXPECT_THAT(told("a.ply", ply(fmt::format("comment crs {}\n", crs), "", 1, "1 2 3\n")),
                ElementsAre(AllOf(HasSubstr("none of them is up"), HasSubstr("reproject"))))
        << crs;
  }
}

// --- Gaussian splats that are otherwise

std::string splats(const std::string& colors, const std::string& row) {
  std::string properties = colors + "property float opacity\n";
  for (const char* name : {"scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"}) {
    properties += fmt::format("property float {}\n", name);
  }
  return ply("", properties, 1, row);
}
constexpr const char* kHarmonics =
    "property float f_dc_0\nproperty float f_dc_1\nproperty float f_dc_2\n";
constexpr const char* kCodes = "property uchar red\nproperty uchar green\nproperty uchar blue\n";

TEST_F(StrangerFiles, SplatsMayHaveColorsOf8Bits) {
  const std::vector<Surfel> surfels =
      surfelsOf("a.ply", splats(kCodes, "1 2 3 255 188 0 0 -3 -3 -6 1 0 0 0\n"));
  ASSERT_EQ(surfels.size(), 1u);
  EXPECT_NEAR(surfels[0].radiosity.r, 1, 1e-6);
  EXPECT_NEAR(surfels[0].radiosity.g, .5, .01);
  EXPECT_EQ(surfels[0].radiosity.b, 0);
  EXPECT_NEAR(surfels[0].area, -.5, 1e-6);  // a coverage
  EXPECT_NEAR(surfels[0].radius, std::sqrt(2 * std::exp(-6.)), 1e-6);
  EXPECT_THAT(told("a.ply", splats(kCodes, "1 2 3 255 188 0 4 -3 -3 -6 1 0 0 0\n")),
              Not(Contains(HasSubstr("without"))));
  // Harmonics go before codes; floats beside splats are not codes
  EXPECT_NEAR(surfelsOf("a.ply", splats(std::string(kHarmonics) + kCodes,
                                        "1 2 3 0 0 0 255 188 0 0 -3 -3 -6 1 0 0 0\n"))
                  .at(0)
                  .radiosity.r,
              .2140, 1e-3);
  EXPECT_THAT(told("a.ply", splats("property float red\nproperty float green\nproperty float "
                                   "blue\n",
                                   "1 2 3 1 1 1 0.5 -3 -3 -6 1 0 0 0\n")),
              Contains(HasSubstr("without f_dc_0 f_dc_1 f_dc_2")));
}

TEST_F(StrangerFiles, SplatsOfLengthsAndPartsAreTold) {
  for (const char* row : {"1 2 3 0 0 0 .9 .05 .05 .001 1 0 0 0\n", "1 2 3 0 0 0 1 2 2 1 1 0 0 0\n",
                          "1 2 3 0 0 0 0 .1 .2 .3 1 0 0 0\n"}) {
    EXPECT_THAT(told("a.ply", splats(kHarmonics, row)),
                Contains(AllOf(HasSubstr("look like lengths and parts"), HasSubstr("ln(scale)"))))
        << row;
  }
  for (const char* row :
       {"1 2 3 0 0 0 .9 -3 -3 -6 1 0 0 0\n", "1 2 3 0 0 0 4 .1 .1 .1 1 0 0 0\n"}) {
    EXPECT_THAT(told("a.ply", splats(kHarmonics, row)),
                Not(Contains(HasSubstr("look like lengths"))))
        << row;
  }
}

TEST_F(StrangerFiles, SplatsThatAreNoNumbersAreSkipped) {
  for (const char* row :
       {"1 2 3 0 0 0 4 nan -3 -6 1 0 0 0\n", "1 2 3 0 0 0 4 -3 nan -6 1 0 0 0\n",
        "1 2 3 0 0 0 4 -3 -3 nan 1 0 0 0\n", "1 2 3 nan 0 0 4 -3 -3 -6 1 0 0 0\n",
        "1 2 3 0 0 0 nan -3 -3 -6 1 0 0 0\n", "1 2 3 0 0 0 4 -3 -3 -6 0 0 0 0\n"}) {
    EXPECT_THAT(surfelsOf("a.ply", splats(kHarmonics, row)), IsEmpty()) << row;
  }
}

// --- Headers that count wrongly

std::string pcd(const std::string& head, const std::string& data) {
  return "# .PCD v0.7\nVERSION 0.7\n" + head + "SIZE 4 4 4\nTYPE F F F\n" + data;
}
std::string floats(const std::vector<float>& values) {
  std::string bytes(4 * values.size(), '\0');
  std::memcpy(bytes.data(), values.data(), bytes.size());
  return bytes;
}

TEST_F(StrangerFiles, PcdHeadersThatCountWronglyAreToldOrRefusedWithTheWayOut) {
  const std::string fields = "FIELDS x y z\n";
  for (const char* counts : {"WIDTH 20\nHEIGHT 10\nPOINTS 2\n", "WIDTH 0\nHEIGHT 0\nPOINTS 2\n"}) {
    EXPECT_THAT(told("a.pcd", pcd(fields, std::string(counts) + "DATA ascii\n1 2 3\n2 3 4\n")),
                ElementsAre(HasSubstr("points, POINTS 2")))
        << counts;
    EXPECT_EQ(count_, 2u);
  }
  EXPECT_THAT(told("a.pcd", pcd(fields, "WIDTH 1\nHEIGHT 1\nPOINTS 1\nDATA ascii\n1 2 3\n2 3 4\n")),
              ElementsAre(HasSubstr("the header counts fewer rows")));
  EXPECT_THAT(told("a.pcd", pcd(fields, "WIDTH 1\nHEIGHT 1\nPOINTS 1\nDATA binary\n" +
                                            floats({1, 2, 3, 2, 3, 4}))),
              ElementsAre(HasSubstr("may be 1 points that the header does not count")));
  EXPECT_THAT(told("a.ply", ply("", "", 1, "1 2 3\n2 3 4\n")),
              ElementsAre(HasSubstr("the header counts fewer rows")));
}

TEST_F(StrangerFiles, PcdOfOldVersionsHasColumns) {
  const std::string old =
      "VERSION .5\nCOLUMNS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS 1\nDATA ascii\n1 2 3\n";
  EXPECT_EQ(surfelsOf("a.pcd", old).size(), 1u);
  EXPECT_EQ(surfelsOf("a.pcd", "# old\n" + old).size(), 1u);
}

// --- Values that their types do not hold

TEST_F(StrangerFiles, PlyIntegersThatAreNoneSayWhatToDo) {
  const char* const red = "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  for (const char* row : {"1 2 3 .5 .25 1\n", "1 2 3 256 0 0\n", "1 2 3 -1 0 0\n"}) {
    EXPECT_THAT(told("a.ply", ply("", red, 1, row)),
                ElementsAre(HasSubstr("which does not hold it: make it float in the header")))
        << row;
  }
}

// --- Text

TEST_F(StrangerFiles, WordsInFrontOfNumbersAreNamedAndLeftOutByNumber) {
  const std::vector<std::string> texts = {"P1 1.5 2.5 3.5\nP2 2.5 3.5 4.5\n",
                                          "12:30:01 1.5 2.5 3.5\n12:30:02 2.5 3.5 4.5\n",
                                          "a.jpg,1.5,2.5,3.5\nb.jpg,2.5,3.5,4.5\n"};
  for (const std::string& text : texts) {
    EXPECT_THAT(told("a.txt", text), ElementsAre(HasSubstr("--channels 2=x,3=y,4=z"))) << text;
    const std::vector<Surfel> surfels = surfelsOf("a.txt", text, "1=-,2=x,3=y,4=z");
    ASSERT_EQ(surfels.size(), 2u) << text;
    EXPECT_EQ(surfels[1].position, glm::vec3(2.5f, 3.5f, 4.5f)) << text;
  }
}

TEST_F(StrangerFiles, TextThatIsNoTableIsRefusedWithTheWayOut) {
  EXPECT_THAT(told("a.txt", "{\"x\":1.5,\"y\":2.5,\"z\":3.5}\n{\"x\":1.5,\"y\":2.5,\"z\":3.5}\n"),
              ElementsAre(HasSubstr("JSON")));
  EXPECT_THAT(told("a.txt", "<x y=\"1\" z=\"2\"/>\n"), ElementsAre(HasSubstr("found")));
  EXPECT_THAT(told("a.csv", "x,y,z\nx,y,z\n1,2,3\n"), ElementsAre(HasSubstr("line 2: found")));
  EXPECT_THAT(told("a.csv", "x,y,z\n1,2,3\nx,y,z\n1,2,3\n"),
              ElementsAre(HasSubstr("a # in front makes a comment of a line that is no row")));
  EXPECT_THAT(told("a.csv", "x,y,z\n1,2,3\nTotal: two points\n"),
              ElementsAre(HasSubstr("a # in front makes a comment")));
  EXPECT_THAT(told("a.txt", "1.5\u00a02.5\u00a03.5\n"), ElementsAre(HasSubstr("not ASCII")));
  EXPECT_THAT(told("a.txt", "1.5 \u22122.5 3.5\n"), ElementsAre(HasSubstr("not ASCII")));
  EXPECT_THAT(told("a.txt", "1.5 2.5\n2.5 3.5\n"), ElementsAre(HasSubstr("a place needs a third")));
  EXPECT_THAT(told("a.txt", "1.5:2.5:3.5\n"), ElementsAre(HasSubstr("semicolons or bars part")));
  EXPECT_THAT(told("a.xyz", std::string("1 2 3\n\0\0\0\0\n4 5 6\n", 17)),
              ElementsAre(HasSubstr("was the file written whole?")));
  std::string wide;
  for (int i = 0; i < 300; ++i) wide += "1 ";
  EXPECT_THAT(told("a.xyz", wide + "\n"), ElementsAre(HasSubstr("`cut -d ' ' -f 1-256`")));
}

TEST_F(StrangerFiles, ColumnsAreNamedAsMapsNameThem) {
  for (const char* text :
       {"POINT_X,POINT_Y,POINT_Z\n1,2,3\n", "UTM_X;UTM_Y;Z\n1;2;3\n",
        "Rechtswert;Hochwert;H\u00f6he\n1,0;2,0;3,0\n", "Rechtswert;Hochwert;Hoehe\n1;2;3\n"}) {
    const std::vector<Surfel> surfels = surfelsOf("a.csv", text);
    ASSERT_EQ(surfels.size(), 1u) << text;
    EXPECT_EQ(surfels[0].position, glm::vec3(1, 2, 3)) << text;
  }
}

TEST_F(StrangerFiles, PtxMatricesOfZerosAreRefusedWithTheWayOut) {
  const auto scan = [](const char* matrix) {
    return std::string("1\n1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n") + matrix + "1 2 3 .5\n";
  };
  for (const char* matrix :
       {"0 0 0 0\n0 0 0 0\n0 0 0 0\n0 0 0 1\n", "1 0 0 0\n1 0 0 0\n0 0 1 0\n5 5 5 1\n",
        "1 0 0 0\n0 nan 0 0\n0 0 1 0\n0 0 0 1\n"}) {
    EXPECT_THAT(told("a.ptx", scan(matrix)), ElementsAre(HasSubstr("rows 1 0 0 0"))) << matrix;
  }
  EXPECT_EQ(surfelsOf("a.ptx", scan("0 1 0 0\n-1 0 0 0\n0 0 1 0\n9 0 0 1\n")).at(0).position,
            glm::vec3(7, 1, 3));
}

TEST_F(StrangerFiles, LinesOfSeparatorsAreEmpty) {
  for (const char* text :
       {",,\nx,y,z\n1,2,3\n2,3,4\n", "x,y,z\n,,\n1,2,3\n2,3,4\n", "x,y,z\n1,2,3\n\n,,\n2,3,4\n",
        "x;y;z\n1;2;3\n;;\n2;3;4\n;;\n", "1\t2\t3\n\t\t\n2\t3\t4\n", "1 2 3\n2 3 4\n\x1a",
        "1 2 3\n2 3 4\n\x1a\n"}) {
    EXPECT_EQ(surfelsOf("a.csv", text).size(), 2u) << text;
    EXPECT_THAT(told("a.csv", text), IsEmpty()) << text;
  }
}

TEST_F(StrangerFiles, CellsOfSpreadsheetsMayLackAValue) {
  for (const char* cell : {"#N/A", "#n/a", "NULL", "", "-"}) {
    EXPECT_THAT(told("a.csv", fmt::format("x,y,z,height\n1,2,3,5\n1,2,4,{}\n", cell)),
                ElementsAre(HasSubstr("has no value in 1 of 2 rows")))
        << cell;
  }
}

TEST_F(StrangerFiles, Utf16WithoutAMarkIsNamed) {
  for (const bool is_big : {false, true}) {
    std::string wide;
    for (const char c : std::string("x y z\r\n1 2 3\r\n")) {
      if (is_big) wide += '\0';
      wide += c;
      if (!is_big) wide += '\0';
    }
    for (const char* name : {"a.txt", "a.ply"}) {
      EXPECT_THAT(told(name, wide), ElementsAre(HasSubstr("UTF-16"))) << name << is_big;
    }
  }
}

// --- Files of other programs

TEST_F(StrangerFiles, FormatsThatAreNotReadAreNamed) {
  const std::string rest(100, '\0');
  const std::vector<std::pair<const char*, std::string>> files = {
      {"a.bag", "#ROSBAG V2.0\n" + rest},     {"a.grd", "DSAA\n4 3\n"},
      {"a.wrl", "#VRML V2.0 utf8\n"},         {"a.blend", "BLENDER-v300" + rest},
      {"a.pcap", "\xd4\xc3\xb2\xa1" + rest},  {"a.pcap", "\x0a\x0d\x0d\x0a" + rest},
      {"a.dxf", "0\nSECTION\n2\nENTITIES\n"}, {"a.fls", "FARO LS" + rest},
      {"a.rcp", "\x01\x02" + rest},           {"a.xlsx", "PK\x03\x04" + rest},
      {"a.bin", "\x29\x01\x3a\x3a" + rest}};
  for (const auto& [name, content] : files) {
    EXPECT_THAT(told(name, content), ElementsAre(HasSubstr("which is not read as a cloud: ")))
        << name;
  }
  EXPECT_THAT(told("a.las", std::string(400, '\0')), ElementsAre(HasSubstr("are all 0")));
}

// --- Meshes

TEST_F(StrangerFiles, StatementsAndNamesMayBeWrittenOtherwise) {
  EXPECT_NEAR(sampled("a.obj", "V 0 0 0\nV 2 0 0\nV 2 2 0\nF 1 2 3\n"), 2, 1e-6);
  write("b.mtl", "newmtl a\nKd 0 1 0\n");
  for (const char* name : {"b.mtl", "\"b.mtl\""}) {
    sampled("a.obj",
            fmt::format("mtllib {}\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n", name));
    EXPECT_THAT(notes_.notes, Not(Contains(HasSubstr("not found")))) << name;
  }
}

TEST_F(StrangerFiles, MeshesOfTooFewNumbersAreRefused) {
  const auto refusal = [&](const std::string& mesh) {
    write("a.obj", mesh);
    SampleOptions options;
    return sampleMeshes({path("a.obj")}, path("b.ply"), options, notes_).status().message();
  };
  EXPECT_THAT(refusal("v 0 0\nv 1 0\nv 0 1\nf 1 2 3\n"), HasSubstr("flat ones have 0"));
  EXPECT_THAT(refusal("v\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"), HasSubstr("a vertex of 0 numbers"));
  EXPECT_NE(refusal("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 / 1 2 / 2 3 / 3\n"), "");
}

TEST_F(StrangerFiles, MetalsAreTold) {
  for (const char* metal : {"Pm 1.0", "Pm .3", "pm 1"}) {
    write("b.mtl", fmt::format("newmtl a\nKd .5 .5 .5\n{}\n", metal));
    sampled("a.obj", "mtllib b.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n");
    EXPECT_THAT(notes_.notes, Contains(HasSubstr("1 materials are metals (Pm)"))) << metal;
  }
  write("b.mtl", "newmtl a\nKd .5 .5 .5\nPm 0\n");
  sampled("a.obj", "mtllib b.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n");
  EXPECT_THAT(notes_.notes, Not(Contains(HasSubstr("metals"))));
}

TEST_F(StrangerFiles, CornersMayEndWithStrokes) {
  const std::string square = "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\n";
  for (const char* face : {"f 1/ 2/ 3/ 4/\n", "f 1// 2// 3// 4//\n", "f 1// 2/ 3 4 # all\n"}) {
    EXPECT_NEAR(sampled("a.obj", square + face), 4, 1e-6) << face;
  }
}

TEST_F(StrangerFiles, MeshesBeyondWhatSurfelsHoldAreRefused) {
  for (const char* vertex : {"v 2e38 0 0\n", "v 0 -1e13 0\n", "v 0 0 1e300\n"}) {
    write("a.obj", std::string("v 0 0 0\nv 1 1 1\n") + vertex + "f 1 2 3\n");
    SampleOptions options;
    options.count = 50;
    EXPECT_THAT(sampleMeshes({path("a.obj")}, path("b.ply"), options, notes_).status().message(),
                HasSubstr("surfels have no larger places"))
        << vertex;
  }
}

// They are said of the mesh; but places stay those of its system.
TEST_F(StrangerFiles, CommentsOfMeshesAreCountedAndTheirSystemIsKept) {
  const std::string square = "v 0 0 0\nv 2 0 0\nv 2 2 0\nf 1 2 3\n";
  sampled("a.obj", "# made by X\n#\n# crs EPSG:25832\n" + square + "# end\n");
  EXPECT_THAT(sampledComments(), ElementsAre("up y", "crs EPSG:25832"));
  EXPECT_THAT(notes_.informed, Contains("2 comments of the meshes are not kept"));
  const std::string face =
      "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 "
      "0 1 2\n";
  const std::string head =
      "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n" + face;
  sampled("a.ply", "ply\nformat ascii 1.0\ncomment made by Y\ncomment up z\n" + head);
  EXPECT_THAT(sampledComments(), ElementsAre("up y"));
  EXPECT_THAT(notes_.informed, Contains("1 comments of the meshes are not kept"));
  EXPECT_THAT(notes_.notes, Contains(HasSubstr("z is up, the cloud says y: --up z")));
  sampled("a.ply", "ply\nformat ascii 1.0\ncomment up y\n" + head);
  EXPECT_THAT(notes_.notes, Not(Contains(HasSubstr("is up"))));
}

}  // namespace
}  // namespace surfeit
