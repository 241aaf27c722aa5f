// Clouds as text in the forms that programs write: decimal commas, names of columns, line ends,
// several scans, Leica's PTX.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "cloud/cloud_formats.h"
#include "cloud/scans/ptx_reader.h"
#include "cloud/text/xyz_reader.h"
#include "io/row_damage_test.h"

namespace surfeit {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

class TextCloudTest : public RowFileTest {
 protected:
  static RowReaderOptions withChannels(const std::string& list) {
    RowReaderOptions options;
    Result<std::vector<ChannelRename>> channels = parseChannelRenames(list);
    EXPECT_TRUE(channels.ok()) << channels.status().message();
    if (channels.ok()) options.channels = *channels;
    return options;
  }

  // Opened as any command does, by its first bytes.
  std::unique_ptr<RowReader> openText(const std::string& text, const std::string& channels = "") {
    write("a.txt", text);
    return openOk(openRowReader, path("a.txt"), withChannels(channels));
  }

  // "x=1 y=2 z=3 |notes"
  std::string rowOf(const std::string& text, std::uint64_t row, const std::string& channels = "") {
    const std::unique_ptr<RowReader> reader = openText(text, channels);
    if (reader == nullptr) return "";
    notes_ = reader->notes();
    const std::vector<std::byte> rows = readAllRows(*reader);
    std::string values;
    for (const RowProperty& property : reader->element().properties) {
      const double value = valueOf(*reader, rows, static_cast<std::size_t>(row), property.name);
      char number[64];
      std::snprintf(number, sizeof number, "%s%s=%.7g", values.empty() ? "" : " ",
                    property.name.c_str(), value);
      values += number;
    }
    return values;
  }

  std::string typesOf(const std::string& text, const std::string& channels = "") {
    const std::unique_ptr<RowReader> reader = openText(text, channels);
    return reader ? describeRow(reader->element()) : "";
  }

  std::string refusalOf(const std::string& text, const std::string& channels = "") {
    write("a.txt", text);
    const Status status = readStatus(openRowReader, path("a.txt"), withChannels(channels));
    EXPECT_EQ(status.code(), StatusCode::kCorruption) << status.message();
    EXPECT_THAT(status.message(), HasSubstr(path("a.txt")));
    return status.message();
  }

