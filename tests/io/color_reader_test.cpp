#include "cloud/edits/color_reader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <string>
#include <tuple>
#include <vector>

#include "cloud/cloud_formats.h"
#include "io/row_damage_test.h"
#include "surfels/open_surfel_source.h"

namespace surfeit {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

// Clouds as text of PLY: properties of one type, a row each.
class ColorReaderTest : public RowFileTest {
 protected:
  std::string ply(const std::string& type, const std::string& names, const std::string& rows) {
    std::string text = "ply\nformat ascii 1.0\nelement vertex " +
                       std::to_string(std::count(rows.begin(), rows.end(), '\n')) +
                       "\nproperty float x\nproperty float y\nproperty float z\n";
    std::size_t at = 0;
    while (at < names.size()) {
      const std::size_t end = std::min(names.find(' ', at), names.size());
      text += "property " + type + " " + names.substr(at, end - at) + "\n";
      at = end + 1;
    }
    text += "end_header\n";
    for (at = 0; at < rows.size();) {
      const std::size_t end = rows.find('\n', at) + 1;
      text += "1 2 3 " + rows.substr(at, end - at);
      at = end;
    }
    write("a.ply", text);
    return path("a.ply");
  }

  std::unique_ptr<RowReader> open(const std::string& file, ColorRange range = ColorRange::kAuto,
                                  const std::string& channels = "") {
    RowReaderOptions options;
    options.color_range = range;
    options.channels = *parseChannelRenames(channels);
    return openOk(openRowReader, file, options);
  }

