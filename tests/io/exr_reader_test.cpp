#include "cloud/exr/exr_reader.h"

#include <OpenEXR/ImfDeepFrameBuffer.h>
#include <OpenEXR/ImfDeepScanLineOutputFile.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <array>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include "io/exr_test_picture.h"
#include "io/picture_file_test.h"
#include "io/row_stream_test.h"

namespace surfeit {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;

constexpr float kInf = std::numeric_limits<float>::infinity();
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

// All rows of a file: a value as it would be asked for by name.
struct Rows {
  RowLayout element;
  std::vector<std::byte> bytes;
  std::vector<std::string> notes;

  std::size_t count() const { return bytes.size() / element.row_bytes; }
  double at(std::size_t row, const std::string& property) const {
    const RowProperty* const found = element.find(property);
    EXPECT_NE(found, nullptr) << property;
    return found == nullptr
               ? -1
               : rowValue(bytes.data() + row * element.row_bytes + found->offset, found->type);
  }
};

Result<Rows> readAll(RowReader& reader, std::size_t batch) {
  Status status;
  Rows rows = {reader.element(), readAllRows(reader, batch, status), reader.notes()};
  if (!status.ok()) return status;
  return rows;
}

class ExrReaderTest : public PictureFileTest {
 protected:
  Rows read(const std::string& name, const RowReaderOptions& options = {}) const {
    const auto reader = openExr(path(name), options);
    EXPECT_TRUE(reader.ok()) << reader.status().message();
    if (!reader.ok()) return {};
    const Result<Rows> rows = readAll(**reader, 100000);
    EXPECT_TRUE(rows.ok()) << rows.status().message();
    if (!rows.ok()) return {};
    EXPECT_EQ((*reader)->element().count, rows->count());
    return *rows;
  }
  Status failure(const std::string& name, const RowReaderOptions& options = {}) const {
    const auto reader = openExr(path(name), options);
    return reader.ok() ? readAll(**reader, 100000).status() : reader.status();
  }
};

// A row of pixels on a slope of unit normal, of which the first is covered by a quarter.
ExrTestPart edgeOfSlope(bool is_divided, bool has_normals) {
  ExrTestPart part;
  part.window = Imath::Box2i({0, 0}, {3, 1});
  const auto scale = [=](int x) { return x == 0 && is_divided ? .25f : 1.f; };
  part.add("A", [](int x, int) { return x == 0 ? .25f : 1.f; });
  part.add("P.X", [=](int x, int) { return float(10 + x) * scale(x); });
  part.add("P.Y", [=](int x, int y) { return float(20 + y) * scale(x); });
  part.add("P.Z", [=](int x, int) { return float(30 + x) * scale(x); });
  if (!has_normals) return part;
  part.add("N.X", [=](int x, int) { return -.6f * scale(x); });
  part.add("N.Y", [=](int, int) { return 0.f; });
  part.add("N.Z", [=](int x, int) { return .8f * scale(x); });
  return part;
}

TEST_F(ExrReaderTest, PositionsTimesAlphaAreDivided) {
  for (const bool has_normals : {false, true}) {
    for (const bool is_divided : {false, true}) {
      writeExrTest(path("a.exr"), {edgeOfSlope(is_divided, has_normals)});
      const Rows rows = read("a.exr");
      ASSERT_EQ(rows.count(), 8u);
      for (std::size_t i = 0; i < 8; ++i) {
        EXPECT_EQ(rows.at(i, "x"), 10. + double(i % 4));
        EXPECT_EQ(rows.at(i, "y"), 20. + double(i / 4));
        EXPECT_EQ(rows.at(i, "z"), 30. + double(i % 4));
        if (has_normals) {
          EXPECT_EQ(rows.at(i, "nz"), double(.8f));
        }
      }
      if (is_divided) {
        EXPECT_THAT(rows.notes,
                    ElementsAre(HasSubstr("2 of 8 pixels are covered in part and hold")));
      } else {
        EXPECT_TRUE(rows.notes.empty());
      }
    }
  }
}

TEST_F(ExrReaderTest, EdgesOfWhichNothingTellsAreLeftOut) {
  ExrTestPart part = edgeOfSlope(true, false);
  // Nothing beside them
  for (auto& [name, channel] : part.channels) channel.values[1] = channel.values[5] = 0;
  writeExrTest(path("a.exr"), {part});
  const Rows rows = read("a.exr");
  EXPECT_EQ(rows.count(), 4u);
  EXPECT_THAT(rows.notes, ElementsAre(HasSubstr("2 of 6 pixels are covered in part, and nothing")));
}

TEST_F(ExrReaderTest, HalfPositionsAreToldBesideTheirSpacing) {
  ExrTestPart part;
  part.add(
      "P.X", [](int x, int) { return 1000 + x; }, Imf::HALF);
  part.add(
      "P.Y", [](int, int y) { return y; }, Imf::HALF);
  part.add(
      "P.Z", [](int, int) { return 0; }, Imf::HALF);
  writeExrTest(path("a.exr"), {part});
  EXPECT_THAT(read("a.exr").notes,
              ElementsAre(HasSubstr("stand up to 0.5 apart here, beside pixels 1")));
  part.channels.at("P.X").type = Imf::FLOAT;
  part.channels.at("P.Y").type = Imf::FLOAT;
  part.channels.at("P.Z").type = Imf::FLOAT;
  writeExrTest(path("a.exr"), {part});
  EXPECT_TRUE(read("a.exr").notes.empty());
}

TEST_F(ExrReaderTest, ReadsEveryKindOfStorage) {
  std::vector<ExrTestPart> kinds;
  for (const int tile : {0, 2, 4}) {
    for (const auto& window : {Imath::Box2i({0, 0}, {5, 3}), Imath::Box2i({-7, 11}, {30, 50})}) {
      for (const Imf::Compression compression :
           {Imf::NO_COMPRESSION, Imf::RLE_COMPRESSION, Imf::ZIPS_COMPRESSION, Imf::ZIP_COMPRESSION,
            Imf::PIZ_COMPRESSION}) {
        for (const Imf::LineOrder order : {Imf::INCREASING_Y, Imf::DECREASING_Y}) {
          ExrTestPart part = floorPasses(window);
          part.tile = tile;
          part.compression = compression;
          part.order = order;
          kinds.push_back(part);
        }
      }
    }
  }
  for (std::size_t i = 0; i < kinds.size(); ++i) {
    SCOPED_TRACE(i);
    ExrTestPart& kind = kinds[i];
    kind.add(
        "half.Z", [](int x, int y) { return x + y; }, Imf::HALF);
    kind.add(
        "id", [](int x, int y) { return 1048576 * x + 64 * y; }, Imf::UINT);
    writeExrTest(path("a.exr"), {kind});
    const Rows rows = read("a.exr");
    ASSERT_EQ(rows.count(), kind.pixelCount());
    for (std::size_t row = 0; row < rows.count(); ++row) {
      const int x = int(row) % kind.width(), y = int(row) / kind.width();
      ASSERT_EQ(rows.at(row, "x"), 1 + x);
      ASSERT_EQ(rows.at(row, "z"), 100 + 16 * x + y);
      ASSERT_EQ(rows.at(row, "ny"), 1);
      ASSERT_EQ(rows.at(row, "pixel_x"), kind.window.min.x + x);
      ASSERT_EQ(rows.at(row, "pixel_y"), kind.window.min.y + y);
      ASSERT_EQ(rows.at(row, "depth"), x + y);
      ASSERT_EQ(rows.at(row, "id"), 1048576 * x + 64 * y);
    }
  }
}

TEST_F(ExrReaderTest, BatchesAndRewindsDoNotChangeTheRows) {
  ExrTestPart part = floorPasses(Imath::Box2i({3, 4}, {22, 40}));
  part.add("A", [](int x, int y) { return (x * 7 + y * 3) % 5 == 0 ? 0 : 1; });
  writeExrTest(path("a.exr"), {part});
  const auto reader = openExr(path("a.exr"), {});
  ASSERT_TRUE(reader.ok());
  EXPECT_EQ((*reader)->formatName(), "OpenEXR");
  const Rows whole = *readAll(**reader, 1 << 20);
  EXPECT_GT(whole.count(), 500u);
  EXPECT_LT(whole.count(), part.pixelCount());
  ASSERT_TRUE((*reader)->rewind().ok());
  expectReaderKeepsContract(**reader);
  AlignedBuffer buffer;
  ASSERT_TRUE((*reader)->rewind().ok());
  ASSERT_TRUE((*reader)->readRows(7, buffer).ok());
  ASSERT_TRUE((*reader)->rewind().ok());
  EXPECT_EQ(readAll(**reader, 50)->bytes, whole.bytes);
  EXPECT_FALSE((*reader)->isSeekable());
}

// What a mask channel says of the 24 pixels, and what remains.
TEST_F(ExrReaderTest, EveryMaskLeavesPixelsOut) {
  const auto countWith = [&](const auto& edit) {
    ExrTestPart part = floorPasses();
    edit(part);
    writeExrTest(path("a.exr"), {part});
    return read("a.exr").count();
  };
  EXPECT_EQ(countWith([](ExrTestPart&) {}), 24u);
  EXPECT_EQ(countWith([](ExrTestPart& part) {
              part.add("A", [](int x, int) { return x == 1 ? 0.0f : x == 2 ? kNan : 0.25f; });
            }),
            16u);
  EXPECT_EQ(countWith([](ExrTestPart& part) {
              part.add("Z", [](int x, int) { return x == 0 ? kInf : x == 1 ? 1e30f : 1e9f; });
            }),
            16u);
  EXPECT_EQ(countWith([](ExrTestPart& part) {
              part.channels["P.Y"].values[3] = kNan;
              part.channels["P.Z"].values[5] = -kInf;
            }),
            22u);
  // The origin counts with a normal, and alone it does not
  const auto clear = [](ExrTestPart& part, std::size_t pixel) {
    for (const char* name : {"P.X", "P.Y", "P.Z"}) part.channels[name].values[pixel] = 0;
  };
  EXPECT_EQ(countWith([&](ExrTestPart& part) { clear(part, 4); }), 24u);
  EXPECT_EQ(countWith([&](ExrTestPart& part) {
              clear(part, 4);
              part.channels["N.Y"].values[4] = 0;
            }),
            23u);
  EXPECT_EQ(countWith([&](ExrTestPart& part) {
              clear(part, 4);
              for (const char* name : {"N.X", "N.Y", "N.Z"}) part.channels.erase(name);
            }),
            23u);
  EXPECT_EQ(countWith([](ExrTestPart& part) { part.add("A", [](int, int) { return 0; }); }), 0u);
}

TEST_F(ExrReaderTest, PartsWithOneWindowAreOnePicture) {
  ExrTestPart beauty, position, albedo, other = floorPasses(Imath::Box2i({0, 0}, {9, 9}));
  for (const char* name : {"R", "G", "B", "A"}) {
    beauty.add(
        name, [](int x, int) { return x == 0 ? 0 : 0.5; }, Imf::HALF);
  }
  for (const char* name : {"X", "Y", "Z"})
    position.add(name, [](int x, int y) { return x + y + 1; });
  for (const char* name : {"R", "G", "B"}) albedo.add(name, [](int, int y) { return y; });
  beauty.name = "beauty";
  position.name = "P";
  albedo.name = "albedo";
  other.name = "shadow";
  writeExrTest(path("a.exr"), {beauty, position, albedo, other});

  const Rows rows = read("a.exr");
  ASSERT_EQ(rows.count(), 20u);  // by the alpha of another part
  EXPECT_EQ(rows.at(5, "x"), 3);
  EXPECT_EQ(rows.at(5, "green"), 0.5);
  EXPECT_EQ(rows.at(5, "albedo_g"), 1);
  EXPECT_THAT(rows.notes,
              ElementsAre("part shadow is not read", HasSubstr("all pixels are covered in part")));

  RowReaderOptions options;
  options.part = "shadow";
  EXPECT_EQ(read("a.exr", options).count(), 100u);
  options.part = "beauty";
  EXPECT_EQ(failure("a.exr", options).code(), StatusCode::kCorruption);
  options.part = "absent";
  EXPECT_EQ(failure("a.exr", options).code(), StatusCode::kInvalidArgument);
  EXPECT_THAT(failure("a.exr", options).message(), HasSubstr("beauty, P, albedo, shadow"));
}

TEST_F(ExrReaderTest, ViewsAreNotMixed) {
  ExrTestPart left = floorPasses(), right = floorPasses();
  left.name = left.view = "left";
  right.name = right.view = "right";
  right.add("albedo.R", [](int, int) { return 1; });
  writeExrTest(path("a.exr"), {left, right});
  EXPECT_EQ(read("a.exr").element.find("albedo.R"), nullptr);
  EXPECT_THAT(read("a.exr").notes, ElementsAre("part right is not read"));
}

TEST_F(ExrReaderTest, DeepPicturesAreRefused) {
  Imf::Header header(2, 1);
  header.channels().insert("P.X", Imf::Channel(Imf::FLOAT));
  header.compression() = Imf::ZIPS_COMPRESSION;
  header.setType(Imf::DEEPSCANLINE);
  {
    std::vector<unsigned> counts(2, 0);
    std::vector<float*> samples(2, nullptr);
    Imf::DeepFrameBuffer buffer;
    buffer.insertSampleCountSlice(
        Imf::Slice(Imf::UINT, reinterpret_cast<char*>(counts.data()), 4, 8));
    buffer.insert("P.X", Imf::DeepSlice(Imf::FLOAT, reinterpret_cast<char*>(samples.data()),
                                        sizeof(float*), 2 * sizeof(float*), sizeof(float)));
    Imf::DeepScanLineOutputFile file(path("a.exr").c_str(), header, 0);
    file.setFrameBuffer(buffer);
    file.writePixels(1);
  }
  EXPECT_EQ(failure("a.exr").code(), StatusCode::kCorruption);
  EXPECT_THAT(failure("a.exr").message(), HasSubstr("all parts are deep, expected flat pixels"));
}

TEST_F(ExrReaderTest, NamesWhatIsMissing) {
  ExrTestPart part;
  part.add("R", [](int, int) { return 1; });
  writeExrTest(path("a.exr"), {part});
  EXPECT_THAT(failure("a.exr").message(),
              AllOf(HasSubstr("a.exr: found the channels"), HasSubstr("R"), HasSubstr("P.X P.Y")));
  write("text", "hello world");
  EXPECT_THAT(failure("text").message(),
              HasSubstr("text: begins with 6c6c6568, expected 01312f76"));
  EXPECT_EQ(failure("absent").code(), StatusCode::kIoError);
  EXPECT_TRUE(recognisesExr("\x76\x2f\x31\x01...."));
  EXPECT_FALSE(recognisesExr("\x76\x2f\x31"));
}

TEST_F(ExrReaderTest, RefusesEveryTruncation) {
  ExrTestPart lines = floorPasses(), tiles = floorPasses();
  tiles.tile = 4;
  lines.name = "P";
  ExrTestPart second = tiles;
  second.name = "second";
  for (const auto& parts : {std::vector{lines}, std::vector{tiles}, std::vector{lines, second}}) {
    writeExrTest(path("whole.exr"), parts);
    const std::string bytes = contents("whole.exr");
    // Of a second part nothing is read that the first one has
    const std::size_t needed = parts.size() == 1 ? bytes.size() : bytes.size() / 2;
    expectTruncationsAreRefused(bytes, needed, [&](const char* name) { return failure(name); });
  }
}

TEST_F(ExrReaderTest, SurvivesEveryDamagedByte) {
  ExrTestPart lines = floorPasses(), tiles = floorPasses();
  tiles.tile = 2;
  for (const ExrTestPart& part : {lines, tiles}) {
    writeExrTest(path("whole.exr"), {part});
    expectDamageIsHarmless(contents("whole.exr"), [&](const char* name) { return failure(name); });
  }
}

TEST_F(ExrReaderTest, WindowsThatTheFileCannotHoldAreRefusedBeforeAllocating) {
  for (const int tile : {0, 4}) {
    for (const Imf::Compression compression : {Imf::NO_COMPRESSION, Imf::ZIP_COMPRESSION}) {
      ExrTestPart part = floorPasses();
      part.tile = tile;
      part.compression = compression;
      writeExrTest(path("whole.exr"), {part});
      for (const auto& window :
           std::vector<std::array<std::int32_t, 4>>{{0, 0, 79999, 15999},
                                                    {0, 0, 1 << 28, 0},
                                                    {0, 0, 0, 1 << 28},
                                                    {-(1 << 30), -(1 << 30), 1 << 30, 1 << 30},
                                                    {5, 3, 0, 0}}) {
        write("a.exr", withExrWindow(contents("whole.exr"), window));
        rusage before{}, after{};
        getrusage(RUSAGE_SELF, &before);
        EXPECT_EQ(failure("a.exr").code(), StatusCode::kCorruption) << failure("a.exr").message();
        getrusage(RUSAGE_SELF, &after);
        EXPECT_LT(after.ru_maxrss - before.ru_maxrss, 32 << 10);
      }
    }
  }
}

TEST_F(ExrReaderTest, AttributesThatAreLongerThanTheFileAreRefused) {
  writeExrTest(path("whole.exr"), {floorPasses()},
               [](Imf::Header& header) { header.setView(std::string(40, 'v')); });
  std::string bytes = contents("whole.exr");
  const std::size_t at = bytes.find("view") + 5 + 7;
  for (const std::int32_t size : {0x7fffffff, -1, 1 << 20}) {
    std::memcpy(bytes.data() + at, &size, 4);
    write("a.exr", bytes);
    EXPECT_EQ(failure("a.exr").code(), StatusCode::kCorruption);
    EXPECT_THAT(failure("a.exr").message(),
                AllOf(HasSubstr("a.exr: attribute at"), HasSubstr("bytes, expected at most")));
  }
}

// OpenEXR takes the rest of such values for attributes.
TEST_F(ExrReaderTest, AttributesOfAWrongSizeAreRefused) {
  writeExrTest(path("whole.exr"), {floorPasses()});
  for (const auto& [type, change] :
       {std::pair("box2i", 1), {"box2i", -4}, {"chlist", -1}, {"chlist", 20}, {"lineOrder", 2}}) {
    std::string bytes = contents("whole.exr");
    bytes[bytes.rfind(type) + std::string(type).size() + 1] += char(change);
    write("a.exr", bytes);
    EXPECT_EQ(failure("a.exr").code(), StatusCode::kCorruption);
    EXPECT_THAT(failure("a.exr").message(),
                HasSubstr(std::string("expected the size of a value of type ") + type));
  }
}

TEST_F(ExrReaderTest, FilesWithoutPartsAreRefused) {
  // The flag of several parts, and the end of their list
  write("a.exr", std::string("\x76\x2f\x31\x01\x02\x10\0\0\0", 9));
  EXPECT_EQ(failure("a.exr").code(), StatusCode::kCorruption);
  EXPECT_THAT(failure("a.exr").message(), HasSubstr("a.exr: no parts, expected at least one"));
}

TEST_F(ExrReaderTest, BlocksThatTakeTooMuchMemoryAreRefused) {
  ExrTestPart part;
  part.window = {{0, 0}, {49999, 3}};
  part.tile = 500;
  part.compression = Imf::RLE_COMPRESSION;
  for (const char* name : {"P.X", "P.Y", "P.Z", "R"}) part.add(name, [](int, int) { return 0; });
  writeExrTest(path("a.exr"), {part});
  EXPECT_EQ(failure("a.exr").code(), StatusCode::kInvalidArgument);
  EXPECT_THAT(failure("a.exr").message(), HasSubstr("500 rows decode to 400000000 bytes"));

  // Tiles that are wider than the picture
  part = floorPasses();
  part.tile = 4;
  writeExrTest(path("whole.exr"), {part});
  std::string bytes = contents("whole.exr");
  const std::uint32_t wide = 1 << 24;
  std::memcpy(bytes.data() + bytes.find("tiledesc") + 9 + 4, &wide, sizeof(wide));
  write("a.exr", bytes);
  EXPECT_EQ(failure("a.exr").code(), StatusCode::kInvalidArgument);
  EXPECT_THAT(failure("a.exr").message(), HasSubstr("4 rows decode to 1610612736 bytes"));
}

}  // namespace
}  // namespace surfeit
