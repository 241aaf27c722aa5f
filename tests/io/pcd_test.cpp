#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include "cloud/scans/pcd_reader.h"
#include "io/row_damage_test.h"

namespace surfeit {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

// A header, its lines to be changed one by one.
struct Head {
  std::string fields = "x y z", sizes = "4 4 4", types = "F F F", counts = "COUNT 1 1 1\n";
  std::string size = "WIDTH 2\nHEIGHT 1\n", view = "0 0 0 1 0 0 0", points = "POINTS 2\n";
  std::string data = "ascii";

  std::string text() const {
    return "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS " + fields + "\nSIZE " +
           sizes + "\nTYPE " + types + "\n" + counts + size + "VIEWPOINT " + view + "\n" + points +
           "DATA " + data + "\n";
  }
};

template <typename... T>
std::string bytesOfAll(T... values) {
  std::string bytes;
  (bytes.append(reinterpret_cast<const char*>(&values), sizeof values), ...);
  return bytes;
}

class PcdTest : public RowFileTest {
 protected:
  std::unique_ptr<RowReader> openGood(const std::string& text, RowReaderOptions options = {}) {
    write("a.pcd", text);
    EXPECT_TRUE(recognisesPcd(text));
    return openOk(openPcd, path("a.pcd"), options);
  }
  std::string refusalOf(const std::string& text) { return refusal(openPcd, text); }
};

TEST_F(PcdTest, AsciiAndBinaryGiveTheSameRows) {
  Head head;
  head.fields = "x y z rgb normal_x normal_y normal_z _ label stamp hist curvature";
  head.sizes = "4 4 4 4 4 4 4 1 2 8 4 8";
  head.types = "F F F F F F F U U I F F";
  head.counts = "COUNT 1 1 1 1 1 1 1 3 1 1 2 1\n";
  const std::string row =
      "float x, float y, float z, uchar red, uchar green, uchar blue, float nx, float ny, "
      "float nz, ushort label, double stamp, float hist_0, float hist_1, double curvature";

  // 1.1754945e-38 and -1.70804499e+38 are 0x00800001 and 0xff007fc0 as bits
  const std::string text = head.text() +
                           "1 2 3 1.1754945e-38 0 0 1 7 7 7 9 -5 0.5 0.25 1e-3\n"
                           "nan 2 3 -1.70804499e+38 1 0 0 0 0 0 65535 9007199254740992 1 2 3\n";
  const std::unique_ptr<RowReader> ascii = openGood(text);
  ASSERT_NE(ascii, nullptr);
  EXPECT_EQ(ascii->formatName(), "PCD 0.7 ascii");
  EXPECT_EQ(describeRow(ascii->element()), "double x, double y, double z" + row.substr(25));
  EXPECT_FALSE(ascii->isSeekable());
  const std::vector<std::byte> rows = readAllRows(*ascii);
  EXPECT_EQ(valueOf(*ascii, rows, 0, "red"), 0x80);
  EXPECT_EQ(valueOf(*ascii, rows, 0, "green"), 0);
  EXPECT_EQ(valueOf(*ascii, rows, 0, "blue"), 1);
  EXPECT_EQ(valueOf(*ascii, rows, 1, "red"), 0);
  EXPECT_EQ(valueOf(*ascii, rows, 1, "green"), 0x7f);
  EXPECT_EQ(valueOf(*ascii, rows, 1, "stamp"), 9007199254740992.0);
  EXPECT_TRUE(std::isnan(valueOf(*ascii, rows, 1, "x")));
  ASSERT_TRUE(ascii->rewind().ok());
  expectReaderKeepsContract(*ascii);

  head.data = "binary";
  const std::uint8_t pad = 7;
  const std::string binary =
      head.text() +
      bytesOfAll(1.f, 2.f, 3.f, 0x00800001u, 0.f, 0.f, 1.f, pad, pad, pad, std::uint16_t(9),
                 std::int64_t(-5), 0.5f, 0.25f, 1e-3) +
      bytesOfAll(float(NAN), 2.f, 3.f, 0xff007fc0u, 1.f, 0.f, 0.f, pad, pad, pad,
                 std::uint16_t(65535), std::int64_t(1) << 53, 1.f, 2.f, 3.0);
  const std::unique_ptr<RowReader> packed = openGood(binary);
  ASSERT_NE(packed, nullptr);
  EXPECT_EQ(packed->formatName(), "PCD 0.7 binary");
  EXPECT_EQ(describeRow(packed->element()), row);
  const std::vector<std::byte> packed_rows = readAllRows(*packed);
  for (const RowProperty& property : packed->element().properties) {
    const double a = valueOf(*ascii, rows, 1, property.name);
    const double b = valueOf(*packed, packed_rows, 1, property.name);
    EXPECT_TRUE(a == b || (std::isnan(a) && std::isnan(b))) << property.name;
  }
  ASSERT_TRUE(packed->rewind().ok());
  expectReaderKeepsContract(*packed);
}

TEST_F(PcdTest, PlainFieldsAreRowsAsTheyStand) {
  Head head;
  head.data = "binary";
  const std::unique_ptr<RowReader> reader =
      openGood(head.text() + bytesOfAll(1.f, 2.f, 3.f, 4.f, 5.f, 6.f));
  EXPECT_EQ(valueOf(*reader, readAllRows(*reader), 1, "y"), 5);
  ASSERT_TRUE(reader->rewind().ok());
  expectReaderKeepsContract(*reader);
}

TEST_F(PcdTest, PackedColorMayHaveAlpha) {
  Head head;
  head.fields = "x y z rgba";
  head.sizes = "4 4 4 4";
  head.types = "F F F U";
  head.counts = "";
  const std::unique_ptr<RowReader> reader =
      openGood(head.text() + "1 2 3 4278255615\n1 2 3 16909060\n");
  EXPECT_EQ(describeRow(reader->element()),
            "double x, double y, double z, uchar red, uchar green, uchar blue, uchar alpha");
  const std::vector<std::byte> rows = readAllRows(*reader);
  EXPECT_EQ(valueOf(*reader, rows, 1, "red"), 2);
  EXPECT_EQ(valueOf(*reader, rows, 1, "blue"), 4);
  EXPECT_EQ(valueOf(*reader, rows, 1, "alpha"), 1);
  EXPECT_EQ(valueOf(*reader, rows, 0, "alpha"), 255);
}

TEST_F(PcdTest, RenamesGoByTheNamesOfTheFile) {
  Head head;
  head.fields = "x y z normal_x rgb weight";
  head.sizes = "4 4 4 4 4 4";
  head.types = "F F F F F F";
  head.counts = "";
  RowReaderOptions options;
  options.channels = {{"normal_x", "slope"}, {"color", "albedo"}, {"weight", "-"}};
  const std::unique_ptr<RowReader> reader =
      openGood(head.text() + "1 2 3 4 5 6\n1 2 3 4 5 6\n", options);
  EXPECT_EQ(describeRow(reader->element()),
            "double x, double y, double z, float slope, uchar albedo_r, uchar albedo_g, uchar "
            "albedo_b");
  EXPECT_EQ(valueOf(*reader, readAllRows(*reader), 1, "slope"), 4);
}

TEST_F(PcdTest, ViewPointIsNoted) {
  Head head;
  EXPECT_TRUE(openGood(head.text() + "1 2 3\n4 5 6")->notes().empty());
  head.view = "0 0 1 1 0 0 0";
  EXPECT_THAT(openGood(head.text() + "1 2 3\n4 5 6\n")->notes(),
              ElementsAre(HasSubstr("view point")));
}

TEST_F(PcdTest, WholeNumbersInFieldsOfFloatsAreTheColor) {
  Head head;
  head.fields = "x y z rgb";
  head.sizes = "4 4 4 4";
  head.types = "F F F F";
  head.counts = "";
  const std::unique_ptr<RowReader> reader =
      openGood(head.text() + "1 2 3 4568635\n4 5 6 4278255361\n");  // and with an alpha of 255
  ASSERT_NE(reader, nullptr);
  const std::vector<std::byte> rows = readAllRows(*reader);
  EXPECT_EQ(valueOf(*reader, rows, 0, "red"), 69);
  EXPECT_EQ(valueOf(*reader, rows, 0, "green"), 182);
  EXPECT_EQ(valueOf(*reader, rows, 0, "blue"), 59);
  EXPECT_EQ(valueOf(*reader, rows, 1, "green"), 255);
  EXPECT_EQ(valueOf(*reader, rows, 1, "blue"), 1);
  EXPECT_EQ(valueOf(*reader, rows, 1, "y"), 5);
}

TEST_F(PcdTest, CapitalsAndColorsApartAreOurNames) {
  Head head;
  head.fields = "X Y Z R G B Normal_X Normal_Y Normal_Z Intensity";
  head.sizes = "4 4 4 1 1 1 4 4 4 4";
  head.types = "F F F U U U F F F F";
  head.counts = "";
  const std::string points = "1 2 3 4 5 6 0 0 1 7\n1 2 3 4 5 6 0 0 1 7\n";
  EXPECT_EQ(describeRow(openGood(head.text() + points)->element()),
            "double x, double y, double z, uchar red, uchar green, uchar blue, float nx, float ny, "
            "float nz, float intensity");
}

TEST_F(PcdTest, PositionsOfTextsKeepTheirDigits) {
  const std::unique_ptr<RowReader> reader =
      openGood(Head().text() + "289814.15 4320978.61 170.76\n289814.64 4320978.84 170.76\n");
  ASSERT_NE(reader, nullptr);
  EXPECT_EQ(valueOf(*reader, readAllRows(*reader), 1, "y"), 4320978.84);
}

// Compressed as PCL does it: field by field, by LZF.
class CompressedPcdTest : public PcdTest {
 protected:
  static std::string literals(const std::string& bytes) {
    std::string lzf;
    for (std::size_t at = 0; at < bytes.size(); at += 32) {
      const std::string piece = bytes.substr(at, 32);
      lzf += static_cast<char>(piece.size() - 1);
      lzf += piece;
    }
    return lzf;
  }
  // 10 to 265 zeros: one, and a copy of it that overlaps itself.
  static std::string zeros(std::size_t count) {
    std::string lzf = literals(std::string(1, '\0'));
    lzf += static_cast<char>(7 << 5);
    lzf += static_cast<char>(count - 1 - 9);
    lzf += '\0';
    return lzf;
  }
  static std::string data(const std::string& lzf, std::uint32_t size) {
    return bytesOfAll(std::uint32_t(lzf.size()), size) + lzf;
  }
  static Head head() {
    Head head;
    head.fields = "x y z rgb label";
    head.sizes = "4 4 4 4 2";
    head.types = "F F F U U";
    head.counts = "COUNT 1 1 1 1 2\n";
    head.data = "binary_compressed";
    return head;
  }
  static std::string points() {
    const std::string values =
        bytesOfAll(1.f, 4.f, 2.f, 5.f, 3.f, 6.f, 0x45b63bu, 0x010203u, std::uint16_t(7),
                   std::uint16_t(8), std::uint16_t(9), std::uint16_t(10));
    return head().text() + data(literals(values), 40);
  }
};

TEST_F(CompressedPcdTest, FieldsBecomeRows) {
  const std::unique_ptr<RowReader> reader = openGood(points());
  ASSERT_NE(reader, nullptr);
  EXPECT_EQ(reader->formatName(), "PCD 0.7 binary_compressed");
  const std::vector<std::byte> rows = readAllRows(*reader);
  EXPECT_EQ(valueOf(*reader, rows, 0, "z"), 3);
  EXPECT_EQ(valueOf(*reader, rows, 1, "x"), 4);
  EXPECT_EQ(valueOf(*reader, rows, 0, "red"), 69);
  EXPECT_EQ(valueOf(*reader, rows, 1, "blue"), 3);
  EXPECT_EQ(valueOf(*reader, rows, 0, "label_1"), 8);
  EXPECT_EQ(valueOf(*reader, rows, 1, "label_0"), 9);
  ASSERT_TRUE(reader->rewind().ok());
  expectReaderKeepsContract(*reader);
}

TEST_F(CompressedPcdTest, ManyPointsAreReadInParts) {
  Head many;
  many.data = "binary_compressed";
  const std::size_t count = 100'000;
  many.size = "WIDTH 100000\nHEIGHT 1\n";
  many.points = "";
  std::string lzf;
  std::size_t left = count * 12;
  for (; left > 300; left -= 200) lzf += zeros(200);
  std::string last(left, '\0');
  const float end = 5;
  std::memcpy(&last[left - 4], &end, 4);
  lzf += literals(last);
  const std::unique_ptr<RowReader> reader = openGood(many.text() + data(lzf, count * 12));
  ASSERT_NE(reader, nullptr);
  const std::vector<std::byte> rows = readAllRows(*reader);
  EXPECT_EQ(valueOf(*reader, rows, count - 1, "z"), 5);
  EXPECT_EQ(valueOf(*reader, rows, count - 1, "x"), 0);
  EXPECT_EQ(valueOf(*reader, rows, count / 2, "z"), 0);
}

TEST_F(CompressedPcdTest, WhatIsNoLzfIsRefused) {
  const std::string start = head().text();
  EXPECT_THAT(refusalOf(start + data(literals("abc"), 40)), HasSubstr("3 bytes come out"));
  EXPECT_THAT(refusalOf(start + data(literals(std::string(41, 'a')), 40)),
              HasSubstr("more than 40 bytes"));
  EXPECT_THAT(refusalOf(start + data("\x20\x05", 40)), HasSubstr("copy of what came 6"));
  EXPECT_THAT(refusalOf(start + data("\x1f", 40)), HasSubstr("ends in the middle"));
  EXPECT_THAT(refusalOf(start + data(literals("abc"), 60)), HasSubstr("2 points of 20"));
}

TEST_F(CompressedPcdTest, TruncationsAndDamageAreHarmless) {
  expectEveryTruncationFails(openPcd, points(), points().size());
  expectDamageIsHarmless(openPcd, points(), 3);
}

TEST_F(PcdTest, CountComesFromPointsOrWidthAndHeight) {
  Head head;
  head.points = "";
  EXPECT_EQ(openGood(head.text() + "1 2 3\n4 5 6\n")->element().count, 2u);
  head.points = "POINTS 2\n";
  head.size = "";
  EXPECT_EQ(openGood(head.text() + "1 2 3\n4 5 6\n")->element().count, 2u);
  head.points = "";
  EXPECT_THAT(refusalOf(head.text()), HasSubstr("expected POINTS, or WIDTH and HEIGHT"));
  head.size = "WIDTH 3\nHEIGHT 3\n";
  head.points = "POINTS 2\n";
  const auto reader = openGood(head.text() + "1 2 3\n4 5 6\n");
  EXPECT_EQ(reader->element().count, 2u);
  EXPECT_THAT(reader->notes(),
              testing::Contains(HasSubstr("WIDTH times HEIGHT are 9 points, POINTS 2")));
  head.size = "WIDTH 18446744073709551615\nHEIGHT 2\n";
  EXPECT_THAT(refusalOf(head.text()), HasSubstr("below 2^64"));
}

TEST_F(PcdTest, DamagedHeadersAreRefused) {
  const auto failure = [this](auto change) {
    Head head;
    change(head);
    return refusalOf(head.text() + "1 2 3\n4 5 6\n");
  };
  EXPECT_THAT(failure([](Head& h) { h.sizes = "4 4"; }), HasSubstr("as many sizes"));
  EXPECT_THAT(failure([](Head& h) { h.sizes = "4 4 3"; }),
              HasSubstr("field 'z', which has type F"));
  EXPECT_THAT(failure([](Head& h) { h.sizes = "4 4 2"; }), HasSubstr("type F and size 2"));
  EXPECT_THAT(failure([](Head& h) { h.sizes = "4 4 q"; }), HasSubstr("line 4: found 'SIZE 4 4 q'"));
  EXPECT_THAT(failure([](Head& h) { h.types = "F F X"; }), HasSubstr("expected types F, I or U"));
  EXPECT_THAT(failure([](Head& h) { h.fields = "_ _ _"; }),
              HasSubstr("expected fields with values"));
  EXPECT_THAT(failure([](Head& h) { h.counts = "COUNT 1 1 99999999999\n"; }),
              HasSubstr("at most 4096"));
  EXPECT_THAT(failure([](Head& h) { h.counts = "COUNT 1 1 4095\n"; }), HasSubstr("at most 4096"));
  EXPECT_THAT(failure([](Head& h) { h.data = "text"; }),
              HasSubstr("DATA ascii, binary or binary_compressed"));
  EXPECT_THAT(failure([](Head& h) { h.view = "0\nFOO 1"; }), HasSubstr("found 'FOO 1'"));
}

TEST_F(PcdTest, TextThatIsNotAsTheHeaderSaysIsRefused) {
  const Head head;
  EXPECT_THAT(refusalOf(head.text() + "1.5 2 3\n4 5\n"),
              HasSubstr("row 1 at line 13: line ends early, expected z of type double"));
  EXPECT_THAT(refusalOf(head.text() + "1 2 3\n4 5 a\n"), HasSubstr("found 'a', expected z"));
  EXPECT_THAT(refusalOf(head.text() + "1 2 3 4\n4 5 6\n"),
              HasSubstr("row 0 at line 12: found '4'"));
  EXPECT_THAT(refusalOf(head.text() + "1 2 3\n4 5 6\n7 8 9\n"), HasSubstr("after the last row"));
  EXPECT_EQ(readAllRows(*openGood(head.text() + "1 2 3\r\n\n 4 5 6\n \n")).size(), 2 * 24u);
}

TEST_F(PcdTest, EveryTruncationIsFound) {
  for (const bool is_text : {true, false}) {
    Head head;
    head.data = is_text ? "ascii" : "binary";
    const std::string whole =
        head.text() + (is_text ? "1 2 3\n4 5 6" : bytesOfAll(1.f, 2.f, 3.f, 4.f, 5.f, 6.f));
    EXPECT_EQ(readAllRows(*openGood(whole)).size(), 2 * (is_text ? 24u : 12u));
    expectEveryTruncationFails(openPcd, whole, whole.size());
    expectDamageIsHarmless(openPcd, whole);
  }
}

TEST_F(PcdTest, ManyAsciiRowsCrossBlocks) {
  constexpr int kRows = 60000;
  Head head;
  head.size = "";
  head.points = "POINTS " + std::to_string(kRows) + "\n";
  std::string text = head.text();
  for (int i = 0; i < kRows; ++i) {
    text += std::to_string(i) + " " + std::to_string(i) + ".5 -" + std::to_string(i) + "e-3\n";
  }
  const std::unique_ptr<RowReader> reader = openGood(text);
  const std::vector<std::byte> rows = readAllRows(*reader);
  for (int i = 0; i < kRows; i += 7) {
    ASSERT_EQ(valueOf(*reader, rows, i, "y"), i + 0.5);
    ASSERT_EQ(valueOf(*reader, rows, i, "z"), -i / 1000.0);
  }
  ASSERT_TRUE(reader->rewind().ok());
  expectReaderKeepsContract(*reader);
}

TEST(PcdSamples, HoldWhatTheirReadmeSays) {
  const std::string name = SURFEIT_SHARED_DATA_DIR "/points/open3d_fragment.pcd";
  if (!std::filesystem::exists(name)) GTEST_SKIP() << "no " << name;
  const Result<std::unique_ptr<RowReader>> reader = openPcd(name, {});
  ASSERT_TRUE(reader.ok()) << reader.status().message();
  EXPECT_EQ(describeRow((*reader)->element()),
            "float x, float y, float z, uchar red, uchar green, uchar blue, float nx, float ny, "
            "float nz, float curvature");
  ASSERT_EQ((*reader)->element().count, 113662u);
  const std::vector<std::byte> rows = readAllRows(**reader);
  double least = 1e9, largest = -1e9;
  for (std::size_t row = 0; row < 113662; ++row) {
    least = std::min(least, valueOf(**reader, rows, row, "x"));
    largest = std::max(largest, valueOf(**reader, rows, row, "x"));
  }
  EXPECT_NEAR(least, 1.152, 5e-4);
  EXPECT_NEAR(largest, 3.5195, 5e-5);
  EXPECT_EQ(valueOf(**reader, rows, 0, "red"), 0x7f);
  EXPECT_EQ(valueOf(**reader, rows, 0, "blue"), 0x6a);
  ASSERT_TRUE((*reader)->rewind().ok());
  expectReaderKeepsContract(**reader);
}

}  // namespace
}  // namespace surfeit