  // Type and values of a property, and the notes.
  struct Found {
    std::string type;
    std::vector<double> values;
    std::vector<std::string> notes;
  };
  Found find(const std::string& file, const char* name = "red",
             ColorRange range = ColorRange::kAuto, const std::string& channels = "") {
    const auto reader = open(file, range, channels);
    if (reader == nullptr || reader->element().find(name) == nullptr) return {"none", {}, {}};
    const std::vector<std::byte> rows = readAllRows(*reader);
    Found found{
        std::string(valueTypeName(reader->element().find(name)->type)), {}, reader->notes()};
    for (std::size_t i = 0; i < reader->element().count; ++i) {
      found.values.push_back(valueOf(*reader, rows, i, name));
    }
    return found;
  }
  Found findColor(const std::string& type, const std::string& rows, ColorRange range) {
    return find(ply(type, "red green blue", rows), "red", range);
  }
  std::string refusalOf(const std::string& file, ColorRange range = ColorRange::kAuto) {
    RowReaderOptions options;
    options.color_range = range;
    const Status status = readStatus(openRowReader, file, options);
    EXPECT_EQ(status.code(), StatusCode::kCorruption);
    return status.message();
  }
};

TEST_F(ColorReaderTest, SixteenBitsThatNeverExceed255AreEight) {
  const Found found = findColor("ushort", "0 0 0\n117 73 255\n", ColorRange::kAuto);
  EXPECT_EQ(found.type, "uchar");
  EXPECT_THAT(found.values, ElementsAre(0, 117));
  EXPECT_THAT(found.notes,
              ElementsAre("colors are 0-255 in ushort (the largest is 255): read as sRGB "
                          "of 8 bits; --color-range 16 reads them as 16 bits"));
}

TEST_F(ColorReaderTest, OneLargeValueMakesThemSixteen) {
  const Found found = findColor("ushort", "0 0 0\n117 73 4096\n", ColorRange::kAuto);
  EXPECT_EQ(found.type, "ushort");
  EXPECT_THAT(found.values, ElementsAre(0, 117));
  EXPECT_THAT(found.notes, IsEmpty());
}

TEST_F(ColorReaderTest, CodesThatNeedTenOrTwelveBitsHaveThese) {
  for (const char* type : {"ushort", "short", "int", "uint"}) {
    for (const auto& [rows, bits, second] :
         {std::tuple{"0 0 0\n1023 73 512\n", 10, 65535}, std::tuple{"0 0 0\n512 1 2\n", 10, 32800},
          std::tuple{"0 0 0\n4095 73 49\n", 12, 65535},
          std::tuple{"0 0 0\n2048 1 2\n", 12, 32776}}) {
      const Found found = findColor(type, rows, ColorRange::kAuto);
      EXPECT_EQ(found.type, "ushort") << type << rows;
      EXPECT_THAT(found.values, ElementsAre(0, second)) << type << rows;
      ASSERT_EQ(found.notes.size(), 1u) << type << rows;
      EXPECT_THAT(found.notes[0], HasSubstr("read as sRGB of " + std::to_string(bits) +
                                            " bits; --color-range 16 reads them as 16 bits"));
      EXPECT_EQ(findColor(type, rows, ColorRange::k16).values[1], std::stoi(rows + 6)) << type;
    }
  }
}

TEST_F(ColorReaderTest, SmallWholeRealsAreLight) {
  const Found found = findColor("float", "0 0 0\n2 1 15\n", ColorRange::kAuto);
  EXPECT_EQ(found.type, "float");
  EXPECT_THAT(found.values, ElementsAre(0, 2));
  ASSERT_EQ(found.notes.size(), 1u);
  EXPECT_THAT(found.notes[0], HasSubstr("--color-range 8 reads them as sRGB of 8 bits"));
}

TEST_F(ColorReaderTest, OpacitiesOfWiderIntegersAreNotAllButNothing) {
  const auto opacity = [&](const char* type, const char* rows) {
    return find(ply(type, "opacity", rows), "opacity");
  };
  for (const char* type : {"ushort", "int", "uint", "float"}) {
    const Found bytes = opacity(type, "0\n128\n255\n");
    EXPECT_EQ(bytes.type, "uchar") << type;
    EXPECT_THAT(bytes.values, ElementsAre(0, 128, 255)) << type;
    ASSERT_EQ(bytes.notes.size(), 1u) << type;
    EXPECT_THAT(bytes.notes[0], HasSubstr("255 is opaque"));
  }
  for (const char* type : {"uchar", "ushort", "int"}) {
    const Found flags = opacity(type, "0\n1\n");
    EXPECT_EQ(flags.type, "uchar") << type;
    EXPECT_THAT(flags.values, ElementsAre(0, 255)) << type;
    ASSERT_EQ(flags.notes.size(), 1u) << type;
  }
  // As they are
  EXPECT_THAT(opacity("uchar", "3\n128\n").notes, IsEmpty());
  EXPECT_THAT(opacity("ushort", "3\n30000\n").notes, IsEmpty());
  EXPECT_THAT(opacity("float", "0\n.5\n1\n").notes, IsEmpty());
  EXPECT_THAT(opacity("float", "0\n1\n").values, ElementsAre(0, 1));
}

TEST_F(ColorReaderTest, AlphaOf16BitsMakesThemSixteen) {
  const std::string rows = "0 0 0 65535\n3000 73 49 65535\n";
  EXPECT_THAT(find(ply("ushort", "red green blue alpha", rows)).values, ElementsAre(0, 3000));
  const std::string camera = "0 0 0 4095\n3000 73 49 4095\n";
  EXPECT_THAT(find(ply("ushort", "red green blue alpha", camera)).values, ElementsAre(0, 48011));
}

TEST_F(ColorReaderTest, ColorsThatWouldBeBlackAreTold) {
  for (const char* rows : {"0 0 0\n256 73 49\n", "0 0 0\n1024 73 49\n"}) {
    const Found found = findColor("ushort", rows, ColorRange::kAuto);
    EXPECT_EQ(found.type, "ushort");
    ASSERT_EQ(found.notes.size(), 1u) << rows;
    EXPECT_THAT(found.notes[0], HasSubstr("--color-range 10 or 12 reads them as so many bits"));
  }
}

TEST_F(ColorReaderTest, TenAndTwelveBitsMayBeAskedFor) {
  EXPECT_THAT(findColor("ushort", "0 0 0\n1023 0 0\n2000 0 0\n", ColorRange::k10).values,
              ElementsAre(0, 65535, 65535));
  EXPECT_THAT(findColor("int", "0 0 0\n4095 0 0\n", ColorRange::k12).values, ElementsAre(0, 65535));
  const Found reals = findColor("float", "0 0 0\n1023 0 0\n", ColorRange::k10);
  EXPECT_EQ(reals.type, "float");
  EXPECT_THAT(reals.values, ElementsAre(0, 1));
}

TEST_F(ColorReaderTest, BlackDecidesNothing) {
  EXPECT_EQ(findColor("ushort", "0 0 0\n0 0 0\n", ColorRange::kAuto).type, "ushort");
  EXPECT_THAT(findColor("float", "0 0 0\n", ColorRange::kAuto).notes, IsEmpty());
  EXPECT_THAT(findColor("int", "0 0 0\n", ColorRange::kAuto).notes, IsEmpty());
}

TEST_F(ColorReaderTest, WholeRealsAbove1AreCodes) {
  for (const char* type : {"float", "double"}) {
    const Found found = findColor(type, "0 0 0\n117.0 73 255\n", ColorRange::kAuto);
    EXPECT_EQ(found.type, "uchar") << type;
    EXPECT_THAT(found.values, ElementsAre(0, 117));
    ASSERT_EQ(found.notes.size(), 1u);
    EXPECT_THAT(found.notes[0], HasSubstr("--color-range unit reads them as linear"));
  }
}

TEST_F(ColorReaderTest, OtherRealsAreLinear) {
  for (const char* rows : {"0 0 1\n1 1 0\n", "0.5 0.25 1\n", "3.7 800.5 2\n", "0.1 12 2\n"}) {
    const Found found = findColor("float", rows, ColorRange::kAuto);
    EXPECT_EQ(found.type, "float") << rows;
    EXPECT_THAT(found.notes, IsEmpty()) << rows;
  }
  // A guess that could be wrong is told
  const Found codes = findColor("float", "117.5 73.25 49\n", ColorRange::kAuto);
  EXPECT_EQ(codes.type, "float");
  ASSERT_EQ(codes.notes.size(), 1u);
  EXPECT_THAT(codes.notes[0], HasSubstr("--color-range 8"));
  const Found whole = findColor("float", "65280 0 800\n", ColorRange::kAuto);
  EXPECT_EQ(whole.type, "float");
  ASSERT_EQ(whole.notes.size(), 1u);
  EXPECT_THAT(whole.notes[0], HasSubstr("--color-range 16"));
}

TEST_F(ColorReaderTest, OtherIntegersAreCodes) {
  EXPECT_EQ(findColor("int", "0 117 255\n", ColorRange::kAuto).type, "uchar");
  EXPECT_EQ(findColor("uint", "0 117 256\n", ColorRange::kAuto).type, "ushort");
  EXPECT_EQ(findColor("short", "117 0 255\n", ColorRange::kAuto).type, "uchar");
  const Found bytes = findColor("char", "-1 117 0\n", ColorRange::kAuto);
  EXPECT_EQ(bytes.type, "uchar");
  EXPECT_THAT(bytes.values, ElementsAre(255));
  EXPECT_THAT(bytes.notes, ElementsAre(HasSubstr("without a sign")));
  const Found words = findColor("short", "-1 117 0\n", ColorRange::kAuto);
  EXPECT_EQ(words.type, "ushort");
  EXPECT_THAT(words.values, ElementsAre(65535));
}

TEST_F(ColorReaderTest, IntegersOfNoRangeAreRefused) {
  EXPECT_THAT(refusalOf(ply("int", "red green blue", "1 2 70000\n")),
              HasSubstr("found 1 to 70000 in property red of type int, expected colors of"));
  EXPECT_THAT(refusalOf(ply("int", "red green blue", "-1 2 3\n")), HasSubstr("found -1 to 3"));
}

TEST_F(ColorReaderTest, TheUserDecides) {
  EXPECT_EQ(findColor("ushort", "117 0 0\n", ColorRange::k16).type, "ushort");
  EXPECT_THAT(findColor("ushort", "300 0 0\n", ColorRange::k8).values, ElementsAre(255));
  EXPECT_THAT(findColor("float", "117 0 255\n", ColorRange::kUnit).values, ElementsAre(117));
  const double linear = std::pow((117.5 / 255 + 0.055) / 1.055, 2.4);
  const Found found = findColor("float", "117.5 0 0\n", ColorRange::k8);
  EXPECT_EQ(found.type, "float");
  EXPECT_NEAR(found.values.at(0), linear, 1e-6);
  EXPECT_NEAR(findColor("double", "65535 0 0\n", ColorRange::k16).values.at(0), 1, 1e-12);
  EXPECT_THAT(findColor("uchar", "117 0 0\n", ColorRange::k16).values, ElementsAre(117));
}

TEST_F(ColorReaderTest, RadiosityInRealsIsLight) {
  const std::string file = ply("float", "radiosity_r radiosity_g radiosity_b", "0 12 255\n");
  EXPECT_EQ(find(file, "radiosity_r").type, "float");
  const std::string words = ply("ushort", "albedo_r albedo_g albedo_b", "0 12 255\n");
  EXPECT_EQ(find(words, "albedo_r").type, "uchar");
}

TEST_F(ColorReaderTest, ColorsOfNoNumberStayInvalid) {
  const Found found = findColor("float", "nan 0 0\n117 0 255\n", ColorRange::kAuto);
  EXPECT_TRUE(std::isnan(found.values.at(0)));
  EXPECT_NEAR(found.values.at(1), std::pow((117.0 / 255 + 0.055) / 1.055, 2.4), 1e-6);
}

TEST_F(ColorReaderTest, ColorsAreUnpacked) {
  for (const char* type : {"uint", "int", "double"}) {
    const std::string file = ply(type, "rgb", "4568635\n0\n");
    EXPECT_THAT(find(file, "red").values, ElementsAre(69, 0)) << type;
    EXPECT_THAT(find(file, "blue").values, ElementsAre(59, 0)) << type;
  }
  EXPECT_THAT(find(ply("uint", "RGBA", "4278255873\n"), "alpha").values, ElementsAre(255));
  EXPECT_THAT(find(ply("float", "rgb", "4568635\n"), "green").values, ElementsAre(182));
  // The same as the bits of a float
  EXPECT_THAT(find(ply("float", "rgb", "0\n6.402021e-39\n"), "green").values, ElementsAre(0, 182));
  EXPECT_THAT(
      find(ply("uint", "rgb", "4568635\n"), "albedo_g", ColorRange::kAuto, "color=albedo").values,
      ElementsAre(182));
}

TEST_F(ColorReaderTest, NamesOfOthersAreColors) {
  for (const char* names :
       {"r g b", "R G B", "Red Green Blue", "diffuse_red diffuse_green diffuse_blue",
        "scalar_red scalar_green scalar_blue", "scalar_R scalar_G scalar_B", "Rf Gf Bf",
        "color_r color_g color_b", "colour_red colour_green colour_blue"}) {
    EXPECT_THAT(find(ply("float", names, "117 73 49\n"), "green").values, ElementsAre(73)) << names;
  }
  // Our names win, and the others keep theirs
  const std::string both = ply("uchar", "r g b red green blue", "1 2 3 4 5 6\n");
  EXPECT_THAT(find(both, "red").values, ElementsAre(4));
  EXPECT_THAT(find(both, "r").values, ElementsAre(1));
  // A part of a color is none
  EXPECT_THAT(find(ply("uchar", "r g", "1 2\n"), "r").values, ElementsAre(1));
  // The user's names go first
  const std::string file = ply("uchar", "r g b", "1 2 3\n");
  EXPECT_THAT(find(file, "albedo_g", ColorRange::kAuto, "color=albedo").values, ElementsAre(2));
  EXPECT_THAT(find(file, "weight", ColorRange::kAuto, "g=weight").values, ElementsAre(2));
}

TEST_F(ColorReaderTest, LookalikesAreTold) {
  const auto notes = [&](const std::string& names, const std::string& values) {
    const auto source = openSurfelSource(ply("float", names, values + "\n"), false);
    EXPECT_TRUE(source.ok());
    return source.ok() ? (*source)->notes() : std::vector<std::string>();
  };
  EXPECT_THAT(notes("foo_r foo_g foo_b nx ny nz", "0 1 0 0 0 1"),
              ElementsAre("properties foo_r foo_g foo_b look like a color and are not read: "
                          "--channels foo=color"));
  EXPECT_THAT(
      notes("ambient_red ambient_green ambient_blue nx ny nz", "0 1 0 0 0 1"),
      ElementsAre(HasSubstr("--channels ambient_red=red,ambient_green=green,ambient_blue=blue")));
  EXPECT_THAT(
      notes("red green blue vertex_normal_x vertex_normal_y vertex_normal_z", "0 1 0 0 0 1"),
      ElementsAre(HasSubstr("--channels vertex_normal=normal")));
  EXPECT_THAT(notes("Gray nx ny nz", "1 0 0 1"),
              ElementsAre(HasSubstr("--set 'radiosity = Gray'")));
  EXPECT_THAT(notes("scalar_luminance nx ny nz", "1 0 0 1"),
              ElementsAre(HasSubstr("property scalar_luminance looks like a color")));
  EXPECT_THAT(notes("f_dc_0 f_dc_1 f_dc_2 nx ny nz", "0 1 0 0 0 1"),
              ElementsAre(HasSubstr("look like colors of splats")));
  EXPECT_THAT(notes("red green blue nx ny nz diameter", "0 1 0 0 0 1 2"),
              ElementsAre(HasSubstr("--channels diameter=width")));
  EXPECT_THAT(notes("red green blue nx ny nz diameter radius", "0 1 0 0 0 1 2 1"), IsEmpty());
  EXPECT_THAT(notes("red green blue nx ny nz gray", "0 1 0 0 0 1 2"), IsEmpty());
  // What is there, and what we know, is not told
  EXPECT_THAT(notes("foo_r foo_g foo_b red green blue nx ny nz", "0 1 0 0 0 1 0 0 1"), IsEmpty());
  EXPECT_THAT(notes("irradiance_r irradiance_g irradiance_b nx ny nz", "0 1 0 0 0 1"), IsEmpty());
}

// More rows than a sample has, binary, so that it is taken from many places.
class LongColorTest : public RowFileTest {
 protected:
  static constexpr std::size_t kRows = 300'000;
  // Between places of 64 rows, which begin 293 rows apart
  static constexpr std::size_t kStray = 500 * 293 + 200;

