#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include "io/byte_output.h"
#include "io/formats/las_reader.h"
#include "io/row_damage_test.h"

namespace surfeit {
namespace {

using testing::HasSubstr;

constexpr std::size_t kRecordBytes[] = {20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67};
constexpr std::size_t kColorAt[] = {0, 0, 20, 28, 0, 28, 0, 30, 30, 0, 30};

template <typename T>
void put(std::string& text, std::size_t at, T value) {
  std::memcpy(&text[at], &value, sizeof value);
}

// A file of `count` points: point i is at (i, -2 i, 3) of its grid, intensity i, class i mod 32.
std::string makeLas(unsigned minor, unsigned format, std::uint32_t count, std::size_t extra = 0) {
  const std::size_t header = minor < 4 ? 227 : 375;
  const std::size_t record = kRecordBytes[format] + extra;
  std::string text(header + count * record, '\0');
  text.replace(0, 4, "LASF");
  put(text, 24, char(1));
  put(text, 25, char(minor));
  put(text, 94, std::uint16_t(header));
  put(text, 96, std::uint32_t(header));
  put(text, 104, char(format));
  put(text, 105, std::uint16_t(record));
  if (format <= 5) put(text, 107, count);
  if (minor >= 4) put(text, 247, std::uint64_t(count));
  for (std::size_t axis = 0; axis < 3; ++axis) {
    put(text, 131 + 8 * axis, 0.01);
    put(text, 155 + 8 * axis, 1e6 * double(axis + 1));
  }
  for (std::uint32_t i = 0; i < count; ++i) {
    const std::size_t at = header + i * record;
    put(text, at, std::int32_t(i));
    put(text, at + 4, -2 * std::int32_t(i));
    put(text, at + 8, std::int32_t(3));
    put(text, at + 12, std::uint16_t(i));
    put(text, at + (format <= 5 ? 15 : 16), char(i % 32 | (format <= 5 ? 0x60 : 0)));
    for (std::size_t c = 0; kColorAt[format] != 0 && c < 3; ++c) {
      put(text, at + kColorAt[format] + 2 * c, std::uint16_t(60000 + c));
    }
  }
  return text;
}

class LasTest : public RowFileTest {
 protected:
  std::unique_ptr<RowReader> openGood(const std::string& text, RowReaderOptions options = {}) {
    write("a.las", text);
    return openOk(openLas, path("a.las"), options);
  }
  std::string refusalOf(const std::string& text) { return refusal(openLas, text); }
};

TEST_F(LasTest, EveryPointFormatIsRead) {
  for (unsigned format = 0; format <= 10; ++format) {
    for (const std::size_t extra : {0, 5}) {
      const unsigned minor = format <= 5 ? 2 : 4;
      const std::unique_ptr<RowReader> reader = openGood(makeLas(minor, format, 40, extra));
      ASSERT_NE(reader, nullptr) << format;
      EXPECT_EQ(reader->formatName(),
                "LAS 1." + std::to_string(minor) + " point format " + std::to_string(format));
      EXPECT_EQ(
          describeRow(reader->element()),
          std::string("double x, double y, double z, ushort intensity, uchar classification") +
              (kColorAt[format] ? ", ushort red, ushort green, ushort blue" : ""));
      const std::vector<std::byte> rows = readAllRows(*reader);
      EXPECT_EQ(valueOf(*reader, rows, 39, "x"), 39 * 0.01 + 1e6);
      EXPECT_EQ(valueOf(*reader, rows, 39, "y"), -78 * 0.01 + 2e6);
      EXPECT_EQ(valueOf(*reader, rows, 39, "z"), 3 * 0.01 + 3e6);
      EXPECT_EQ(valueOf(*reader, rows, 39, "intensity"), 39);
      EXPECT_EQ(valueOf(*reader, rows, 39, "classification"), 7);
      if (kColorAt[format]) {
        EXPECT_EQ(valueOf(*reader, rows, 39, "blue"), 60002);
      }
      ASSERT_TRUE(reader->rewind().ok());
      expectReaderKeepsContract(*reader);
    }
  }
}

TEST_F(LasTest, EveryVersionIsRead) {
  for (unsigned minor = 0; minor <= 4; ++minor) {
    EXPECT_EQ(openGood(makeLas(minor, 0, 3))->element().count, 3u);
  }
  EXPECT_THAT(refusalOf(makeLas(5, 0, 3)), HasSubstr("found version 1.5, expected 1.0 to 1.4"));
}

TEST_F(LasTest, CountOf64BitsGoesFirst) {
  std::string text = makeLas(4, 3, 5);
  put(text, 107, std::uint32_t(2));
  EXPECT_EQ(openGood(text)->element().count, 5u);
  put(text, 247, std::uint64_t(0));
  EXPECT_EQ(openGood(text)->element().count, 2u);
  put(text, 247, std::uint64_t(1) << 40);
  EXPECT_THAT(refusalOf(text), HasSubstr("hold 5 records of 34 bytes, expected 1099511627776"));
  put(text, 247, ~std::uint64_t(0));
  EXPECT_THAT(refusalOf(text), HasSubstr("expected 18446744073709551615"));
}

TEST_F(LasTest, CompressedPointsAreRefusedWithAdvice) {
  for (const int bit : {0x80, 0x40, 0xC0}) {
    std::string text = makeLas(2, 3, 5);
    put(text, 104, char(3 | bit));
    EXPECT_TRUE(recognisesLas(text));
    EXPECT_THAT(refusalOf(text), HasSubstr("decompress it first (laszip"));
  }
}

TEST_F(LasTest, EveryTruncationIsFound) {
  for (const unsigned minor : {2u, 4u}) {
    const std::string whole = makeLas(minor, 3, 3);
    EXPECT_EQ(readAllRows(*openGood(whole)).size(), 3 * 33u);
    expectEveryTruncationFails(openLas, whole, whole.size());
    expectDamageIsHarmless(openLas, whole, 3);
  }
}

TEST_F(LasTest, DamagedHeadersAreRefused) {
  const auto patched = [](std::size_t at, auto value) {
    std::string text = makeLas(2, 3, 3);
    put(text, at, value);
    return text;
  };
  EXPECT_THAT(refusalOf(patched(0, 'l')), HasSubstr("found 'lASF', expected 'LASF'"));
  EXPECT_THAT(refusalOf(patched(94, std::uint16_t(226))), HasSubstr("expected 227 or more"));
  EXPECT_THAT(refusalOf(patched(96, std::uint32_t(226))), HasSubstr("found points at 226"));
  EXPECT_THAT(refusalOf(patched(96, ~std::uint32_t(0))), HasSubstr("file ends early: 0 bytes"));
  EXPECT_THAT(refusalOf(patched(104, char(11))), HasSubstr("found point format 11"));
  EXPECT_THAT(refusalOf(patched(105, std::uint16_t(33))), HasSubstr("expected 34 or more"));
  EXPECT_THAT(refusalOf(patched(107, std::uint32_t(4))), HasSubstr("hold 3 records"));
  EXPECT_THAT(refusalOf(patched(131, 0.0)), HasSubstr("found scale 0"));
  EXPECT_THAT(refusalOf(patched(139, double(NAN))), HasSubstr("found scale nan"));
  EXPECT_THAT(refusalOf(patched(171, double(INFINITY))), HasSubstr("found offset inf"));
}

TEST_F(LasTest, GzippedFilesAreRead) {
  const std::string text = makeLas(2, 3, 5000);
  const std::unique_ptr<RowReader> plain = openGood(text);
  Result<ByteOutput> output = ByteOutput::create(path("b.las.gz"));
  ASSERT_TRUE(output.ok() && output->append(std::as_bytes(std::span(text))).ok() &&
              output->commit().ok());
  const Result<std::unique_ptr<RowReader>> packed = openLas(path("b.las.gz"), {});
  ASSERT_TRUE(packed.ok()) << packed.status().message();
  EXPECT_TRUE(readAllRows(*plain) == readAllRows(**packed));
  ASSERT_TRUE((*packed)->rewind().ok());
  expectReaderKeepsContract(**packed);
}

TEST_F(LasTest, RenamesMapAndDropChannels) {
  RowReaderOptions options;
  options.channels = {{"color", "albedo"}, {"intensity", "-"}, {"classification", "group"}};
  EXPECT_EQ(describeRow(openGood(makeLas(2, 2, 3), options)->element()),
            "double x, double y, double z, uchar group, ushort albedo_r, ushort albedo_g, "
            "ushort albedo_b");
}

TEST(LasSamples, HoldWhatTheirReadmeSays) {
  const std::string name = SURFEIT_SHARED_DATA_DIR "/points/autzen_trim.las";
  if (!std::filesystem::exists(name)) GTEST_SKIP() << "no " << name;
  const Result<std::unique_ptr<RowReader>> reader = openLas(name, {});
  ASSERT_TRUE(reader.ok()) << reader.status().message();
  EXPECT_EQ((*reader)->formatName(), "LAS 1.2 point format 3");
  ASSERT_EQ((*reader)->element().count, 110000u);
  const std::vector<std::byte> rows = readAllRows(**reader);
  double least[4] = {1e9, 1e9, 1e9, 1e9}, largest[4] = {};
  for (std::size_t row = 0; row < 110000; ++row) {
    const char* const names[] = {"x", "y", "z", "red"};
    for (std::size_t i = 0; i < 4; ++i) {
      const double value = valueOf(**reader, rows, row, names[i]);
      least[i] = std::min(least[i], value);
      largest[i] = std::max(largest[i], value);
    }
  }
  EXPECT_NEAR(least[0], 6.36e5, 5);
  EXPECT_NEAR(largest[0], 6.3718e5, 5);
  EXPECT_NEAR(least[1], 8.4894e5, 5);
  EXPECT_NEAR(largest[1], 8.495e5, 5);
  EXPECT_NEAR(least[2], 406.26, 0.005);
  EXPECT_NEAR(largest[2], 520.51, 0.005);
  EXPECT_GE(least[3], 36);
  EXPECT_LE(largest[3], 255);
  ASSERT_TRUE((*reader)->rewind().ok());
  expectReaderKeepsContract(**reader);
}

}  // namespace
}  // namespace surfeit
