#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include "cloud/scans/las_reader.h"
#include "io/compressed_files.h"
#include "io/las_test_file.h"
#include "io/row_damage_test.h"
#include "storage/byte_output.h"

namespace surfeit {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

class LasTest : public RowFileTest {
 protected:
  std::unique_ptr<RowReader> openGood(const std::string& text, RowReaderOptions options = {}) {
    write("a.las", text);
    return openOk(openLas, path("a.las"), options);
  }
  std::string refusalOf(const std::string& text) { return refusal(openLas, text); }

  // The properties of rows of a point format.
  static std::string rowOf(unsigned format, std::size_t extra = 0) {
    std::string text = "double x, double y, double z, ushort intensity, uchar classification";
    if (kLasColorAt[format] != 0) text += ", ushort red, ushort green, ushort blue";
    text +=
        ", uchar return_number, uchar number_of_returns, uchar scan_direction_flag, uchar "
        "edge_of_flight_line, uchar synthetic, uchar key_point, uchar withheld, ";
    text +=
        format <= 5 ? "char scan_angle" : "uchar overlap, uchar scanner_channel, float scan_angle";
    text += ", uchar user_data, ushort point_source_id";
    if (format != 0 && format != 2) text += ", double gps_time";
    if (format == 8 || format == 10) text += ", ushort nir";
    if (format == 4 || format == 5 || format >= 9) {
      text +=
          ", uchar wavepacket_index, double wavepacket_offset, uint wavepacket_size, float "
          "return_point_wave_location, float x_t, float y_t, float z_t";
    }
    for (std::size_t i = 0; i < extra; ++i) text += ", uchar extra_bytes_" + std::to_string(i);
    return text;
  }
};

TEST_F(LasTest, EveryPointFormatIsRead) {
  for (unsigned format = 0; format <= 10; ++format) {
    for (const std::size_t extra : {0, 5}) {
      const unsigned minor = format <= 5 ? 2 : 4;
      const std::unique_ptr<RowReader> reader = openGood(makeLas(minor, format, 40, extra));
      ASSERT_NE(reader, nullptr) << format;
      EXPECT_EQ(reader->formatName(),
                "LAS 1." + std::to_string(minor) + " point format " + std::to_string(format));
      EXPECT_EQ(describeRow(reader->element()), rowOf(format, extra));
      const std::vector<std::byte> rows = readAllRows(*reader);
      EXPECT_EQ(valueOf(*reader, rows, 39, "x"), 39 * 0.01 + 1e6);
      EXPECT_EQ(valueOf(*reader, rows, 39, "y"), -78 * 0.01 + 2e6);
      EXPECT_EQ(valueOf(*reader, rows, 39, "z"), 3 * 0.01 + 3e6);
      EXPECT_EQ(valueOf(*reader, rows, 39, "intensity"), 39);
      EXPECT_EQ(valueOf(*reader, rows, 39, "classification"), 7);
      if (kLasColorAt[format]) {
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
  std::string text = makeLas(5, 6, 3);
  putLas(text, 391, std::uint16_t(2));
  const auto reader = openGood(text);
  EXPECT_EQ(reader->formatName(), "LAS 1.5 point format 6");
  EXPECT_THAT(reader->notes(), ElementsAre(HasSubstr("gps_time counts from the time offset")));
  EXPECT_THAT(refusalOf(makeLas(5, 0, 3)),
              HasSubstr("point format 0, expected 6 to 10 in version"));
  EXPECT_THAT(refusalOf(makeLas(6, 6, 3)), HasSubstr("found version 1.6, expected 1.0 to 1.5"));
}

TEST_F(LasTest, CountOf64BitsGoesFirst) {
  std::string text = makeLas(4, 3, 5);
  putLas(text, 107, std::uint32_t(2));
  EXPECT_EQ(openGood(text)->element().count, 5u);
  putLas(text, 247, std::uint64_t(0));
  EXPECT_EQ(openGood(text)->element().count, 5u);  // as many as there are, whatever is counted
  putLas(text, 247, std::uint64_t(1) << 40);
  EXPECT_THAT(refusalOf(text), HasSubstr("hold 5 records of 34 bytes, expected 1099511627776"));
  putLas(text, 247, ~std::uint64_t(0));
  EXPECT_THAT(refusalOf(text), HasSubstr("expected 18446744073709551615"));
}

TEST_F(LasTest, CompressedPointsAreRefusedWithAdvice) {
  for (const int bit : {0x80, 0x40, 0xC0}) {
    std::string text = makeLas(2, 3, 5);
    putLas(text, 104, char(3 | bit));
    EXPECT_TRUE(recognisesLas(text));
    EXPECT_THAT(refusalOf(text), AllOf(HasSubstr("found LAZ"), HasSubstr("`pdal translate")));
  }
}

TEST_F(LasTest, EveryTruncationIsFound) {
  for (const unsigned minor : {2u, 4u}) {
    const std::string whole = makeLas(minor, 3, 3);
    EXPECT_EQ(readAllRows(*openGood(whole)).size() % 3, 0u);
    expectEveryTruncationFails(openLas, whole, whole.size());
    expectDamageIsHarmless(openLas, whole, 3);
  }
}

TEST_F(LasTest, DamagedHeadersAreRefused) {
  const auto patched = [](std::size_t at, auto value) {
    std::string text = makeLas(2, 3, 3);
    putLas(text, at, value);
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
            "ushort albedo_b, uchar return_number, uchar number_of_returns, uchar "
            "scan_direction_flag, uchar edge_of_flight_line, uchar synthetic, uchar key_point, "
            "uchar withheld, char scan_angle, uchar user_data, ushort point_source_id");
}

TEST_F(LasTest, EveryFieldOfAPointIsRead) {
  std::string old = makeLas(2, 3, 2);
  const std::size_t at = getLas<std::uint32_t>(old, 96) + 34;
  putLas(old, at + 14, char(3 | 5 << 3 | 1 << 6));
  putLas(old, at + 15, char(9 | 1 << 5 | 1 << 7));
  putLas(old, at + 16, char(-17));
  putLas(old, at + 17, char(99));
  putLas(old, at + 18, std::uint16_t(60001));
  putLas(old, at + 20, 123.25);
  {
    const auto reader = openGood(old);
    const std::vector<std::byte> rows = readAllRows(*reader);
    for (const auto& [name, value] :
         std::vector<std::pair<std::string, double>>{{"return_number", 3},
                                                     {"number_of_returns", 5},
                                                     {"scan_direction_flag", 1},
                                                     {"edge_of_flight_line", 0},
                                                     {"classification", 9},
                                                     {"synthetic", 1},
                                                     {"key_point", 0},
                                                     {"withheld", 1},
                                                     {"scan_angle", -17},
                                                     {"user_data", 99},
                                                     {"point_source_id", 60001},
                                                     {"gps_time", 123.25}}) {
      EXPECT_EQ(valueOf(*reader, rows, 1, name), value) << name;
    }
  }
  std::string modern = makeLas(4, 10, 2);
  const std::size_t to = getLas<std::uint32_t>(modern, 96) + 67;
  putLas(modern, to + 14, char(11 | 13 << 4));
  putLas(modern, to + 15, char(2 | 8 | 3 << 4 | 1 << 7));
  putLas(modern, to + 16, char(203));
  putLas(modern, to + 17, char(8));
  putLas(modern, to + 18, std::int16_t(-2500));
  putLas(modern, to + 20, std::uint16_t(7));
  putLas(modern, to + 22, -0.5);
  putLas(modern, to + 36, std::uint16_t(4321));
  putLas(modern, to + 38, char(200));
  putLas(modern, to + 39, std::uint64_t(1) << 40);
  putLas(modern, to + 47, std::uint32_t(3000000000));
  for (int i = 0; i < 4; ++i) putLas(modern, to + 51 + 4 * std::size_t(i), float(i) + 0.5f);
  const auto reader = openGood(modern);
  const std::vector<std::byte> rows = readAllRows(*reader);
  for (const auto& [name, value] :
       std::vector<std::pair<std::string, double>>{{"return_number", 11},
                                                   {"number_of_returns", 13},
                                                   {"scan_direction_flag", 0},
                                                   {"edge_of_flight_line", 1},
                                                   {"classification", 203},
                                                   {"synthetic", 0},
                                                   {"key_point", 1},
                                                   {"withheld", 0},
                                                   {"overlap", 1},
                                                   {"scanner_channel", 3},
                                                   {"scan_angle", -15},
                                                   {"user_data", 8},
                                                   {"point_source_id", 7},
                                                   {"gps_time", -0.5},
                                                   {"nir", 4321},
                                                   {"wavepacket_index", 200},
                                                   {"wavepacket_offset", 1099511627776.0},
                                                   {"wavepacket_size", 3e9},
                                                   {"return_point_wave_location", 0.5},
                                                   {"x_t", 1.5},
                                                   {"y_t", 2.5},
                                                   {"z_t", 3.5}}) {
    EXPECT_EQ(valueOf(*reader, rows, 1, name), value) << name;
  }
}

// --- How many points there are

TEST_F(LasTest, CountsThatAreTooSmallAreCorrectedAndTold) {
  for (const unsigned format : {0u, 3u, 7u}) {
    for (const std::uint32_t counted : {0u, 1u, 39u}) {
      std::string text = makeLas(format < 6 ? 2 : 4, format, 40);
      putLas(text, 107, counted);
      if (format >= 6) putLas(text, 247, std::uint64_t(counted));
      const auto reader = openGood(text);
      EXPECT_EQ(reader->element().count, 40u);
      EXPECT_THAT(reader->notes(), ElementsAre("the header counts " + std::to_string(counted) +
                                               " points, the file has 40: all are read"));
      EXPECT_EQ(valueOf(*reader, readAllRows(*reader), 39, "x"), 39 * 0.01 + 1e6);
      write("a.las.gz", gzipped(text));
      EXPECT_EQ(openOk(openLas, path("a.las.gz"))->element().count, 40u);
    }
  }
}

TEST_F(LasTest, WhatStandsBehindThePointsIsNoPoint) {
  std::string text = makeLas(4, 6, 40);
  putLas(text, 235, std::uint64_t(text.size()));
  putLas(text, 243, std::uint32_t(1));
  const std::string record = lasRecord("somebody", 5, std::string(300, 'x'), true);
  EXPECT_EQ(openGood(text + record)->element().count, 40u);
  putLas(text, 247, std::uint64_t(30));
  EXPECT_EQ(openGood(text + record)->element().count, 40u);
  // Room that was made in advance
  for (const std::size_t zeros : {1u, 26u, 27u, 4000u}) {
    const auto reader = openGood(makeLas(2, 2, 40) + std::string(zeros, '\0'));
    EXPECT_EQ(reader->element().count, 40u);
    EXPECT_THAT(reader->notes(), ElementsAre(HasSubstr(std::to_string(zeros) + " bytes behind")));
  }
  // What lies elsewhere, and fills no points
  std::string bounded = makeLas(2, 2, 40);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    putLas(bounded, 179 + 16 * axis, 1e6 * double(axis + 1) + 1);
    putLas(bounded, 187 + 16 * axis, 1e6 * double(axis + 1) - 1);
  }
  EXPECT_EQ(openGood(bounded + std::string(1000, 'x'))->element().count, 40u);
}

TEST_F(LasTest, CountsThatAreTooLargeSayWhatToDo) {
  std::string text = makeLas(2, 0, 5);
  putLas(text, 107, std::uint32_t(6));
  EXPECT_THAT(refusalOf(text), AllOf(HasSubstr("hold 5 records of 20 bytes, expected 6"),
                                     HasSubstr("copy or export it again")));
}

// --- What is left out

TEST_F(LasTest, WithheldPointsAndNoiseAreLeftOut) {
  std::string text = makeLas(2, 2, 100);  // classes 0 to 31, again and again
  const std::size_t at = getLas<std::uint32_t>(text, 96);
  for (const std::size_t i : {0, 7, 50}) text[at + 26 * i + 15] |= char(0x80);
  write("a.las", text);
  const auto openWith = [&](const std::string& filter, const std::string& renames = "") {
    RowReaderOptions options;
    options.filter = filter;
    options.channels = *parseChannelRenames(renames);
    return openOk(openRowReader, path("a.las"), options);
  };
  const auto reader = openWith("");
  // Two of class 7 and two of 18 besides those that are withheld
  EXPECT_EQ(reader->element().count, 100u - 3 - 2 - 2);
  EXPECT_THAT(reader->notes(),
              ElementsAre("7 of 100 points are left out: 3 withheld, 4 of noise (classes 7 and "
                          "18); --filter true keeps them"));
  expectReaderKeepsContract(*reader);
  EXPECT_EQ(openWith("true")->element().count, 100u);
  EXPECT_EQ(openWith("class == 7")->element().count, 3u);
  EXPECT_EQ(openWith("not withheld")->element().count, 97u);
  // Also where these channels are called otherwise, or dropped
  EXPECT_EQ(openWith("", "classification=group,withheld=-")->element().count, 93u);
  EXPECT_EQ(openWith("", "classification=-,withheld=-,user_data=withheld")->element().count, 93u);
  EXPECT_EQ(openWith("group != 7", "classification=group")->element().count, 97u);
}

TEST_F(LasTest, NoiseOfModernFormatsIsLeftOut) {
  std::string text = makeLas(4, 7, 64);
  const std::size_t at = getLas<std::uint32_t>(text, 96);
  text[at + 36 * 3 + 15] = 4;
  text[at + 36 * 4 + 16] = char(18 + 128);  // class 146 is a user's
  write("a.las", text);
  EXPECT_EQ(openOk(openRowReader, path("a.las"))->element().count, 64u - 1 - 2 - 2);
}

// --- Extra bytes

TEST_F(LasTest, ExtraBytesAreChannels) {
  std::string text = makeLas(4, 6, 3, 2 + 4 + 8 + 1 + 6 + 8 + 4);
  const std::string records = lasDescriptor("Amplitude", 3, 8 | 16, 0.01, 5) +
                              lasDescriptor("Height", 9) + lasDescriptor("stamp", 7) +
                              lasDescriptor("intensity", 1) + lasDescriptor("rgb16", 23) +
                              lasDescriptor("NormalX", 10) + lasDescriptor("", 0, 4);
  text = withRecords(text, {lasRecord("LASF_Spec", 4, records)});
  const std::size_t at = getLas<std::uint32_t>(text, 96) + 63 + 30;
  putLas(text, at, std::uint16_t(1234));
  putLas(text, at + 2, 2.5f);
  putLas(text, at + 6, std::uint64_t(1) << 52);
  putLas(text, at + 14, char(77));
  for (std::size_t i = 0; i < 3; ++i) putLas(text, at + 15 + 2 * i, std::uint16_t(100 + i));
  putLas(text, at + 21, -0.5);
  putLas(text, at + 29, char(9));
  const auto reader = openGood(text);
  EXPECT_EQ(describeRow(reader->element()),
            rowOf(6) +
                ", double Amplitude, float Height, double stamp, uchar intensity_2, ushort "
                "rgb16_x, ushort rgb16_y, ushort rgb16_z, double nx, uchar extra_bytes_0, "
                "uchar extra_bytes_1, uchar extra_bytes_2, uchar extra_bytes_3");
  const std::vector<std::byte> rows = readAllRows(*reader);
  for (const auto& [name, value] :
       std::vector<std::pair<std::string, double>>{{"Amplitude", 1234 * 0.01 + 5},
                                                   {"Height", 2.5},
                                                   {"stamp", 4503599627370496.0},
                                                   {"intensity_2", 77},
                                                   {"rgb16_z", 102},
                                                   {"nx", -0.5},
                                                   {"extra_bytes_0", 9}}) {
    EXPECT_EQ(valueOf(*reader, rows, 1, name), value) << name;
  }
  EXPECT_THAT(reader->notes(), ElementsAre(HasSubstr("integers of 64 bits become float64"),
                                           HasSubstr("'intensity' are called intensity_2")));
  RowReaderOptions options;
  options.channels = *parseChannelRenames("NormalX=slope,Amplitude=-,rgb16=albedo");
  EXPECT_THAT(describeRow(openOk(openLas, path("a.las"), options)->element()),
              AllOf(HasSubstr("ushort albedo_b, double slope"), Not(HasSubstr("Amplitude"))));
}

TEST_F(LasTest, ExtraBytesThatDoNotFitAreTold) {
  const auto notesOf = [&](const std::string& descriptors, std::size_t extra) {
    return openGood(withRecords(makeLas(4, 6, 3, extra), {lasRecord("LASF_Spec", 4, descriptors)}))
        ->notes();
  };
  EXPECT_THAT(notesOf(lasDescriptor("a", 10), 4), ElementsAre(HasSubstr("points are too short")));
  EXPECT_THAT(notesOf(lasDescriptor("a", 77), 4), ElementsAre(HasSubstr("of an unknown type")));
  EXPECT_THAT(notesOf(lasDescriptor("a", 3, 8, 0), 2), ElementsAre(HasSubstr("scale 0")));
  EXPECT_THAT(notesOf("", 100), ElementsAre(HasSubstr("100 bytes of every point without a")));
  EXPECT_THAT(notesOf(lasDescriptor("a", 1).substr(0, 100), 1), IsEmpty());
}

TEST_F(LasTest, BytesWithoutADescriptionAreNoVectors) {
  const auto rowWith = [&](std::size_t extra, const std::string& descriptors) {
    const std::string text = makeLas(4, 6, 3, extra);
    return describeRow(openGood(descriptors.empty()
                                    ? text
                                    : withRecords(text, {lasRecord("LASF_Spec", 4, descriptors)}))
                           ->element());
  };
  EXPECT_EQ(rowWith(3, ""), rowOf(6) +
                                ", uchar extra_bytes_0, uchar extra_bytes_1, uchar "
                                "extra_bytes_2");
  EXPECT_EQ(rowWith(1, ""), rowOf(6) + ", uchar extra_bytes_0");
  EXPECT_EQ(rowWith(3, lasDescriptor("raw", 0, 3)),
            rowOf(6) + ", uchar raw_0, uchar raw_1, uchar raw_2");
  RowReaderOptions options;
  options.channels = *parseChannelRenames("extra_bytes=mine");
  write("a.las", makeLas(4, 6, 3, 3));
  EXPECT_THAT(describeRow(openOk(openLas, path("a.las"), options)->element()),
              HasSubstr("uchar mine_0, uchar mine_1, uchar mine_2"));
  options.channels = *parseChannelRenames("extra_bytes=-");
  EXPECT_EQ(describeRow(openOk(openLas, path("a.las"), options)->element()), rowOf(6));
}

TEST_F(LasTest, SeveralRecordsDescribeExtraBytes) {
  const std::string a = lasRecord("LASF_Spec", 4, lasDescriptor("a", 9)),
                    b = lasRecord("LASF_Spec", 4, lasDescriptor("b", 10));
  const auto both = openGood(withRecords(makeLas(4, 6, 3, 12), {a, b}));
  EXPECT_EQ(describeRow(both->element()), rowOf(6) + ", float a, double b");
  // The same one again describes nothing more
  const auto twice = openGood(withRecords(makeLas(4, 6, 3, 4), {a, a}));
  EXPECT_EQ(describeRow(twice->element()), rowOf(6) + ", float a");
  EXPECT_THAT(twice->notes(), IsEmpty());
}

// --- Coordinates

TEST_F(LasTest, CoordinateReferenceSystemsAreTold) {
  const auto crsOf = [&](const std::vector<std::string>& records) {
    std::vector<std::string> comments =
        openGood(withRecords(makeLas(4, 6, 3), records))->comments();
    EXPECT_EQ(comments.front(), "up z");
    comments.erase(comments.begin());
    return comments;
  };
  EXPECT_THAT(crsOf({lasRecord("LASF_Projection", 2112, std::string("PROJCS[\"a\",\n  B]\0", 18))}),
              ElementsAre("crs PROJCS[\"a\", B]"));
  const auto keys = [](const std::vector<std::uint16_t>& words) {
    return std::string(reinterpret_cast<const char*>(words.data()), 2 * words.size());
  };
  EXPECT_THAT(crsOf({lasRecord("LASF_Projection", 34735,
                               keys({1, 1, 0, 2, 1024, 0, 1, 1, 3072, 0, 1, 32610}))}),
              ElementsAre("crs EPSG:32610"));
  EXPECT_THAT(
      crsOf({lasRecord("LASF_Projection", 34735,
                       keys({1, 1, 0, 3, 2048, 0, 1, 4326, 4096, 0, 1, 5703, 1026, 34737, 8, 0})),
             lasRecord("LASF_Projection", 34737, "WGS  84|")}),
      ElementsAre("crs geographic EPSG:4326+5703 WGS 84"));
  EXPECT_THAT(crsOf({lasRecord("LASF_Projection", 34735, keys({1, 1, 0, 9, 3072, 0, 1, 32767}))}),
              ElementsAre("crs by GeoTIFF keys without a code"));
  EXPECT_THAT(crsOf({lasRecord("LASF_Projection", 34735, "x")}), IsEmpty());

  // The model says what a code is of: projected, geographic, geocentric
  const auto crsOfKeys = [&](std::vector<std::uint16_t> words) {
    words.insert(words.begin(), {1, 1, 0, std::uint16_t(words.size() / 4)});
    const std::vector<std::string> found =
        crsOf({lasRecord("LASF_Projection", 34735, keys(words))});
    return found.size() == 1 ? found[0] : "";
  };
  EXPECT_EQ(crsOfKeys({1024, 0, 1, 2, 2048, 0, 1, 4269}), "crs geographic EPSG:4269");
  EXPECT_EQ(crsOfKeys({1024, 0, 1, 3, 2048, 0, 1, 4978}), "crs geocentric EPSG:4978");
  EXPECT_EQ(crsOfKeys({2048, 0, 1, 4978}), "crs geocentric EPSG:4978");
  EXPECT_EQ(crsOfKeys({1024, 0, 1, 2, 2048, 0, 1, 32767}),
            "crs geographic by GeoTIFF keys without a code");
  EXPECT_EQ(crsOfKeys({1024, 0, 1, 1, 2048, 0, 1, 4269, 3072, 0, 1, 32767}),
            "crs by GeoTIFF keys without a code");
  EXPECT_EQ(crsOfKeys({2048, 0, 1, 4269, 3072, 0, 1, 2992}), "crs EPSG:2992");
  EXPECT_EQ(crsOfKeys({1024, 0, 1, 1, 3072, 0, 1, 26910, 4099, 0, 1, 9003}),
            "crs EPSG:26910 vertical unit 9003");
}

TEST_F(LasTest, RecordsOfVariableLengthMayBeDamaged) {
  std::string text = withRecords(makeLas(4, 6, 3), {lasRecord("LASF_Spec", 0, "classes")});
  EXPECT_THAT(openGood(text)->notes(), ElementsAre(HasSubstr("kept only by .las: 'LASF_Spec' 0")));
  for (const std::uint16_t length : {8, 60000}) {
    putLas(text, 375 + 20, length);
    EXPECT_THAT(openGood(text)->notes(), ElementsAre(HasSubstr("end early: 0 of 1 are read")));
  }
  putLas(text, 375 + 20, std::uint16_t(7));
  putLas(text, 100, ~std::uint32_t(0));
  EXPECT_THAT(openGood(text)->notes(), Contains(HasSubstr("1 of 4294967295 are read")));
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