  std::string ply(const std::vector<std::uint16_t>& reds) {
    std::string text =
        "ply\nformat binary_little_endian 1.0\nelement vertex " + std::to_string(reds.size()) +
        "\nproperty float x\nproperty float y\nproperty float z\nproperty ushort red\nproperty "
        "ushort green\nproperty ushort blue\nend_header\n";
    std::vector<std::uint16_t> row(9, 0);
    for (const std::uint16_t red : reds) {
      row[6] = red;
      text.append(reinterpret_cast<const char*>(row.data()), 18);
    }
    write("a.ply", text);
    return path("a.ply");
  }
};

TEST_F(LongColorTest, CloudsMayBeginDark) {
  std::vector<std::uint16_t> reds(kRows, 3);
  std::fill(reds.begin() + kRows * 9 / 10, reds.end(), 40'000);
  const auto reader = openOk(openRowReader, ply(reds));
  ASSERT_NE(reader, nullptr);
  EXPECT_EQ(reader->element().find("red")->type, ValueType::kUint16);
}

TEST_F(LongColorTest, ValuesThatTheSampleDoesNotKnowAreRefused) {
  std::vector<std::uint16_t> reds(kRows, 200);
  reds[kStray] = 300;
  const std::string file = ply(reds);
  const Status status = readStatus(openRowReader, file);
  EXPECT_THAT(status.message(), HasSubstr("record " + std::to_string(kStray) +
                                          ": found 300 as red, expected a whole number up to 255"));
  EXPECT_THAT(status.message(), HasSubstr("--color-range"));
  RowReaderOptions options;
  options.color_range = ColorRange::k8;
  EXPECT_TRUE(readStatus(openRowReader, file, options).ok());
}

TEST_F(LongColorTest, ReadersKeepTheirContract) {
  const auto reader = openOk(openRowReader, ply(std::vector<std::uint16_t>(10'000, 200)));
  ASSERT_NE(reader, nullptr);
  EXPECT_EQ(reader->element().find("red")->type, ValueType::kUint8);
  expectReaderKeepsContract(*reader);
}

}  // namespace
}  // namespace surfeit