  std::vector<std::string> notes_;
};

// --- Decimal commas ---

TEST_F(TextCloudTest, CommasBetweenOtherSeparatorsAreDecimal) {
  const std::string second = "x=418.5 y=50.25 z=4.75";
  for (const char* text : {"1,5;2,5;3,5\n418,5;50,25;4,75\n", "X;Y;Z\n1,5;2;3\n418,5;50,25;4,75\n",
                           "1,5\t2\t3\r\n418,5\t50,25\t4,75\r\n", "1 2 3\n418,5 50,25 4,75\n",
                           "# x y z\n1,5  2  3\n418,5  50,25  4,75",
                           "1,5;2;3;\n418,5;50,25;4,75;\n", "1; 2; 3\n4,185e2; 50,25; 4,75E0\n",
                           "\"1,5\";\"2\";\"3\"\n\"418,5\";\"50,25\";\"4,75\"\n"}) {
    EXPECT_EQ(rowOf(text, 1), second) << text;
    EXPECT_THAT(notes_, Contains(HasSubstr("decimal commas"))) << text;
  }
  EXPECT_EQ(rowOf("-1,5;-0,5;0\n", 0), "x=-1.5 y=-0.5 z=0");
  // Semicolons are written where commas are decimal, so they group no thousands
  EXPECT_EQ(rowOf("418,446;50,290;4,725\n", 0), "x=418.446 y=50.29 z=4.725");
}

TEST_F(TextCloudTest, UnitsOfPlacesAreTold) {
  for (const char* head :
       {"X [ft],Y [ft],Z [ft]", "x (FT);y (FT);z (ft)", "Easting(ft)\tNorthing(ft)\tElevation"}) {
    EXPECT_EQ(rowOf(std::string(head) + "\n1;2;3\n", 0), "x=1 y=2 z=3") << head;
    EXPECT_THAT(notes_, Contains(HasSubstr("places are in 'ft'"))) << head;
  }
  for (const char* head : {"X (m);Y (m);Z (m)", "x;y;z", "x [Metres];y;z"}) {
    rowOf(std::string(head) + "\n1;2;3\n", 0);
    EXPECT_THAT(notes_, Not(Contains(HasSubstr("places are in")))) << head;
  }
  rowOf("x;y;z;intensity (ft)\n1;2;3;4\n", 0);
  EXPECT_THAT(notes_, Not(Contains(HasSubstr("places are in"))));
}

TEST_F(TextCloudTest, OneDecimalCommaInAnyLineSettlesIt) {
  std::string text;
  for (int i = 0; i < 40000; ++i) text += "100 200 300\n";
  EXPECT_EQ(rowOf(text + "1,25 2 3\n", 40000), "x=1.25 y=2 z=3");
  for (int i = 0; i < 40000; ++i) text += "100,125 200,250 300,500\n";
  EXPECT_EQ(rowOf(text + "0,725 2 3\n", 40000), "x=100.125 y=200.25 z=300.5");
  EXPECT_THAT(refusalOf(text), HasSubstr("they group thousands"));
}

TEST_F(TextCloudTest, AmbiguousCommasAreRefusedWithBothReadings) {
  EXPECT_THAT(refusalOf("1,234 2,345 3,456\n"),
              AllOf(HasSubstr("'1,234 2,345 3,456'"), HasSubstr("1,234 is 1.234"),
                    HasSubstr("1,234 is 1234"), HasSubstr("--text decimal-comma")));
  EXPECT_THAT(refusalOf("1,234.5 2,345.6 3,456.7\n"), HasSubstr("group thousands are not read"));
  EXPECT_THAT(refusalOf("1.234,5;2.345,6;3.456,7\n"), HasSubstr("group thousands are not read"));
  EXPECT_THAT(refusalOf("1,2 3 4\n1.5 2 3\n"), HasSubstr("--text"));
  EXPECT_THAT(refusalOf("418,446,50,290,4,725\n419,012,51,250,4,001\n"),
              HasSubstr("before decimals as well as between values"));
  EXPECT_EQ(rowOf("1,234 2,345 3,456\n", 0, "--text=decimal-comma"), "x=1.234 y=2.345 z=3.456");
  EXPECT_THAT(notes_, IsEmpty());
  EXPECT_EQ(rowOf("10,20,30,255,100,160\n", 0), "x=10 y=20 z=30 red=255 green=100 blue=160");
  EXPECT_EQ(rowOf("10,20,30,40,50,60\n11,21,31,41,51,61\n", 1, "--text=decimal-point"),
            "x=11 y=21 z=31 red=41 green=51 blue=61");
  EXPECT_THAT(refusalOf("x,y,z\n\"1,5\",\"2,5\",\"3,5\"\n"),
              HasSubstr("within quotes and between"));
  EXPECT_THAT(refusalOf("1,5,2,5,3,5\n", "--text=decimal-comma"),
              HasSubstr("1 values, expected three or more"));
  write("a.txt", "1 2 3\n");
  EXPECT_EQ(openRowReader(path("a.txt"), withChannels("--text=roman")).status().code(),
            StatusCode::kInvalidArgument);
}

TEST_F(TextCloudTest, CommasAndBlanksTogetherPartValues) {
  EXPECT_EQ(rowOf("1, 2, 3\n4 ,5 ,6\n", 1), "x=4 y=5 z=6");
  EXPECT_EQ(rowOf("1.5,2,3\n4,5,6\n", 1), "x=4 y=5 z=6");
  EXPECT_EQ(rowOf("1,2,3\n4,5,6\n", 1), "x=4 y=5 z=6");
  EXPECT_THAT(notes_, IsEmpty());
}

// --- Names ---

TEST_F(TextCloudTest, HeadersOfProgramsNameColumns) {
  const std::string xyz = "x=1 y=2 z=3";
  EXPECT_EQ(rowOf("Easting,Northing,Elevation,R,G,B\n1,2,3,235,209,186\n", 0),
            xyz + " red=235 green=209 blue=186");
  EXPECT_EQ(rowOf("N E H\n2 1 3\n", 0), "y=2 x=1 z=3");
  EXPECT_EQ(rowOf("ID;Northing;Easting;Height\n7;2,5;1,5;3,5\n", 0), "id=7 y=2.5 x=1.5 z=3.5");
  EXPECT_EQ(rowOf("\"X (m)\",\"Y (m)\",\"Z (m)\",\"M3C2 distance\"\n1,2,3,.5\n", 0),
            xyz + " M3C2_distance=0.5");
  EXPECT_EQ(rowOf("//X,Y,Z,R,G,B,Scalar field\n1,2,3,10,20,30,4\n", 0),
            xyz + " red=10 green=20 blue=30 Scalar_field=4");
  EXPECT_EQ(rowOf("X\tY\tZ\tM3C2 distance\n1\t2\t3\t4\n", 0), xyz + " M3C2_distance=4");
  EXPECT_EQ(typesOf("//X Y Z Rf Gf Bf Nx Ny Nz\n1 2 3 0.5 0.25 1 0 0 1\n"),
            "float x, float y, float z, float red, float green, float blue, float nx, float ny, "
            "float nz");
  EXPECT_EQ(rowOf("//X Y Z R G B A\n2\n1 2 3 10 20 30 255\n1 2 3 10 20 30 255\n", 1),
            xyz + " red=10 green=20 blue=30 alpha=255");
  EXPECT_EQ(
      rowOf("\"Points:0\",\"Points:1\",\"Points:2\",\"Normals:0\",\"Normals:1\",\"Normals:2\","
            "\"velocity:0\"\n1,2,3,0,0,1,5\n",
            0),
      xyz + " nx=0 ny=0 nz=1 velocity_0=5");
  EXPECT_EQ(rowOf("RGB:0,RGB:1,RGB:2,Points:0,Points:1,Points:2\n9,8,7,1,2,3\n", 0),
            "red=9 green=8 blue=7 x=1 y=2 z=3");
  EXPECT_EQ(rowOf("X Y Z NormalX NormalY NormalZ Intensity\n1 2 3 0 1 0 9\n", 0),
            xyz + " nx=0 ny=1 nz=0 intensity=9");
  EXPECT_EQ(rowOf("x y z r\n1 2 3 4\n", 0), xyz + " r=4");  // no color without its fellows
}

TEST_F(TextCloudTest, ColumnsMayBeNamedByNameInTheFileAndByNumber) {
  const std::string csv = "X,Y,Z,\"M3C2 distance\",Class\n1,2,3,4,ground\n";
  EXPECT_THAT(refusalOf(csv), HasSubstr("column 5 (Class), expected one: --channels 5=- leaves"));
  EXPECT_EQ(rowOf(csv, 0, "M3C2 distance=weight,Class=-"), "x=1 y=2 z=3 weight=4");
  EXPECT_EQ(rowOf(csv, 0, "4=weight,5=-"), "x=1 y=2 z=3 weight=4");
  EXPECT_EQ(rowOf("Name;X;Y;Z\nP1;1,5;2;3\nP2;4;5;6,5\n", 1, "1=-,--text=decimal-comma"),
            "x=4 y=5 z=6.5");
  EXPECT_EQ(typesOf("1 2 3 4 50 60 70\n", "4=weight,5=red,6=green,7=blue"),
            "float x, float y, float z, float weight, uchar red, uchar green, uchar blue");
  EXPECT_EQ(rowOf("a b c d\n1 2 3 4\n", 0, "2=x,3=y,4=z"), "column_1=1 x=2 y=3 z=4");
  EXPECT_THAT(refusalOf("a b c d\n1 2 3 4\n"),
              AllOf(HasSubstr("'a b c d'"), HasSubstr("--channels 1=x,2=y,3=z")));
  EXPECT_EQ(rowOf("x,y,z,note\n1,2,3,\n4,5,6,\n", 1, "note=-"), "x=4 y=5 z=6");
  EXPECT_THAT(refusalOf("1 2 3 4 5\n", "4=red,5=red"), HasSubstr("second red"));
}

TEST_F(TextCloudTest, AnglesAreRefused) {
  EXPECT_THAT(refusalOf("lat,lon,height\n47.1,11.2,600\n"),
              AllOf(HasSubstr("angles"), HasSubstr("project")));
  EXPECT_THAT(refusalOf("# Longitude Latitude Z\n11.2 47.1 600\n"), HasSubstr("angles"));
  EXPECT_EQ(rowOf("lat,lon,x,y,z\n47,11,1,2,3\n", 0), "lat=47 lon=11 x=1 y=2 z=3");
  EXPECT_EQ(rowOf("# lat and lon of the site: 47, 11\n1 2 3\n", 0), "x=1 y=2 z=3");
}

TEST_F(TextCloudTest, CommentsThatNameOtherColumnsAreTold) {
  EXPECT_EQ(rowOf("# x y z\n1 2 3 4\n", 0), "x=1 y=2 z=3 intensity=4");
  EXPECT_THAT(notes_, Contains(HasSubstr("names 3 columns, lines have 4 values")));
}

// --- Columns without names, by all rows ---

TEST_F(TextCloudTest, AlphaAndIntensityAreToldFromAllRows) {
  const auto rows_of = [](const std::string& row, const std::string& last) {
    std::string text;
    for (int i = 0; i < 30000; ++i) text += row;
    return text + last;
  };
  const std::string color = " red=10 green=20 blue=30";
  EXPECT_EQ(rowOf("1 2 3 10 20 30 255\n1 2 3 11 20 30 255\n", 0),
            "x=1 y=2 z=3" + color + " alpha=255");
  EXPECT_EQ(rowOf("1 2 3 10.0 20.0 30.0 255.0\n1 2 3 11.0 20.0 30.0 255.0\n", 0),
            "x=1 y=2 z=3" + color + " alpha=255");
  EXPECT_EQ(typesOf("1 2 3 10.0 20.0 30.0 255.0\n1 2 3 11.0 20.0 30.0 255.0\n"),
            "float x, float y, float z, uchar red, uchar green, uchar blue, uchar alpha");
  EXPECT_EQ(rowOf("1 2 3 0.1 0.2 0.3 1\n1 2 3 0.2 0.2 0.3 1\n", 0),
            "x=1 y=2 z=3 red=0.1 green=0.2 blue=0.3 alpha=1");
  EXPECT_EQ(rowOf("1 2 3 1000 2000 3000 65535\n1 2 3 100 2000 3000 65535\n", 0),
            "x=1 y=2 z=3 red=1000 green=2000 blue=3000 alpha=65535");
  EXPECT_EQ(rowOf("1 2 3 -5 10 20 30\n", 0), "x=1 y=2 z=3 intensity=-5" + color);
  EXPECT_EQ(rowOf("1 2 3 0.5 10 20 30\n", 0), "x=1 y=2 z=3 intensity=0.5" + color);
  // In PTS the intensity comes first
  EXPECT_EQ(rowOf("2\n1 2 3 5 10 20 30\n1 2 3 6 10 20 31\n", 0), "x=1 y=2 z=3 intensity=5" + color);
  EXPECT_THAT(refusalOf("1 2 3 5 10 20 30\n1 2 3 6 10 20 31\n"),
              AllOf(HasSubstr("'red green blue alpha', or 'scalar red green blue'"),
                    HasSubstr("--channels 4=red,5=green,6=blue,7=alpha")));
  EXPECT_EQ(rowOf("1 2 3 5 10 20 30\n1 2 3 6 10 20 31\n", 0, "4=intensity,5=red,6=green,7=blue"),
            "x=1 y=2 z=3 intensity=5" + color);
  // The last row counts as the first
  EXPECT_THAT(rowOf(rows_of("1 2 3 5 10 20 30\n1 2 3 6 10 20 31\n", "1 2 3 500 1 2 3\n"), 0),
              HasSubstr("intensity=5"));
  EXPECT_THAT(typesOf(rows_of("1 2 3 0 0 1\n", "1 2 3 50 60 70\n")), HasSubstr("uchar red"));
  EXPECT_THAT(typesOf(rows_of("1 2 3\n", "637012.24 2 3\n")), HasSubstr("double x"));
}

TEST_F(TextCloudTest, ThreeColumnsThatAreNeitherNormalsNorColorsAreRefused) {
  for (const char* last : {"0 65536 0", "0 0.5 0", "0 -1 0", "0.5 300.5 0.5"}) {
    EXPECT_THAT(refusalOf("1 2 3 10 20 30\n1 2 3 " + std::string(last) + "\n"),
                AllOf(HasSubstr("columns 4 to 6"), HasSubstr("neither normals"),
                      HasSubstr("--channels 4=NAME,5=NAME,6=NAME")));
  }
  EXPECT_THAT(refusalOf("1 2 3 1 2 3 4 5\n"), HasSubstr("say which"));
}

// --- Lines ---

TEST_F(TextCloudTest, LinesEndInAnyWay) {
  const std::vector<std::string> ends = {"\n", "\r\n", "\r"};
  for (const std::string& end : ends) {
    std::string text = "# x y z weight" + end;
    for (int i = 0; i < 50000; ++i) text += std::to_string(i) + " 2 3 4" + end;
    const std::unique_ptr<RowReader> reader = openText(text);
    ASSERT_NE(reader, nullptr);
    EXPECT_EQ(reader->element().count, 50000u);
    const std::vector<std::byte> rows = readAllRows(*reader);
    for (std::size_t row = 0; row < 50000; row += 7) {
      ASSERT_EQ(valueOf(*reader, rows, row, "x"), double(row));
    }
    ASSERT_TRUE(reader->rewind().ok());
    expectReaderKeepsContract(*reader);
  }
  EXPECT_EQ(rowOf("1 2 3\r4 5 6\n7 8 9\r\n10 11 12", 3), "x=10 y=11 z=12");
}

TEST_F(TextCloudTest, ScansOfPtsAreOneCloud) {
  const std::string scan = "2\n1 2 3 -5 10 20 30\n4 5 6 -5 10 20 30\n";
  const std::unique_ptr<RowReader> reader = openText(scan + scan + "1\n7 8 9 -5 10 20 30\n");
  ASSERT_NE(reader, nullptr);
  EXPECT_EQ(reader->element().count, 5u);
  EXPECT_THAT(reader->notes(), Contains(HasSubstr("3 scans, one after another")));
  EXPECT_EQ(valueOf(*reader, readAllRows(*reader), 4, "x"), 7);
  EXPECT_THAT(rowOf("3\r\n1 2 3\r\n4 5 6\r\n", 1), "x=4 y=5 z=6");
  EXPECT_THAT(notes_, Contains(HasSubstr("scan 1 counts 3 points, 2 follow")));
  EXPECT_THAT(refusalOf("1 2 3\n2\n4 5 6\n"), HasSubstr("row 1 at line 2"));  // no PTS
}

TEST_F(TextCloudTest, Utf16IsNamed) {
  EXPECT_THAT(refusalOf(std::string("\xFF\xFE"
                                    "1\0 \0",
                                    6)),
              HasSubstr("UTF-16"));
}

// --- PTX ---

std::string ptxScan(int columns, int rows, const std::string& matrix, const std::string& points) {
  return std::to_string(columns) + "\n" + std::to_string(rows) + "\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n" +
         matrix + points;
}
constexpr const char* kTurned = "0 1 0 0\n-1 0 0 0\n0 0 1 0\n100000.25 200 300 1\n";
constexpr const char* kIdentity = "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";

TEST_F(TextCloudTest, PtxScansStandWhereTheirMatricesPutThem) {
  const std::string text =
      ptxScan(2, 2, kTurned,
              "1 2 3 0.5 10 20 30\n0 0 0 0.5 0 0 0\n4 5 6 0.25 40 50 60\n0.0 0.0 0.0 0.5\n") +
      ptxScan(1, 1, kIdentity, "7 8 9 1 70 80 90");
  const std::unique_ptr<RowReader> reader = openText(text);
  ASSERT_NE(reader, nullptr);
  EXPECT_EQ(reader->formatName(), "PTX");
  EXPECT_EQ(describeRow(reader->element()),
            "double x, double y, double z, float intensity, uchar red, uchar green, uchar blue");
  EXPECT_THAT(reader->notes(), ElementsAre(HasSubstr("2 of 5 points are at 0 0 0"),
                                           HasSubstr("2 scans are one cloud")));
  const std::vector<std::byte> rows = readAllRows(*reader);
  ASSERT_EQ(reader->element().count, 3u);
  EXPECT_EQ(valueOf(*reader, rows, 0, "x"), 100000.25 - 2);
  EXPECT_EQ(valueOf(*reader, rows, 0, "y"), 201);
  EXPECT_EQ(valueOf(*reader, rows, 1, "z"), 306);
  EXPECT_EQ(valueOf(*reader, rows, 1, "green"), 50);
  EXPECT_EQ(valueOf(*reader, rows, 2, "x"), 7);
  EXPECT_EQ(valueOf(*reader, rows, 2, "intensity"), 1);
  ASSERT_TRUE(reader->rewind().ok());
  expectReaderKeepsContract(*reader);
  EXPECT_EQ(rowOf(ptxScan(1, 1, kIdentity, "1 2 3 0.5\n"), 0, "intensity=-"), "x=1 y=2 z=3");
}

TEST_F(TextCloudTest, PtxThatIsDamagedIsRefused) {
  const std::string scan = ptxScan(2, 1, kIdentity, "1 2 3 0.5\n4 5 6 0.5\n");
  EXPECT_EQ(rowOf(scan, 1), "x=4 y=5 z=6 intensity=0.5");
  EXPECT_THAT(refusalOf(ptxScan(2, 2, kIdentity, "1 2 3 0.5\n")),
              HasSubstr("scan 1 at line 11: file ends early, expected 3 more points"));
  EXPECT_THAT(refusalOf(ptxScan(1, 1, "1 0 0 5\n0 1 0 6\n0 0 1 7\n0 0 0 1\n", "1 2 3 0.5\n")),
              HasSubstr("translation stands in the last row"));
  EXPECT_THAT(refusalOf(scan + ptxScan(1, 1, kIdentity, "1 2 3 0.5 1 2 3\n")),
              HasSubstr("expected 4 numbers as in the points before"));
  EXPECT_THAT(refusalOf(ptxScan(1, 1, kIdentity, "1 2 3 0.5 1 2 300\n")), HasSubstr("0 to 255"));
  EXPECT_THAT(refusalOf(ptxScan(1, 1, kIdentity, "1 2 3\n")), HasSubstr("4 or 7 numbers"));
  EXPECT_THAT(refusalOf(scan + "1 2 3 4\n"), HasSubstr("expected the columns of a scan's grid"));
  write("huge", "99999999999999999\n2\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n");
  EXPECT_EQ(readStatus(openPtx, path("huge")).code(), StatusCode::kCorruption);
  expectDamageIsHarmless(openPtx, scan);
}

TEST_F(TextCloudTest, DamageIsHarmless) {
  expectDamageIsHarmless(openXyz, "X;\"Y\";Z;Class a\r\n1,5;2;3;4\r\n\"5,5\";6;7;8\r\n");
  expectDamageIsHarmless(openXyz, "2\r1 2 3 -5 10 20 30\r4 5 6 -5 10 20 30\r1\r1 2 3 4 5 6 7\r");
}

// --- Cases ---

TEST_F(TextCloudTest, CasesAreRead) {
  const std::string cases = SURFEIT_SHARED_DATA_DIR "/../cases/text/";
  if (!std::filesystem::exists(cases)) GTEST_SKIP() << "no shared data in " << cases;
  struct Case {
    const char* name;
    std::uint64_t count;
    const char* property;
    double second;  // its value in the second row
  };
  for (const Case& one : {Case{"comma_semicolon.csv", 60, "x", 418.446},
                          {"comma_semicolon_header.csv", 60, "y", 50.29},
                          {"cc_rgba_int.xyz", 60, "red", 83},
                          {"cc_rgba_real.xyz", 60, "alpha", 255},
                          {"cc_rgb_real.xyz", 60, "blue", 33},
                          {"cc_header_rf.txt", 60, "green", 0.729412},
                          {"quoted_spaces.csv", 60, "M3C2_distance", 83},
                          {"easting.csv", 60, "z", 4.725},
                          {"cr_only.txt", 60, "z", 4.725},
                          {"pts_two_scans.pts", 60, "red", 83},
                          {"scan.ptx", 3, "x", 104}}) {
    const std::unique_ptr<RowReader> reader = openOk(openRowReader, cases + one.name);
    ASSERT_NE(reader, nullptr);
    EXPECT_EQ(reader->element().count, one.count) << one.name;
    EXPECT_NEAR(valueOf(*reader, readAllRows(*reader), 1, one.property), one.second, 1e-4)
        << one.name;
  }
  EXPECT_THAT(readStatus(openRowReader, cases + "comma_blank.txt").message(),
              HasSubstr("--text decimal-comma"));
  const RowReaderOptions commas = withChannels("--text=decimal-comma");
  const std::unique_ptr<RowReader> reader =
      openOk(openRowReader, cases + "comma_blank.txt", commas);
  EXPECT_NEAR(valueOf(*reader, readAllRows(*reader), 1, "x"), 418.446, 1e-4);
}

}  // namespace
}  // namespace surfeit
