// What is told of clouds that read well and hold less than they seem to: numbers that stand for no
// value, colors that are nan, channels without effect, and light that surfels make of nothing.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <string>
#include <vector>

#include "io/surfel_cloud_test.h"
#include "surfeit/cloud_info.h"
#include "surfeit/convert.h"
#include "surfeit/index.h"
#include "surfels/open_surfel_source.h"
#include "surfels/rows/no_data.h"

namespace surfeit {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

class KeepNotes : public Progress {
 public:
  void note(const std::string& message) override { notes.push_back(message); }
  std::vector<std::string> notes;
};

class CloudDoubtsTest : public SurfelCloudTest {
 protected:
  std::vector<std::string> notesOf(const std::vector<std::string>& more,
                                   const std::vector<std::string>& rows) {
    return open(cloud(xyzAnd(more), rows))->notes();
  }
  std::vector<std::string> textNotes(const std::string& text, const std::string& filter = "") {
    write("a.txt", text);
    RowReaderOptions options;
    options.filter = filter;
    const auto source = openSurfelSource(path("a.txt"), false, options);
    EXPECT_TRUE(source.ok()) << source.status().message();
    return source.ok() ? (*source)->notes() : std::vector<std::string>();
  }
};

// --- Numbers that stand for no value

TEST_F(CloudDoubtsTest, NumbersThatStandForNoValueAreTold) {
  for (const char* number : {"-9999", "-32768", "-99999", "1e30", "-1e20", "-3.4028235e+38"}) {
    const std::string bad = std::string("1 2 ") + number + "\n";
    const std::vector<std::string> notes = textNotes("1 2 3.5\n" + bad + "3 4 5.5\n" + bad);
    ASSERT_THAT(notes, Contains(AllOf(HasSubstr("z is "), HasSubstr(" in 2 of 4 records"),
                                      HasSubstr("--filter \"z != "))))
        << number;
    // The advice works
    const std::size_t at = notes.back().find("--filter \"") + 10;
    const std::string filter = notes.back().substr(at, notes.back().find('"', at) - at);
    EXPECT_THAT(textNotes("1 2 3.5\n" + bad + "3 4 5.5\n" + bad, filter),
                ElementsAre(HasSubstr("2")))
        << filter;
  }
  EXPECT_THAT(notesOf({}, {"1 2 -9999", "2 3 4", "3 4 5"}),
              ElementsAre(HasSubstr("z is -9999 in 1 of 3")));
  EXPECT_THAT(notesOf({"float red", "float green", "float blue"},
                      {"1 2 3 -9999 -9999 -9999", "2 3 4 .5 .5 .5"}),
              ElementsAre(HasSubstr("red green blue are -9999 in 1 of 2")));
  EXPECT_THAT(notesOf({"short height"}, {"1 2 3 -32768", "2 3 4 70", "2 3 4 80"}),
              ElementsAre(HasSubstr("height is -32768 in 1 of 3")));
}

// A stream is looked at as a whole, a file that can be sought in from all over.
TEST_F(CloudDoubtsTest, NumbersThatStandForNoValueAreFoundBehindTheBegin) {
  std::string text;
  for (int i = 0; i < 70000; ++i) text += std::to_string(i % 300) + " 2 3.5\n";
  const std::string bad = "1 2 -9999\n";
  EXPECT_THAT(textNotes(text + bad), ElementsAre(HasSubstr("z is -9999 in 1 of 70001 records")));
  EXPECT_THAT(textNotes(text + bad + text, "x < 250"), Contains(HasSubstr("z is -9999 in 1 of ")));
  std::vector<std::string> rows(70000, "1 2 3.5");
  for (std::size_t i = 69000; i < rows.size(); ++i) rows[i] = "1 2 -9999";
  EXPECT_THAT(notesOf({}, rows), Contains(HasSubstr("z is -9999 in ")));
}

// --- Longitudes and latitudes

TEST_F(CloudDoubtsTest, CloudsThatLookLikeDegreesAreTold) {
  const auto notesOfIndex = [&](double x, double y, double step, double height) {
    std::string text;
    for (int i = 0; i < 100; ++i) {
      text += std::to_string(x + i % 10 * step) + " " + std::to_string(y + i / 10 * step) + " " +
              std::to_string(100 + i % 7 * height / 7) + "\n";
    }
    write("a.txt", text);
    KeepNotes notes;
    EXPECT_TRUE(indexClouds({path("a.txt")}, path("a.sft"), {}, notes).ok());
    const auto info = readCloudInfo(path("a.txt"), {}, notes);
    EXPECT_TRUE(info.ok());
    const bool is_told_by_info =
        info.ok() && std::any_of(info->notes.begin(), info->notes.end(), [](const auto& note) {
          return note.find("look like longitudes") != std::string::npos;
        });
    const auto told = std::find_if(notes.notes.begin(), notes.notes.end(), [](const auto& note) {
      return note.find("look like longitudes") != std::string::npos;
    });
    EXPECT_EQ(is_told_by_info, told != notes.notes.end());
    return told == notes.notes.end() ? std::string() : *told;
  };
  EXPECT_THAT(notesOfIndex(7.1, 50.2, 1e-5, 20), HasSubstr("filters.reprojection"));
  EXPECT_THAT(notesOfIndex(-122.4, 37.7, 1e-3, 50), HasSubstr("degrees"));
  EXPECT_THAT(notesOfIndex(5, 45, .2, 3000), HasSubstr("degrees"));
  EXPECT_EQ(notesOfIndex(500000, 5400000, 1e-2, 20), "");
  EXPECT_EQ(notesOfIndex(7.1, 50.2, 1, 20), "");  // as wide as high
  EXPECT_EQ(notesOfIndex(0, 0, .1, 30), "");      // a pole near 0
}

TEST_F(CloudDoubtsTest, PlacesAtZeroFarFromAllOthersAreTold) {
  const auto grid = [](double x, int zeros) {
    std::string text;
    for (int i = 0; i < 20; ++i) {
      text += std::to_string(x + i % 5) + " " + std::to_string(i / 5) + " 7\n";
      if (i < zeros) text += "0 0 0\n";
    }
    return text;
  };
  EXPECT_THAT(textNotes(grid(500000, 3)),
              ElementsAre(AllOf(HasSubstr("x y z are 0 in 3 of 23 records"),
                                HasSubstr("\"(x != 0 or y != 0 or z != 0)\""))));
  EXPECT_THAT(textNotes(grid(-500, 1)), ElementsAre(HasSubstr("x y z are 0 in 1 of 21")));
  EXPECT_THAT(textNotes(grid(500000, 3), "(x != 0 or y != 0 or z != 0)"),
              Not(Contains(HasSubstr("are 0"))));
  EXPECT_THAT(textNotes(grid(500000, 0)), IsEmpty());
  EXPECT_THAT(textNotes("-3 0 0\n3 0 9\n" + grid(-2, 3)), IsEmpty());
  EXPECT_THAT(textNotes("0 0 0\n5 5 5\n"), IsEmpty());
}

TEST_F(CloudDoubtsTest, SkippedRecordsNameThePropertyAndTheWayOut) {
  const auto skipped = [&](const std::vector<std::string>& more, const std::string& row) {
    const auto source = open(cloud(xyzAnd(more), {"1 2 3 1", row}));
    readAll(*source);
    return source->defects().describe();
  };
  EXPECT_EQ(skipped({"float radius"}, "1 2 3 -4"),
            "1 record with a radius that is not positive (first: record 1, whose radius is -4); "
            "--channels radius=- reads such records without it, convert --set changes values");
  EXPECT_THAT(skipped({"float pscale"}, "1 2 3 0"), HasSubstr("--channels pscale=-"));
  EXPECT_THAT(skipped({"float opacity"}, "1 2 3 1.5"),
              AllOf(HasSubstr("whose opacity is 1.5"), HasSubstr("--channels opacity=-")));
  EXPECT_THAT(skipped({"float radius"}, "1 nan 3 1"),
              AllOf(HasSubstr("whose y is nan"), HasSubstr("--filter")));
  EXPECT_THAT(skipped({"float radius"}, "1 2 1e13 1"), HasSubstr("whose z is 1e+13"));
}

TEST_F(CloudDoubtsTest, CoveragesOutOfRangeAreCalledSo) {
  const auto source =
      open(cloud(xyzAnd({"float radius", "float coverage"}), {"1 2 3 1 .5", "1 2 3 1 50"}));
  readAll(*source);
  EXPECT_THAT(source->defects().describe(),
              HasSubstr("1 record with a coverage that is not above 0 and at most 1 (first: record "
                        "1, whose coverage is 50)"));
}

TEST_F(CloudDoubtsTest, ValuesAmongOthersAreNoSuchNumbers) {
  EXPECT_THAT(textNotes("1 2 -9999\n1 2 -20000\n1 2 10000\n"), IsEmpty());
  EXPECT_THAT(textNotes("1 2 -999\n1 2 -1300\n1 2 200\n"), IsEmpty());
  EXPECT_THAT(textNotes("-9999 2 3\n-9999 2 4\n"), IsEmpty());  // a wall: all are there
  EXPECT_THAT(textNotes("1 2 9998\n1 2 -9998\n"), IsEmpty());
}

TEST_F(CloudDoubtsTest, ConvertTellsNumbersThatStandForNoValue) {
  write("a.csv", "x,y,z\n1,2,3\n1,2,-9999\n");
  KeepNotes notes;
  ASSERT_TRUE(convertClouds({path("a.csv")}, path("b.ply"), {}, notes).ok());
  EXPECT_THAT(notes.notes, Contains(AllOf(HasSubstr("a.csv: z is -9999 in 1 of 2"))));
}

// --- Names and comments that a format changes or loses

TEST_F(CloudDoubtsTest, NamesThatOpenVdbChangesAreTold) {
  write("a.ply",
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty "
        "float z\nproperty float my-value\nproperty float Q.x\nproperty float "
        "plain_2\nend_header\n1 2 3 4 5 6\n");
  KeepNotes notes;
  ASSERT_TRUE(convertClouds({path("a.ply")}, path("b.vdb"), {}, notes).ok());
  EXPECT_THAT(notes.notes, ElementsAre(HasSubstr("'my-value' is written as my_value"),
                                       HasSubstr("'Q.x' is written as Q_x")));
}

TEST_F(CloudDoubtsTest, ObjectInformationOfPlyIsAComment) {
  write("a.ply",
        "ply\nformat ascii 1.0\nobj_info num_cols 12\ncomment by a test\nobj_info\nelement vertex "
        "1\nproperty float x\nproperty float y\nproperty float z\nend_header\n1 2 3\n");
  KeepNotes notes;
  ASSERT_TRUE(convertClouds({path("a.ply")}, path("b.ply"), {}, notes).ok());
  EXPECT_THAT(open(path("b.ply"))->comments(), ElementsAre("obj_info num_cols 12", "by a test"));
  ASSERT_TRUE(convertClouds({path("a.ply")}, path("b.prt"), {}, notes).ok());
  EXPECT_THAT(notes.notes, Contains(HasSubstr("no place for comments: 2 are not kept")));
}

// --- Packed colors

// Alpha 255 and red above 127 are the bits of a nan, and colors; those of the nan of texts are
// none.
TEST_F(CloudDoubtsTest, PackedColorsThatAreNanAreTold) {
  const auto pcd = [&](const std::string& name, const std::string& data,
                       const std::string& points) {
    write("a.pcd", "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z " + name +
                       "\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\nWIDTH 3\nHEIGHT 1\nPOINTS "
                       "3\nDATA " +
                       data + "\n" + points);
    return open(path("a.pcd"));
  };
  const auto point = [](std::uint32_t bits) {
    const float place[3] = {1, 2, 3};
    std::string bytes(16, '\0');
    std::memcpy(bytes.data(), place, 12);
    std::memcpy(bytes.data() + 12, &bits, 4);
    return bytes;
  };
  const std::string binary = point(0xFFC83214) + point(0x7fc00000) + point(0x00C83214);
  for (const char* name : {"rgb", "rgba"}) {
    for (const std::string& data : {std::string("binary"), std::string("ascii")}) {
      const std::string points =
          data == "binary" ? binary : "1 2 3 4291310100\n1 2 3 nan\n1 2 3 1.8385e-38\n";
      const auto source = pcd(name, data, points);
      EXPECT_THAT(source->notes(),
                  Contains(AllOf(HasSubstr("the color is nan in 1 of 3"), HasSubstr("TYPE U"))))
          << name << data;
      const std::vector<Surfel> surfels = readAll(*source);
      ASSERT_EQ(surfels.size(), 3u);
      EXPECT_NEAR(surfels[0].albedo.x, .5776, 1e-3) << name << data;  // 200
      EXPECT_EQ(surfels[1].albedo, glm::vec3(0)) << name << data;
      EXPECT_GT(surfels[2].albedo.x, .5f) << name << data;
    }
  }
  // A PLY and a text whose packed color is a float
  EXPECT_THAT(notesOf({"float rgb"}, {"1 2 3 nan", "1 2 3 1.8385e-38"}),
              Contains(HasSubstr("rgb is nan in 1 of 2 records")));
  EXPECT_THAT(textNotes("x y z rgb\n1 2 3 -nan\n1 2 3 1.8385e-38\n"),
              Contains(HasSubstr("rgb is nan in 1 of 2 records")));
  EXPECT_THAT(notesOf({"float rgb"}, {"1 2 3 1.7e-38", "1 2 3 1.8385e-38"}),
              Not(Contains(HasSubstr("nan"))));
}

// As 0xFFC83214 is printed from an integer with a sign.
TEST_F(CloudDoubtsTest, PackedColorsMayBeNegativeIntegers) {
  for (const char* number : {"-3657196", "4291310100", "13120020"}) {
    write("a.txt", std::string("x y z rgb\n1 2 3 ") + number + "\n");
    const auto source = open(path("a.txt"));
    ASSERT_NE(source, nullptr);
    const std::vector<Surfel> surfels = readAll(*source);
    ASSERT_EQ(surfels.size(), 1u);
    EXPECT_NEAR(surfels[0].albedo.x, .5776, 1e-3) << number;  // 200
    EXPECT_NEAR(surfels[0].albedo.y, .0319, 1e-3) << number;  // 50
  }
}

TEST_F(CloudDoubtsTest, FieldsOfPcdThatComeAgainAreTold) {
  const auto notes = [&](const std::string& fields) {
    write("a.pcd", "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z " + fields +
                       "\nSIZE 4 4 4 4 4\nTYPE F F F F F\nCOUNT 1 1 1 1 1\nWIDTH 1\nHEIGHT "
                       "1\nPOINTS 1\nDATA ascii\n1 2 3 4 5\n");
    return open(path("a.pcd"))->notes();
  };
  EXPECT_THAT(notes("intensity intensity"), ElementsAre(HasSubstr("'intensity' comes 2 times")));
  EXPECT_THAT(notes("intensity label"), IsEmpty());
  EXPECT_THAT(notes("_ _"), IsEmpty());
}

// --- Channels without effect

TEST_F(CloudDoubtsTest, CoverageWithoutEffectIsTold) {
  EXPECT_THAT(notesOf({"float radius", "float area", "float coverage"}, {"1 2 3 1 1 .5"}),
              ElementsAre(AllOf(HasSubstr("coverage is not used beside area"),
                                HasSubstr("area *= coverage"))));
  EXPECT_THAT(notesOf({"float area", "float coverage"}, {"1 2 3 1 .5"}),
              ElementsAre(HasSubstr("coverage is not used beside area")));
  EXPECT_THAT(notesOf({"float coverage"}, {"1 2 3 .5"}),
              ElementsAre(HasSubstr("coverage is not used without a radius")));
  EXPECT_THAT(notesOf({"float radius", "float coverage"}, {"1 2 3 1 .5"}), IsEmpty());
}

TEST_F(CloudDoubtsTest, AlphaBesideColorsByOtherNamesIsTold) {
  for (const std::vector<std::string>& names :
       {std::vector<std::string>{"r", "g", "b", "a"},
        {"R", "G", "B", "A"},
        {"diffuse_red", "diffuse_green", "diffuse_blue", "diffuse_alpha"},
        {"color_0", "color_1", "color_2", "color_3"},
        {"scalar_Rf", "scalar_Gf", "scalar_Bf", "scalar_Af"}}) {
    std::vector<std::string> properties;
    for (const std::string& name : names) properties.push_back("uchar " + name);
    EXPECT_THAT(notesOf(properties, {"1 2 3 10 20 30 40"}),
                ElementsAre(HasSubstr("the alpha of 1 of 1 records looked at")))
        << names[0];
  }
  // An a without a color is any value
  EXPECT_THAT(notesOf({"uchar a"}, {"1 2 3 40"}), IsEmpty());
  for (const char* name : {"transparency", "scalar_Transparency"}) {
    EXPECT_THAT(notesOf({std::string("float ") + name}, {"1 2 3 .5"}),
                ElementsAre(AllOf(HasSubstr(name), HasSubstr("--channels alpha=opacity"))));
    EXPECT_THAT(notesOf({std::string("uchar ") + name}, {"1 2 3 128"}),
                ElementsAre(HasSubstr("alpha = 255 - ")));
  }
}

TEST_F(CloudDoubtsTest, NormalsThatLackAComponentAreTold) {
  EXPECT_THAT(notesOf({"float normal_x", "float normal_y"}, {"1 2 3 0 1"}),
              ElementsAre(AllOf(HasSubstr("normal_x normal_y look like a normal that lacks"),
                                HasSubstr("normal_x=-,normal_y=-"))));
  EXPECT_THAT(notesOf({"float NormalZ"}, {"1 2 3 1"}), ElementsAre(HasSubstr("NormalZ=-")));
  EXPECT_THAT(refusal(cloud(xyzAnd({"float nx", "float ny"}), {"1 2 3 0 1"})),
              HasSubstr("found property ny without nz: --channels nx=-,ny=- leaves out"));
  const Result<CloudInfo> info = [&] {
    Progress silent;
    return readCloudInfo(path("a.ply"), {}, silent);
  }();
  ASSERT_TRUE(info.ok());
  EXPECT_THAT(info->notes, ElementsAre(HasSubstr("no surfels: element vertex: found property ny")));
}

// --- Light

TEST_F(CloudDoubtsTest, AlbedosAboveOneAreTold) {
  const auto notesOfIndex = [&](const std::vector<std::string>& names, const std::string& value,
                                bool full_precision) {
    std::vector<std::string> properties = {"float radius", "float area"};
    for (const std::string& name : names) properties.push_back("float " + name);
    const std::string file =
        cloud(xyzAnd(properties), {"0 0 0 1 1 .5 .5 .5", "1 0 0 1 1 .5 .5 " + value});
    KeepNotes notes;
    IndexOptions options;
    options.full_precision = full_precision;
    EXPECT_TRUE(indexClouds({file}, path("a.sft"), options, notes).ok());
    return notes.notes;
  };
  for (const std::vector<std::string>& names :
       {std::vector<std::string>{"red", "green", "blue"}, {"albedo_r", "albedo_g", "albedo_b"}}) {
    EXPECT_THAT(notesOfIndex(names, "2.5", false),
                Contains(AllOf(HasSubstr("1 of 2 surfels have an albedo above 1, up to 2.5"),
                               HasSubstr("it is 1 in the scene"))));
    EXPECT_THAT(notesOfIndex(names, "2.5", true), Contains(HasSubstr("--precision full")));
    EXPECT_THAT(notesOfIndex(names, "1", false), Not(Contains(HasSubstr("albedo above 1"))));
  }
  EXPECT_THAT(notesOfIndex({"radiosity_r", "radiosity_g", "radiosity_b"}, "2.5", false),
              Not(Contains(HasSubstr("albedo above 1"))));
}

}  // namespace
}  // namespace surfeit
