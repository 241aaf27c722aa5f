#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <random>
#include <string>
#include <vector>

#include "cloud/ply/ply_number.h"
#include "cloud/text/text_rows.h"
#include "cloud/text/xyz_reader.h"
#include "cloud/text/xyz_writer.h"
#include "io/row_damage_test.h"

namespace surfeit {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

class XyzTest : public RowFileTest {
 protected:
  std::unique_ptr<RowReader> openGood(const std::string& text, RowReaderOptions options = {}) {
    write("a.xyz", text);
    EXPECT_TRUE(recognisesXyz(text.substr(0, kMagicBytes)));
    return openOk(openXyz, path("a.xyz"), options);
  }

  // The properties of a row.
  std::string rowOf(const std::string& text, RowReaderOptions options = {}) {
    const std::unique_ptr<RowReader> reader = openGood(text, std::move(options));
    return reader ? describeRow(reader->element()) : "";
  }

  std::string refusalOf(const std::string& text) { return refusal(openXyz, text); }

  void writeXyz(const std::string& name, const std::vector<RowProperty>& columns,
                const std::vector<std::byte>& rows, const std::vector<std::string>& comments = {}) {
    RowWriterOptions options;
    options.properties = columns;
    options.comments = comments;
    Result<std::unique_ptr<RowWriter>> writer = createXyz(path(name), options);
    ASSERT_TRUE(writer.ok()) << writer.status().message();
    ASSERT_TRUE((*writer)->writeRows(rows).ok());
    ASSERT_TRUE((*writer)->finish().ok());
  }
};

// --- Numbers ---

template <typename T>
void expectParsed(const std::string& text, ValueType type) {
  const TextColumn column{"v", type, 0, true};
  std::byte fast[8], slow[8];
  // Integers with zeros after a point are read in text, not in PLY
  const bool is_pointed = type < ValueType::kFloat32 && text == "1.";
  ASSERT_EQ(parseTextRow(text, {&column, 1}, fast), parsePlyNumber(text, type, slow) || is_pointed)
      << text;
  if (!parsePlyNumber(text, type, slow)) return;
  ASSERT_EQ(std::memcmp(fast, slow, sizeof(T)), 0) << text;
}

TEST(TextNumber, IsRoundedAsFromCharsDoes) {
  std::mt19937_64 random(5);
  char text[64];
  for (int i = 0; i < 300000; ++i) {
    const double value = std::ldexp(double(random() >> 11), int(random() % 200) - 150);
    const int digits = int(random() % 18) + 1;
    const char* const forms[] = {"%.*g", "%.*e", "%.*f", "-%.*g"};
    std::snprintf(text, sizeof text, forms[random() % 4], digits, value);
    expectParsed<float>(text, ValueType::kFloat32);
    expectParsed<double>(text, ValueType::kFloat64);
  }
  // Floats and the points half way between them, written in full
  for (int i = 0; i < 100000; ++i) {
    const float value = std::ldexp(float(random() >> 40), -int(random() % 24));
    std::snprintf(text, sizeof text, "%.25g",
                  (double(value) + double(std::nextafter(value, 1e9f))) / 2);
    expectParsed<float>(text, ValueType::kFloat32);
  }
}

TEST(TextNumber, OddSpellingsAreReadAsInPly) {
  for (const char* text : {"0",
                           "-0",
                           "+1",
                           "+-1",
                           "--1",
                           "1.",
                           ".5",
                           ".",
                           "-",
                           "",
                           "1e",
                           "1e+",
                           "1e5",
                           "1E+5",
                           "1e+-5",
                           "1e-400",
                           "1e400",
                           "-1e400",
                           "1e99999999999",
                           "nan",
                           "-nan",
                           "inf",
                           "infinity",
                           "-inf",
                           "0x10",
                           "1.5f",
                           "1_000",
                           "12345678901234567890123",
                           "0.00000000000000000000001234567890123456789",
                           "9007199254740993",
                           "9007199254740992e22",
                           "1e22",
                           "1e23",
                           "16777217",
                           "3.4028236e38",
                           "1e-45",
                           "1.17549435e-38",
                           "0e5",
                           "0e-999",
                           "000000000000000000000000001",
                           "1..2",
                           "1.2.3"}) {
    expectParsed<float>(text, ValueType::kFloat32);
    expectParsed<double>(text, ValueType::kFloat64);
    expectParsed<std::int8_t>(text, ValueType::kInt8);
    expectParsed<std::uint32_t>(text, ValueType::kUint32);
  }
}

// --- Columns ---

TEST_F(XyzTest, ColumnsFollowFromTheirNumberAndValues) {
  const std::string p = "float x, float y, float z", n = ", float nx, float ny, float nz",
                    c = ", uchar red, uchar green, uchar blue";
  EXPECT_EQ(rowOf("1 2 3\n"), p);
  EXPECT_EQ(rowOf("1 2 3 7.5\n"), p + ", float intensity");
  EXPECT_EQ(rowOf("1 2 3 0 0.6 0.8\n1 2 3 0 0 1\n"), p + n);
  EXPECT_EQ(rowOf("1 2 3 0 0.6 0.9\n"), p + ", float red, float green, float blue");
  EXPECT_EQ(rowOf("1 2 3 0 60 90\n"), p + c);
  EXPECT_EQ(rowOf("1 2 3 -1200 0 60 90\n"), p + ", float intensity" + c);
  EXPECT_EQ(rowOf("1 2 3 0 0 1 0.25\n"), p + n + ", float scalar");
  EXPECT_EQ(rowOf("1 2 3 255 0 60 0 1 0\n"), p + c + n);
  EXPECT_EQ(rowOf("1 2 3 0 1 0 255 0 60\n"), p + n + c);
  EXPECT_EQ(rowOf("1 2 3 0.5 0.25\n"), p + ", float intensity, float scalar");
}

TEST_F(XyzTest, HeadersNameColumns) {
  const std::string row =
      "float x, float y, float z, uchar red, uchar green, uchar blue, float nx, float Weight";
  const std::string data = "1 2 3 255 0 60 0 1\n";
  EXPECT_EQ(rowOf("# x y z r g b nx Weight\n" + data), row);
  EXPECT_EQ(rowOf("//X Y Z R G B Nx Weight\n" + data), row);
  EXPECT_EQ(rowOf("x y z red green blue normal_x Weight\n" + data), row);
  EXPECT_EQ(rowOf("\"X\",\"Y\",\"Z\",\"R\",\"G\",\"B\",\"NX\",\"Weight\"\n1,2,3,255,0,60,0,1\n"),
            row);
  EXPECT_EQ(rowOf("\xEF\xBB\xBFx;y;z\n1;2;3\n"), "float x, float y, float z");
  EXPECT_EQ(rowOf("# x y z a a\n1 2 3 4 5\n"), "float x, float y, float z, float a, float a_2");
  EXPECT_EQ(rowOf("# z y x\n1 2 3\n"), "float z, float y, float x");
  // A comment that names another number of columns is none that does
  const std::unique_ptr<RowReader> reader = openGood("# made by hand\n# x y z\n1 2 3 4\n");
  EXPECT_EQ(describeRow(reader->element()), "float x, float y, float z, float intensity");
  EXPECT_THAT(reader->comments(), ElementsAre("made by hand", "x y z"));
}

TEST_F(XyzTest, SeparatorsMayBeBlanksTabsCommasAndSemicolons) {
  for (const char* text :
       {"1 2 3\n4 5 6\n", "1\t2\t3\n4\t5\t6\n", "1,2,3\n4,5,6\n", "1;2;3\n4;5;6",
        "  1 ,2 , 3 \r\n\r\n4, 5,6,\r\n", "# a\n1 2 3\n// b\n# c\n\n4 5 6\n \n"}) {
    const std::unique_ptr<RowReader> reader = openGood(text);
    ASSERT_NE(reader, nullptr);
    ASSERT_EQ(reader->element().count, 2u) << text;
    const std::vector<std::byte> rows = readAllRows(*reader);
    EXPECT_EQ(valueOf(*reader, rows, 0, "z"), 3);
    EXPECT_EQ(valueOf(*reader, rows, 1, "x"), 4);
    EXPECT_EQ(valueOf(*reader, rows, 1, "z"), 6);
    ASSERT_TRUE(reader->rewind().ok());
    expectReaderKeepsContract(*reader);
  }
}

TEST_F(XyzTest, CountOfPtsIsPassedOver) {
  const std::unique_ptr<RowReader> reader = openGood("2\n1 2 3 -5 255 0 0\n1 2 3 -5 255 0 0\n");
  EXPECT_EQ(reader->element().count, 2u);
  EXPECT_EQ(valueOf(*reader, readAllRows(*reader), 1, "intensity"), -5);
}

TEST_F(XyzTest, CoordinatesAreDoublesWhereFloatsWouldLoseDigits) {
  EXPECT_EQ(rowOf("637012.24 2 3 0.1\n"), "double x, double y, double z, float intensity");
  EXPECT_EQ(rowOf("0.1 -3.456789 1e-3 1234567.89\n"),
            "float x, float y, float z, double intensity");
  // A float with more decimals than it has
  EXPECT_EQ(rowOf("123.456787 3e10 -0\n"), "float x, float y, float z");
  const std::unique_ptr<RowReader> reader = openGood("637012.24 851000.123 3\n");
  EXPECT_EQ(valueOf(*reader, readAllRows(*reader), 0, "x"), 637012.24);
}

TEST_F(XyzTest, TypesOfColorsFollowFromAllRows) {
  const auto row_with = [this](const std::string& color, const std::string& last) {
    std::string text;
    for (int i = 0; i < 30000; ++i) text += "1 2 3 " + color + "\n";
    return rowOf(text + "1 2 3 " + last + "\n");
  };
  EXPECT_THAT(row_with("10 20 30", "255 0 0"), HasSubstr("uchar red"));
  EXPECT_THAT(row_with("10 20 30", "256 0 0"), HasSubstr("ushort red"));
  EXPECT_THAT(row_with("1 0 1", "1 1 1"), HasSubstr("float red"));
  EXPECT_THAT(row_with("0.1 0.2 0.3", "1 1 0"), HasSubstr("float red"));
}

TEST_F(XyzTest, GroupsAndLargeNumbersKeepTheirDigits) {
  EXPECT_EQ(rowOf("# x y z group two_sided id\n1 2 3 5 1 16777217\n"),
            "float x, float y, float z, uchar group, uchar two_sided, double id");
}

TEST_F(XyzTest, RenamesMapAndDropColumns) {
  RowReaderOptions options;
  options.channels = {{"color", "albedo"}, {"normal", "-"}, {"x", "z"}, {"z", "x"}};
  const std::string text = "1 2 3 0 1 0 255 0 60\n";
  EXPECT_EQ(rowOf(text, options),
            "float z, float y, float x, uchar albedo_r, uchar albedo_g, uchar albedo_b");
  const std::unique_ptr<RowReader> reader = openGood(text, options);
  const std::vector<std::byte> rows = readAllRows(*reader);
  EXPECT_EQ(valueOf(*reader, rows, 0, "albedo_b"), 60);
  EXPECT_EQ(valueOf(*reader, rows, 0, "x"), 3);
  options.channels = {{"y", "x"}};
  EXPECT_THAT(openXyz(path("a.xyz"), options).status().message(), HasSubstr("second x"));
}

// --- What is not text of points ---

TEST_F(XyzTest, OtherFilesAreNotRecognised) {
  for (const char* text :
       {"", "\n", "hello world\n", "v 1 2 3\n", "1 2\n", "1\n2\n3\n", "1 2 a\n", "{\"x\": 1}\n",
        "#usda 1.0\n(\n", "# a comment\n", "ply\nformat ascii 1.0\n", "x,y\n1,2\n", "1,,2,3\n",
        "# Blender\nmtllib a.mtl\n", "12 a\n1 2 3\n"}) {
    EXPECT_FALSE(recognisesXyz(text)) << text;
  }
  EXPECT_FALSE(recognisesXyz(std::string_view("1 2 3\n\0\n", 8)));
  EXPECT_TRUE(recognisesXyz("# x y z\n"));
  EXPECT_TRUE(recognisesXyz("1 2 3"));
  EXPECT_TRUE(recognisesXyz("#" + std::string(kMagicBytes, 'a')));
}

TEST_F(XyzTest, RowsThatAreNotAsTheFirstAreRefused) {
  EXPECT_THAT(refusalOf("1 2 3\n\n4 5\n"),
              HasSubstr("row 1 at line 3: line ends early, expected z"));
  EXPECT_THAT(refusalOf("1 2 3\n4 5 6 7\n"), HasSubstr("row 1 at line 2: found '7'"));
  EXPECT_THAT(refusalOf("1 2 3\n4 b 6\n"), HasSubstr("found 'b', expected y of type float"));
  EXPECT_THAT(refusalOf("1,2,3\n4,,6\n"), HasSubstr("found '', expected y"));
  EXPECT_THAT(refusalOf("1 2 3 x\n"), HasSubstr("line 1: found no number in column 4"));
  EXPECT_THAT(refusalOf("x y z w\n1 2 3\n"), HasSubstr("line 2: 3 values, expected 4"));
  EXPECT_THAT(refusalOf("# nothing\n"), HasSubstr("found no line of numbers"));
  EXPECT_THAT(refusalOf("hello\n"), HasSubstr("line 1: found 'hello', expected three numbers"));
  std::string wide;
  for (int i = 0; i < 300; ++i) wide += "1 ";
  EXPECT_THAT(refusalOf(wide), HasSubstr("more than 256 values"));
  EXPECT_THAT(refusalOf("1 2 3\n" + std::string(300000, ' ') + "4\n"),
              HasSubstr("more than 262144"));
}

// --- Round trips ---

std::vector<RowProperty> mixedColumns() {
  return {rowProperty("x"),
          rowProperty("y"),
          rowProperty("z"),
          rowProperty("nx"),
          rowProperty("ny"),
          rowProperty("nz"),
          rowProperty("red", ValueType::kUint8),
          rowProperty("green", ValueType::kUint8),
          rowProperty("blue", ValueType::kUint8),
          rowProperty("stamp", ValueType::kFloat64),
          rowProperty("radiosity_r"),
          rowProperty("group", ValueType::kUint8)};
}

std::vector<std::byte> mixedRows(std::size_t count) {
  RowLayout element;
  element.properties = mixedColumns();
  packRow(element);
  std::mt19937_64 random(9);
  std::vector<std::byte> rows(count * element.row_bytes);
  for (std::size_t row = 0; row < count; ++row) {
    for (const RowProperty& property : element.properties) {
      std::byte* const at = &rows[row * element.row_bytes + property.offset];
      if (property.type == ValueType::kFloat32) {
        const float value = std::ldexp(float(std::int64_t(random()) >> 40), -int(random() % 60));
        std::memcpy(at, &value, sizeof value);
      } else if (property.type == ValueType::kFloat64) {
        const double value = std::ldexp(double(std::int64_t(random()) >> 11), -40);
        std::memcpy(at, &value, sizeof value);
      } else {
        *at = std::byte(random());
      }
    }
  }
  return rows;
}

TEST_F(XyzTest, RowsRoundTripBitForBit) {
  const std::vector<std::byte> rows = mixedRows(30000);
  for (const char* name : {"a.xyz", "a.csv", "a.txt.gz", "a.csv.zst"}) {
    writeXyz(name, mixedColumns(), rows, {"a comment\nof two lines"});
    const Result<std::unique_ptr<RowReader>> reader = openXyz(path(name), {});
    ASSERT_TRUE(reader.ok()) << reader.status().message();
    EXPECT_EQ(describeRow((*reader)->element()),
              "float x, float y, float z, float nx, float ny, float nz, uchar red, uchar green, "
              "uchar blue, double stamp, float radiosity_r, uchar group");
    EXPECT_THAT((*reader)->comments(), ElementsAre("a comment of two lines"));
    EXPECT_TRUE(readAllRows(**reader) == rows);
    ASSERT_TRUE((*reader)->rewind().ok());
    expectReaderKeepsContract(**reader);
  }
  EXPECT_THAT(contents("a.csv").substr(0, 60), HasSubstr("\nx,y,z,nx,ny,nz,red"));
  EXPECT_THAT(contents("a.xyz").substr(0, 60), HasSubstr("\n# x y z nx ny nz red"));
}

TEST_F(XyzTest, NoRowsRoundTripToo) {
  writeXyz("a.xyz", mixedColumns(), {});
  EXPECT_TRUE(recognisesXyz(contents("a.xyz")));
  const Result<std::unique_ptr<RowReader>> reader = openXyz(path("a.xyz"), {});
  ASSERT_TRUE(reader.ok()) << reader.status().message();
  EXPECT_EQ((*reader)->element().count, 0u);
  EXPECT_EQ((*reader)->element().properties.size(), 12u);
  EXPECT_TRUE(readAllRows(**reader).empty());
}

TEST_F(XyzTest, RowsThatCannotBeWrittenAreRefused) {
  RowWriterOptions options;
  options.properties = {rowProperty("x"), rowProperty("y")};
  EXPECT_THAT(createXyz(path("b.xyz"), options).status().message(), HasSubstr("no positions"));
  options.properties = {rowProperty("x"), rowProperty("y"), rowProperty("z"), rowProperty("a,b")};
  EXPECT_THAT(createXyz(path("b.xyz"), options).status().message(), HasSubstr("'a,b'"));
  options.properties.pop_back();
  Result<std::unique_ptr<RowWriter>> writer = createXyz(path("b.xyz"), options);
  ASSERT_TRUE(writer.ok());
  EXPECT_EQ((*writer)->writeRows(std::vector<std::byte>(13)).code(), StatusCode::kInvalidArgument);
  writer->reset();
  EXPECT_EQ(fileCount(), 0);
}

}  // namespace
}  // namespace surfeit
