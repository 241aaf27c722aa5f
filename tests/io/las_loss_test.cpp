// What clouds lose on their way from and to LAS, and that it is told.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "cloud/rows/comment_notes.h"
#include "cloud/scans/las_reader.h"
#include "core/crs_comment.h"
#include "io/convert_tables.h"
#include "io/las_test_file.h"

namespace surfeit {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

class LasLossTest : public ConvertTest {};

TEST_F(LasLossTest, IntegersOf64BitsAreTold) {
  for (const int type : {7, 8}) {
    for (const int scaled : {0, 8, 16}) {
      const std::string descriptor = lasDescriptor("ns", type, scaled, 1);
      write("a.las", withRecords(makeLas(4, 6, 3, 8), {lasRecord("LASF_Spec", 4, descriptor)}));
      const auto reader = openLas(path("a.las"), {});
      ASSERT_TRUE(reader.ok());
      EXPECT_THAT((*reader)->notes(), ElementsAre(HasSubstr("exact to 2^53: 'ns'")))
          << type << " " << scaled;
    }
  }
}

TEST_F(LasLossTest, LinearColorsBecomeShadesOf16Bits) {
  Table table = tableOf({{"x", kFloat},
                         {"y", kFloat},
                         {"z", kFloat},
                         {"red", kFloat},
                         {"green", kFloat},
                         {"blue", kFloat}});
  table.rows = {{0, 0, 0, 0, 1, 0.5}, {1, 0, 0, 3, -1, std::nan("")}};
  writeTable("a.ply", table);
  convertOk({"a.ply"}, "b.las");
  const std::string las = contents("b.las");
  EXPECT_EQ(getLas<std::uint16_t>(lasPoint(las, 0), 30), 0);
  EXPECT_EQ(getLas<std::uint16_t>(lasPoint(las, 0), 32), 65535);
  EXPECT_NEAR(getLas<std::uint16_t>(lasPoint(las, 0), 34), 0.7353570 * 65535, 1);
  EXPECT_EQ(getLas<std::uint16_t>(lasPoint(las, 1), 30), 65535);
  EXPECT_EQ(getLas<std::uint16_t>(lasPoint(las, 1), 34), 0);
  EXPECT_THAT(notes_,
              AllOf(Contains(HasSubstr("becomes sRGB of 16 bits")),
                    Contains(HasSubstr("1 values of red are not from 0 to 1")),
                    Contains(HasSubstr("1 values of green are not from 0 to 1")),
                    Contains(HasSubstr("1 values of blue are not numbers and become black")),
                    Not(Contains(HasSubstr("blue are not from 0 to 1")))));
}

// Positions that are moved or scaled are not those of the system any more.
TEST_F(LasLossTest, MovedPointsLoseTheirCoordinateReferenceSystem) {
  const std::vector<std::uint16_t> keys = {1, 1, 0, 2, 1024, 0, 1, 1, 3072, 0, 1, 2263};
  const std::string key_bytes(reinterpret_cast<const char*>(keys.data()), 2 * keys.size());
  write("keys.las",
        withRecords(makeLas(2, 3, 3), {lasRecord("LASF_Projection", 34735, key_bytes)}));
  write("text.las",
        withRecords(makeLas(4, 6, 3), {lasRecord("LASF_Projection", 2112, "PROJCS[\"x\", 1]")}));
  const auto hasCrs = [&](const std::string& input, const std::string& output,
                          const ConvertOptions& options) {
    convertOk({input}, output, options);
    const auto reader = openRowReader(path(output));
    EXPECT_TRUE(reader.ok());
    return reader.ok() && !statedCrs((*reader)->comments()).empty();
  };
  ConvertOptions scaled = all(), turned = all(), set = all(), cropped = all();
  scaled.transform = {0.3048, 0, 0, 0, 0, 0.3048, 0, 0, 0, 0, 0.3048, 0};
  turned.up = UpAxis::kY;
  set.assignments = {"x = x - 1000000"};
  cropped.crop = CropBox{{-1e9, -1e9, -1e9}, {1e9, 1e9, 1e9}};
  for (const char* input : {"keys.las", "text.las"}) {
    for (const char* output : {"moved.las", "moved.ply"}) {
      SCOPED_TRACE(std::string(input) + " " + output);
      for (const ConvertOptions& moved : {scaled, turned, set}) {
        EXPECT_FALSE(hasCrs(input, output, moved));
        EXPECT_THAT(notes_, Contains(AllOf(HasSubstr("is not kept, because positions are moved"),
                                           HasSubstr(input[0] == 'k' ? "EPSG:2263" : "PROJCS"))));
      }
      for (const ConvertOptions& kept : {all(), cropped}) {
        EXPECT_TRUE(hasCrs(input, output, kept));
        EXPECT_THAT(notes_, Not(Contains(HasSubstr("is not kept"))));
      }
    }
  }
}

TEST_F(LasLossTest, CommentsThatAreLostAreTold) {
  const auto notesOf = [&](const std::string& comments, const std::string& output) {
    write("a.ply", "ply\nformat ascii 1.0\n" + comments +
                       "element vertex 1\nproperty double x\nproperty double y\nproperty double "
                       "z\nproperty uchar group\nend_header\n1 2 3 1\n");
    convertOk({"a.ply"}, output);
    return notes_;
  };
  const std::string crs = "comment crs EPSG:32610\n", name = "comment group 1 lamp\n";
  for (const char* output : {"b.prt", "b.bgeo", "b.pdb", "b.ptc", "b.las"}) {
    SCOPED_TRACE(output);
    const bool is_las = std::string(output) == "b.las";
    const std::vector<std::string> notes = notesOf(crs + name + "comment by a test\n", output);
    EXPECT_THAT(notes, Contains(HasSubstr("has no place for the names of object groups")));
    EXPECT_THAT(notes, Contains(HasSubstr(is_las ? "1 are not kept"
                                                 : "2 are not kept, the coordinate reference "
                                                   "system among them")));
    EXPECT_THAT(notesOf("comment up z\n", output), Not(Contains(HasSubstr("not kept"))));
    EXPECT_THAT(
        notesOf("comment by a test\n", output),
        AllOf(Contains(HasSubstr("1 are not kept")), Not(Contains(HasSubstr("reference system"))),
              Not(Contains(HasSubstr("object groups")))));
  }
}

// Units are told where they are not metres, by keys and by text.
TEST_F(LasLossTest, UnitsThatAreNotMetresAreTold) {
  const auto notesOf = [&](std::uint16_t number, const std::string& data) {
    write("a.las", withRecords(makeLas(4, 6, 3), {lasRecord("LASF_Projection", number, data)}));
    const auto reader = openLas(path("a.las"), {});
    EXPECT_TRUE(reader.ok());
    if (!reader.ok()) return std::vector<std::string>();
    std::vector<std::string> notes = (*reader)->notes();
    for (std::string& note : notesOfComments((*reader)->comments())) notes.push_back(note);
    return notes;
  };
  const auto ofKeys = [&](std::uint16_t unit, std::uint16_t vertical_unit) {
    std::vector<std::uint16_t> words = {1, 1, 0, 2, 1024, 0, 1, 1, 3072, 0, 1, 2992};
    if (unit != 0) words.insert(words.end(), {3076, 0, 1, unit});
    if (vertical_unit != 0) words.insert(words.end(), {4099, 0, 1, vertical_unit});
    return notesOf(34735, {reinterpret_cast<const char*>(words.data()), 2 * words.size()});
  };
  EXPECT_THAT(ofKeys(0, 0), ElementsAre(HasSubstr("convert --units ft:m")));  // as 2992 is
  EXPECT_THAT(ofKeys(9001, 9001), testing::IsEmpty());
  EXPECT_THAT(ofKeys(9002, 0),
              ElementsAre(AllOf(HasSubstr("positions are in 'feet'"), HasSubstr("ft:m"))));
  EXPECT_THAT(ofKeys(9003, 9003), ElementsAre(HasSubstr("convert --units us-ft:m")));
  EXPECT_THAT(ofKeys(9001, 9002), ElementsAre(AllOf(HasSubstr("heights are in 'feet'"),
                                                    HasSubstr("--set \"z *= 0.3048\""))));
  EXPECT_THAT(ofKeys(9002, 9001), ElementsAre(HasSubstr("--set \"z *= 3.2808399\"")));
  EXPECT_THAT(ofKeys(0, 9003), ElementsAre(HasSubstr("heights are in 'US survey feet'")));
  EXPECT_THAT(ofKeys(9999, 0), ElementsAre(HasSubstr("'unit 9999 of EPSG'")));

  const std::string degrees = "PROJCS[\"a\",GEOGCS[\"b\",UNIT[\"degree\",0.0174532925]],";
  EXPECT_THAT(notesOf(2112, degrees + "UNIT[\"metre\",1]]"), testing::IsEmpty());
  EXPECT_THAT(notesOf(2112, degrees + "UNIT[\"foot_survey_us\",0.3048006096012192]]"),
              ElementsAre(HasSubstr("convert --units us-ft:m")));
  EXPECT_THAT(notesOf(2112, "PROJCRS[\"a\",CS[Cartesian,2],LENGTHUNIT[\"foot\",0.3048]]"),
              ElementsAre(HasSubstr("positions are in 'foot'")));
  EXPECT_THAT(notesOf(2112, "COMPD_CS[\"c\"," + degrees +
                                "UNIT[\"metre\",1]],VERT_CS[\"v\",UNIT[\"foot\",0.3048]]]"),
              ElementsAre(HasSubstr("heights are in 'foot'")));
}

TEST_F(LasLossTest, UnitsOfHeightsFollowFromTheirSystem) {
  const auto notesOf = [&](std::uint16_t vertical, std::uint16_t unit) {
    const std::vector<std::uint16_t> words = {1,    1, 0, 4,        1024, 0, 1, 1,
                                              3072, 0, 1, 2,        3076, 0, 1, 9001,
                                              4096, 0, 1, vertical, 4099, 0, 1, unit};
    write(
        "a.las",
        withRecords(makeLas(4, 6, 3),
                    {lasRecord("LASF_Projection", 34735,
                               {reinterpret_cast<const char*>(words.data()), 2 * words.size()})}));
    const auto reader = openLas(path("a.las"), {});
    EXPECT_TRUE(reader.ok());
    return reader.ok() ? notesOfComments((*reader)->comments()) : std::vector<std::string>();
  };
  EXPECT_THAT(notesOf(6360, 0), ElementsAre(HasSubstr("heights are in 'US survey feet'")));
  EXPECT_THAT(notesOf(8228, 0), ElementsAre(HasSubstr("heights are in 'feet'")));
  EXPECT_THAT(notesOf(5703, 0), testing::IsEmpty());
  EXPECT_THAT(notesOf(6360, 9001), testing::IsEmpty());  // what is stated goes before
}

// Most files of state planes have the code alone (key 3072), and so do comments of other formats.
TEST_F(LasLossTest, UnitsFollowFromTheCodeOfTheSystem) {
  struct Row {
    std::uint16_t code;
    const char* told;
  };
  for (const Row& row : {Row{2992, "--units ft:m"}, Row{2225, "--units us-ft:m"}, Row{6339, ""},
                         Row{26910, ""}, Row{32618, ""}, Row{2263, "--units us-ft:m"},
                         Row{2267, "--units us-ft:m"}, Row{6868, "--units ft:m"},
                         Row{6880, "--units us-ft:m"}, Row{29377, "German legal"}, Row{3857, ""}}) {
    const std::vector<std::uint16_t> words = {1, 1, 0, 2, 1024, 0, 1, 1, 3072, 0, 1, row.code};
    write(
        "a.las",
        withRecords(makeLas(4, 6, 3),
                    {lasRecord("LASF_Projection", 34735,
                               {reinterpret_cast<const char*>(words.data()), 2 * words.size()})}));
    convertOk({"a.las"}, "b.ply");
    convertOk({"b.ply"}, "c.las");
    for (const char* name : {"a.las", "b.ply", "c.las"}) {
      const auto reader = openRowReader(path(name));
      ASSERT_TRUE(reader.ok());
      const std::vector<std::string> notes = notesOfComments((*reader)->comments());
      if (row.told[0] == 0) {
        EXPECT_THAT(notes, testing::IsEmpty()) << row.code << name;
      } else {
        EXPECT_THAT(notes, ElementsAre(HasSubstr(row.told))) << row.code << name;
      }
    }
  }
  // A unit that is stated goes before, also behind a PLY
  EXPECT_THAT(notesOfComments(std::vector<std::string>{"crs EPSG:2992 unit 9001"}),
              testing::IsEmpty());
  EXPECT_THAT(notesOfComments(std::vector<std::string>{"crs a local grid unit 9003"}),
              ElementsAre(HasSubstr("--units us-ft:m")));
  EXPECT_THAT(notesOfComments(std::vector<std::string>{
                  "crs PROJCS[\"a\",GEOGCS[\"b\",UNIT[\"degree\",0.017]],UNIT[\"US survey "
                  "foot\",0.304800609601219]]"}),
              ElementsAre(HasSubstr("--units us-ft:m")));
}

// Keys say what the angles are, from LAS to PLY and back.
TEST_F(LasLossTest, UnitsOfAnglesAreToldAndKept) {
  const auto crsOf = [&](const std::vector<std::uint16_t>& keys, const std::string& file) {
    std::vector<std::uint16_t> words = {1, 1, 0, std::uint16_t(keys.size() / 2)};
    for (std::size_t i = 0; i < keys.size(); i += 2) {
      words.insert(words.end(), {keys[i], 0, 1, keys[i + 1]});
    }
    write(
        "a.las",
        withRecords(makeLas(2, 3, 3),
                    {lasRecord("LASF_Projection", 34735,
                               {reinterpret_cast<const char*>(words.data()), 2 * words.size()})}));
    if (file != "a.las") convertOk({"a.las"}, "b.ply");
    if (file == "c.las") convertOk({"b.ply"}, "c.las");
    const auto reader = openRowReader(path(file));
    EXPECT_TRUE(reader.ok());
    return reader.ok() ? std::string(statedCrs((*reader)->comments())) : std::string();
  };
  for (const char* file : {"a.las", "b.ply", "c.las"}) {
    EXPECT_EQ(crsOf({1024, 2, 2048, 4807, 2054, 9105}, file),
              "geographic EPSG:4807 angular unit 9105")
        << file;
    EXPECT_EQ(crsOf({1024, 2, 2048, 4326, 2054, 9102}, file), "geographic EPSG:4326") << file;
  }
  EXPECT_THAT(noteOfDegrees("geographic EPSG:4807 angular unit 9105"),
              HasSubstr("x and y are gons"));
  EXPECT_THAT(noteOfDegrees("geographic EPSG:4326 angular unit 9101"),
              HasSubstr("x and y are radians"));
  // Angles without a code are angles; those beside a projection are of its datum
  EXPECT_EQ(crsOf({2054, 9102}, "a.las"), "geographic by GeoTIFF keys without a code");
  EXPECT_EQ(crsOf({2054, 9102, 3072, 32632}, "a.las"), "EPSG:32632");
}

// Whole degrees of old point formats are no multiples of .006.
TEST_F(LasLossTest, AnglesBecomeTheNearestStep) {
  for (const ValueType type : {ValueType::kInt8, kFloat}) {
    Table table = tableOf({{"x", kFloat}, {"y", kFloat}, {"z", kFloat}, {"scan_angle", type}});
    table.rows = {{0, 0, 0, 10}, {1, 0, 0, -17}, {2, 0, 0, 0}};
    writeTable("a.ply", table);
    convertOk({"a.ply"}, "b.las");
    EXPECT_EQ(getLas<std::uint16_t>(contents("b.las"), 105), 30);
    EXPECT_EQ(getLas<std::int16_t>(lasPoint(contents("b.las"), 0), 18), 1667);
    EXPECT_EQ(getLas<std::int16_t>(lasPoint(contents("b.las"), 1), 18), -2833);
    EXPECT_THAT(notes_, Contains(HasSubstr("scan_angle changes by up to 0.002, since LAS stores "
                                           "multiples of 0.006")));
    table.rows = {{0, 0, 0, 6}, {1, 0, 0, -12}};
    writeTable("a.ply", table);
    convertOk({"a.ply"}, "b.las");
    EXPECT_THAT(notes_, Not(Contains(HasSubstr("scan_angle"))));
  }
}

}  // namespace
}  // namespace surfeit
