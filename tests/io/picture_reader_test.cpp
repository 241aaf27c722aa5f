#include "cloud/pictures/picture_reader.h"

#include <OpenEXR/ImfStandardAttributes.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <clocale>
#include <string>
#include <vector>

#include "io/exr_test_picture.h"
#include "io/picture_file_test.h"

namespace surfeit {
namespace {

using testing::AllOf;
using testing::HasSubstr;

struct Pixels {
  int width = 0, height = 0;
  std::vector<glm::vec3> values;
};

Result<Pixels> readPicture(const std::string& path) {
  SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<PictureReader> reader, PictureReader::open(path));
  Pixels pixels = {reader->width(), reader->height(), {}};
  std::vector<glm::vec3> row(std::size_t(reader->width()));
  for (int i = 0; i < pixels.height; ++i) {
    SURFEIT_RETURN_IF_ERROR(reader->readRow(row));
    pixels.values.insert(pixels.values.end(), row.begin(), row.end());
  }
  return pixels;
}

class PictureReaderTest : public PictureFileTest {
 protected:
  Pixels read(const std::string& name) const {
    const Result<Pixels> pixels = readPicture(path(name));
    EXPECT_TRUE(pixels.ok()) << pixels.status().message();
    return pixels.ok() ? *pixels : Pixels{};
  }
  Status failure(const std::string& name) const { return readPicture(path(name)).status(); }
};

// Whole numbers, which every type of pixel holds exactly.
float valueAt(int x, int y, int channel) { return float(1 + x + 10 * y + 500 * channel); }

// Channels of a picture of 6 x 4 pixels.
ExrTestPart exrOf(const std::vector<std::string>& channels = {"R", "G", "B"},
                  Imf::PixelType type = Imf::HALF,
                  Imath::Box2i window = Imath::Box2i({0, 0}, {5, 3})) {
  ExrTestPart part;
  part.window = window;
  for (std::size_t c = 0; c < channels.size(); ++c) {
    part.add(
        channels[c], [&](int x, int y) { return valueAt(x, y, int(c)); }, type);
  }
  return part;
}

// With tiles of all levels, of which only the largest is written.
void writeExr(const ExrTestPart& part, const std::string& path) {
  writeExrTest(path, {part}, [](Imf::Header& header) {
    if (header.hasTileDescription()) header.tileDescription().mode = Imf::MIPMAP_LEVELS;
  });
}

void expectValues(const Pixels& pixels, int width, int height, bool is_grey = false) {
  ASSERT_EQ(pixels.width, width);
  ASSERT_EQ(pixels.height, height);
  for (std::size_t i = 0; i < pixels.values.size(); ++i) {
    for (int c = 0; c < 3; ++c) {
      ASSERT_EQ(pixels.values[i][c], valueAt(int(i) % width, int(i) / width, is_grey ? 0 : c)) << i;
    }
  }
}

TEST_F(PictureReaderTest, ReadsEveryKindOfOpenExr) {
  std::vector<ExrTestPart> kinds(8, exrOf());
  kinds[1] = exrOf({"R", "G", "B"}, Imf::FLOAT);
  kinds[2] = exrOf({"R", "G", "B"}, Imf::UINT);
  kinds[3].tile = 2;
  kinds[4].window = {{-7, 11}, {-2, 14}};
  kinds[5].window = {{100, -50}, {105, -47}};
  kinds[5].tile = 4;
  kinds[6].order = Imf::DECREASING_Y;
  kinds[6].compression = Imf::PIZ_COMPRESSION;
  kinds[7] = exrOf({"R", "G", "B", "A", "Z", "diffuse.R"});
  for (std::size_t i = 0; i < kinds.size(); ++i) {
    SCOPED_TRACE(i);
    writeExr(kinds[i], path("a.exr"));
    expectValues(read("a.exr"), 6, 4);
  }
  ExrTestPart large = exrOf({"R", "G", "B"}, Imf::FLOAT, Imath::Box2i({0, 0}, {8, 299}));
  large.compression = Imf::RLE_COMPRESSION;
  writeExr(large, path("a.hdr"));  // contents count, not names
  expectValues(read("a.hdr"), 9, 300);
}

TEST_F(PictureReaderTest, LuminanceAloneIsGrey) {
  writeExr(exrOf({"Y", "A"}), path("a.exr"));
  expectValues(read("a.exr"), 6, 4, true);
}

TEST_F(PictureReaderTest, KnowsCubeMaps) {
  for (const auto& [envmap, is_cube] :
       {std::pair(Imf::ENVMAP_CUBE, true), {Imf::ENVMAP_LATLONG, false}}) {
    writeExrTest(path("a.exr"), {exrOf()},
                 [envmap](Imf::Header& header) { Imf::addEnvmap(header, envmap); });
    const auto reader = PictureReader::open(path("a.exr"));
    ASSERT_TRUE(reader.ok());
    EXPECT_EQ((*reader)->isCubeMap(), is_cube);
  }
}

TEST_F(PictureReaderTest, RefusesOtherChannels) {
  for (const auto& [channels, found] :
       std::vector<std::pair<std::vector<std::string>, std::string>>{
           {{"R", "G"}, "channels G R, expected R G B"},
           {{"Y", "RY", "BY"}, "channels BY RY Y, expected"},
           {{"depth"}, "channels depth, expected"}}) {
    writeExr(exrOf(channels), path("a.exr"));
    EXPECT_THAT(failure("a.exr").message(), AllOf(HasSubstr("a.exr"), HasSubstr(found)));
    EXPECT_EQ(failure("a.exr").code(), StatusCode::kCorruption);
  }
}

// A header and rows; `rows` as they are in the file.
std::string hdr(const std::string& size, const std::string& rows,
                const std::string& variables = "FORMAT=32-bit_rle_rgbe\n") {
  return "#?RADIANCE\n# made by a test\n" + variables + "\n" + size + "\n" + rows;
}

TEST_F(PictureReaderTest, ReadsFlatAndRunLengthEncodedRadiance) {
  // 128 + 8 is an exponent that makes mantissas whole numbers
  write("flat.hdr", hdr("-Y 1 +X 3", std::string("\x01\x02\x03\x88\x64", 5) +
                                         std::string("\0\xff\x89\x05\x05\x05\0", 7)));
  Pixels pixels = read("flat.hdr");
  ASSERT_EQ(pixels.values.size(), 3u);
  EXPECT_EQ(pixels.values[0], glm::vec3(1, 2, 3));
  EXPECT_EQ(pixels.values[1], glm::vec3(200, 0, 510));
  EXPECT_EQ(pixels.values[2], glm::vec3(0));

  // Red: 10 times 7; green: 3 literals and 7 times 1; blue all 0; exponent
  write("rle.hdr",
        hdr("-Y 1 +X 10", std::string("\x02\x02\x00\x0a", 4) + "\x8a\x07" +
                              "\x03\x01\x02\x03\x87\x01" + std::string("\x8a\0", 2) + "\x8a\x88"));
  pixels = read("rle.hdr");
  ASSERT_EQ(pixels.values.size(), 10u);
  EXPECT_EQ(pixels.values[2], glm::vec3(7, 3, 0));
  EXPECT_EQ(pixels.values[9], glm::vec3(7, 1, 0));

  // The older encoding: a pixel, 255 + 256 copies of it, and another
  write("old.hdr", hdr("-Y 1 +X 513", std::string("\x09\x02\x03\x88") + "\x01\x01\x01\xff" +
                                          "\x01\x01\x01\x01" + "\x04\x05\x06\x88"));
  pixels = read("old.hdr");
  ASSERT_EQ(pixels.values.size(), 513u);
  EXPECT_EQ(pixels.values[511], glm::vec3(9, 2, 3));
  EXPECT_EQ(pixels.values[512], glm::vec3(4, 5, 6));
}

TEST_F(PictureReaderTest, ExposureIsUndone) {
  write("a.hdr", hdr("-Y 1 +X 1", "\x10\x20\x30\x88", "EXPOSURE=2\nEXPOSURE=4.0\r\n"));
  EXPECT_EQ(read("a.hdr").values[0], glm::vec3(2, 4, 6));
  write("a.hdr", hdr("-Y 1 +X 1", "\x10\x20\x30\x88", "EXPOSURE=0\n"));
  EXPECT_THAT(failure("a.hdr").message(), HasSubstr("exposure '0', expected a positive number"));
}

// Hosts choose locales, and many have decimal commas.
TEST_F(PictureReaderTest, ExposureDoesNotDependOnTheLocale) {
  write("a.hdr", hdr("-Y 1 +X 1", "\x10\x20\x30\x88", "EXPOSURE= 2.5\n"));
  EXPECT_FLOAT_EQ(read("a.hdr").values[0].x, 6.4f);
  const std::string before = std::setlocale(LC_NUMERIC, nullptr);
  for (const char* name : {"de_DE.UTF-8", "fr_FR.UTF-8", "de_DE", "fr_FR"}) {
    if (std::setlocale(LC_NUMERIC, name) == nullptr) continue;
    EXPECT_FLOAT_EQ(read("a.hdr").values[0].x, 6.4f) << name;
  }
  std::setlocale(LC_NUMERIC, before.c_str());
}

TEST_F(PictureReaderTest, NamesWhatIsWrongWithRadianceFiles) {
  const std::string row("\x02\x02\x00\x0a\x8b\x07", 6);  // a run of 11
  const std::vector<std::pair<std::string, std::string>> files = {
      {hdr("-Y 2 +X 1", "\x01\x02\x03\x88"), "the file ends at"},
      {hdr("+Y 1 +X 1", "\x01\x02\x03\x88"), "size '+Y 1 +X 1', expected -Y HEIGHT +X WIDTH"},
      {hdr("-Y 1 +X 1 +Z 1", "\x01\x02\x03\x88"), "expected -Y HEIGHT +X WIDTH"},
      {hdr("-Y 0 +X 1", "\x01\x02\x03\x88"), "1 x 0 pixels, expected at least one"},
      {hdr("-Y -5 +X 1", "\x01\x02\x03\x88"), "1 x -5 pixels"},
      {hdr("-Y 1 +X 1", "\x01\x02\x03\x88", "FORMAT=32-bit_rle_xyze\n"),
       "format '32-bit_rle_xyze', expected 32-bit_rle_rgbe"},
      {hdr("-Y 1 +X 10", row), "row 0 before"},
      {hdr("-Y 1 +X 10", row), "a run of 11 bytes, expected 1 to 10"},
      {hdr("-Y 1 +X 12", row), "a row of 10 pixels, expected 12"},
      {hdr("-Y 1 +X 9", "\x01\x01\x01\x03"), "a run of 3 pixels after 0"},
      {"#?RADIANCE\n" + std::string(5000, 'x'), "no end of the line"},
      {"#?RADIANCE\nFORMAT", "the file ends at 17"}};
  for (const auto& [bytes, message] : files) {
    write("a.hdr", bytes);
    EXPECT_THAT(failure("a.hdr").message(), AllOf(HasSubstr("a.hdr: "), HasSubstr(message)));
    EXPECT_EQ(failure("a.hdr").code(), StatusCode::kCorruption);
  }
}

TEST_F(PictureReaderTest, NamesWhatIsNoPicture) {
  write("empty", "");
  EXPECT_THAT(failure("empty").message(), HasSubstr("empty: begins with nothing, expected 76 2f"));
  write("text", "hello");
  EXPECT_THAT(failure("text").message(), HasSubstr("text: begins with 68 65 6c 6c, expected 76"));
  EXPECT_EQ(failure("text").code(), StatusCode::kCorruption);
  EXPECT_EQ(failure("absent").code(), StatusCode::kIoError);
  EXPECT_EQ(failure(".").code(), StatusCode::kIoError);
}

TEST_F(PictureReaderTest, RefusesAbsurdSizesBeforeAllocating) {
  write("a.hdr", hdr("-Y 8193 +X 16384", ""));
  EXPECT_EQ(failure("a.hdr").code(), StatusCode::kInvalidArgument);
  EXPECT_THAT(failure("a.hdr").message(),
              HasSubstr("16384 x 8193 pixels, expected at most 134217728"));
  write("a.hdr", hdr("-Y 1 +X 9999999999", ""));
  EXPECT_EQ(failure("a.hdr").code(), StatusCode::kInvalidArgument);

  writeExr(exrOf(), path("a.exr"));
  write("a.exr", withExrWindow(contents("a.exr"), {0, 0, 0x7fffffff, 0x7fffffff}));
  EXPECT_EQ(failure("a.exr").code(), StatusCode::kCorruption);
  EXPECT_THAT(failure("a.exr").message(), HasSubstr("2147483648 x 2147483648 pixels"));
}

TEST_F(PictureReaderTest, RefusesAttributesThatTheFileCannotHold) {
  writeExr(exrOf(), path("a.exr"));
  std::string bytes = contents("a.exr");
  const std::size_t size = bytes.find("screenWindowWidth") + 18 + 6;
  bytes.replace(size, 4, std::string("\xff\xff\xff\x6f", 4));
  write("a.exr", bytes);
  EXPECT_EQ(failure("a.exr").code(), StatusCode::kCorruption);
  EXPECT_THAT(failure("a.exr").message(), HasSubstr("1879048191 bytes, expected at most"));
}

TEST_F(PictureReaderTest, RefusesTilesThatTakeTooMuchMemory) {
  ExrTestPart part = exrOf({"R", "G", "B"}, Imf::HALF, Imath::Box2i({0, 0}, {3999, 1999}));
  part.tile = 4000;
  part.compression = Imf::RLE_COMPRESSION;
  writeExr(part, path("a.exr"));
  EXPECT_THAT(failure("a.exr").message(), HasSubstr("4000 rows decode to 288000000 bytes"));
}

TEST_F(PictureReaderTest, RefusesEveryTruncation) {
  writeExr(exrOf(), path("whole.exr"));
  write("whole.hdr",
        hdr("-Y 2 +X 8", "\x02\x02" + std::string("\0\x08", 2) +
                             "\x88\x07\x88\x07\x88\x07\x88\x88" + std::string(32, 'a')));
  for (const char* const name : {"whole.exr", "whole.hdr"}) {
    ASSERT_FALSE(read(name).values.empty());
    const std::string bytes = contents(name);
    expectTruncationsAreRefused(bytes, bytes.size(), [&](const char* cut) { return failure(cut); });
  }
}

TEST_F(PictureReaderTest, SurvivesEveryDamagedByte) {
  ExrTestPart tiled = exrOf();
  tiled.tile = 2;
  writeExr(exrOf(), path("lines.exr"));
  writeExr(tiled, path("tiles.exr"));
  for (const char* const whole : {"lines.exr", "tiles.exr"}) {
    expectDamageIsHarmless(contents(whole), [&](const char* name) { return failure(name); });
  }
}

}  // namespace
}  // namespace surfeit
