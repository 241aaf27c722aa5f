#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "cloud/particles/ptc_format.h"
#include "cloud/particles/ptc_reader.h"
#include "cloud/particles/ptc_writer.h"
#include "io/row_damage_test.h"
#include "storage/byte_output.h"

namespace surfeit {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

// Of a version 0 file of two variables, float and color, as the tests below patch it
constexpr std::size_t kCountAt = 8, kVariablesAt = 40 + 128 + 12;

std::vector<RowProperty> properties(std::initializer_list<const char*> names) {
  std::vector<RowProperty> all;
  for (const char* name : names) all.push_back(rowProperty(name));
  return all;
}

std::vector<std::byte> floatRows(std::size_t count, std::size_t floats) {
  std::mt19937 random(3);
  std::vector<float> values(count * floats);
  for (float& value : values) value = std::ldexp(float(int(random()) >> 8), -20);
  std::vector<std::byte> rows(values.size() * sizeof(float));
  std::memcpy(rows.data(), values.data(), rows.size());
  return rows;
}

class PtcFiles : public RowFileTest {
 protected:
  void writePtc(const std::string& name, const std::vector<RowProperty>& columns,
                const std::vector<std::byte>& rows, int version = 0,
                const RowReader* like = nullptr) {
    RowWriterOptions options;
    options.properties = columns;
    options.like = like;
    Result<std::unique_ptr<RowWriter>> writer = createPtcVersion(path(name), options, version);
    ASSERT_TRUE(writer.ok()) << writer.status().message();
    ASSERT_TRUE((*writer)->writeRows(rows).ok());
    const Status finished = (*writer)->finish();
    ASSERT_TRUE(finished.ok()) << finished.message();
    notes_ = (*writer)->notes();
  }

  std::unique_ptr<RowReader> openGood(const std::string& name, RowReaderOptions options = {}) {
    return openOk(openPtc, path(name), options);
  }
  std::string refusalOf(const std::string& text) { return refusal(openPtc, text); }

  std::vector<std::string> notes_;
};

double angleBetween(const float a[3], const float b[3]) {
  const double cross = std::hypot(double(a[1]) * b[2] - double(a[2]) * b[1],
                                  double(a[2]) * b[0] - double(a[0]) * b[2],
                                  double(a[0]) * b[1] - double(a[1]) * b[0]);
  const double dot = double(a[0]) * b[0] + double(a[1]) * b[1] + double(a[2]) * b[2];
  return std::atan2(cross, dot) * 180 / std::numbers::pi;
}

TEST(PtcNormalCode, UnitVectorsComeBackWithinItsPrecision) {
  std::mt19937 random(1);
  std::normal_distribution<float> gauss;
  double sum = 0, largest = 0;
  constexpr int kNormals = 100000;
  for (int i = 0; i < kNormals; ++i) {
    const float normal[3] = {gauss(random), gauss(random), gauss(random)};
    float decoded[3];
    decodePtcNormal(encodePtcNormal(normal), decoded);
    const double angle = angleBetween(normal, decoded);
    sum += angle;
    largest = std::max(largest, angle);
  }
  EXPECT_LT(sum / kNormals, 0.002);
  EXPECT_LT(largest, 0.33);

  // Near the poles, where it is worst, and at them
  for (const float tilt : {0.0f, 1e-6f, 1e-3f, 3e-3f, 5.5e-3f}) {
    for (const float up : {1.0f, -1.0f}) {
      const float normal[3] = {tilt, -tilt / 2, up};
      float decoded[3];
      decodePtcNormal(encodePtcNormal(normal), decoded);
      EXPECT_LT(angleBetween(normal, decoded), 0.33) << tilt << " " << up;
    }
  }
}

TEST(PtcNormalCode, EveryCodeIsWhatTheFormulaSays) {
  for (int phi = 0; phi < 65536; phi += 13) {
    for (const int z : {0, 1, 255, 256, 32768, 65534, 65535}) {
      float decoded[3];
      decodePtcNormal({std::uint16_t(phi), std::uint16_t(z)}, decoded);
      const double nz = 2 * z / 65535.0 - 1, angle = 2 * std::numbers::pi * (phi / 65535.0 - 0.5);
      const double radius = std::sqrt(1 - nz * nz);
      if (phi == 65535 && z == 65535) continue;
      EXPECT_NEAR(decoded[0], radius * std::sin(angle), 1e-7);
      EXPECT_NEAR(decoded[1], radius * std::cos(angle), 1e-7);
      EXPECT_NEAR(decoded[2], nz, 1e-7);
    }
  }
}

TEST(PtcNormalCode, OnlyTheZeroNormalHasTheZeroCode) {
  float decoded[3] = {1, 1, 1};
  decodePtcNormal({65535, 65535}, decoded);
  EXPECT_THAT(decoded, ElementsAre(0, 0, 0));
  const float zero[3] = {}, bad[3] = {NAN, 0, 1}, pole[3] = {0, -0.0f, 1}, back[3] = {-0.0f, -1, 0};
  EXPECT_EQ(encodePtcNormal(zero).phi, 65535);
  EXPECT_EQ(encodePtcNormal(zero).z, 65535);
  EXPECT_EQ(encodePtcNormal(bad).phi, 65535);
  decodePtcNormal(encodePtcNormal(pole), decoded);
  EXPECT_FLOAT_EQ(decoded[2], 1);
  decodePtcNormal(encodePtcNormal(back), decoded);
  EXPECT_NEAR(decoded[1], -1, 1e-6);
}

TEST_F(PtcFiles, EveryVersionRoundTrips) {
  const auto columns = properties({"x", "y", "z", "radius", "area", "radiosity_r", "radiosity_g",
                                   "radiosity_b", "occlusion", "irradiance_r", "irradiance_g",
                                   "irradiance_b", "albedo_r", "albedo_g", "albedo_b",
                                   "bent_normal_x", "bent_normal_y", "bent_normal_z", "weight"});
  const std::vector<std::byte> rows = floatRows(40000, columns.size());
  for (int version = 0; version <= kNewestPtcVersion; ++version) {
    writePtc("a.ptc", columns, rows, version);
    EXPECT_THAT(notes_, IsEmpty());
    const std::unique_ptr<RowReader> reader = openGood("a.ptc");
    ASSERT_NE(reader, nullptr);
    EXPECT_EQ(reader->formatName(), "PTC " + std::to_string(version));
    EXPECT_TRUE(reader->isSeekable());
    EXPECT_THAT(reader->notes(), IsEmpty());
    ASSERT_EQ(reader->element().count, 40000u);
    const std::vector<std::byte> read = readAllRows(*reader);
    ASSERT_EQ(reader->element().properties.size(), columns.size() + 3);
    for (std::size_t row = 0; row < 40000; row += 37) {
      for (std::size_t i = 0; i < columns.size(); ++i) {
        float value;
        std::memcpy(&value, &rows[(row * columns.size() + i) * 4], 4);
        ASSERT_EQ(valueOf(*reader, read, row, columns[i].name), value) << columns[i].name;
      }
      ASSERT_EQ(valueOf(*reader, read, row, "nz"), 0);
    }
    ASSERT_TRUE(reader->rewind().ok());
    expectReaderKeepsContract(*reader);
  }
}

TEST_F(PtcFiles, NamesOfVariablesAreThoseOfRenderMan) {
  const auto columns =
      properties({"x", "y", "z", "area", "radiosity_r", "radiosity_g", "radiosity_b", "velocity_x",
                  "velocity_y", "velocity_z", "u_0", "u_1"});
  writePtc("a.ptc", columns, floatRows(1, columns.size()));
  EXPECT_THAT(contents("a.ptc"), HasSubstr("float _area\ncolor _radiosity\nvector velocity\n"
                                           "float u_0\nfloat u_1\n"));
}

TEST_F(PtcFiles, SameRowsGiveSameBytes) {
  const auto columns = properties({"x", "y", "z", "nx", "ny", "nz"});
  writePtc("a.ptc", columns, floatRows(100, columns.size()));
  writePtc("b.ptc", columns, floatRows(100, columns.size()));
  EXPECT_EQ(contents("a.ptc"), contents("b.ptc"));
}

TEST_F(PtcFiles, BoundsAreThoseOfFinitePositions) {
  const float values[] = {1, 2, 3, -4, 5, 0.5f, NAN, 100, 100};
  std::vector<std::byte> rows(sizeof values);
  std::memcpy(rows.data(), values, sizeof values);
  writePtc("a.ptc", properties({"x", "y", "z"}), rows);
  EXPECT_THAT(notes_, ElementsAre(HasSubstr("every point has a radius")));
  float bounds[6];
  std::memcpy(bounds, contents("a.ptc").data() + 16, sizeof bounds);
  EXPECT_THAT(bounds, ElementsAre(-4, 2, 0.5f, 1, 5, 3));
  const std::unique_ptr<RowReader> reader = openGood("a.ptc");
  EXPECT_TRUE(std::isnan(valueOf(*reader, readAllRows(*reader), 2, "x")));
}

TEST_F(PtcFiles, RadiusComesFromAreaOrWidthWhereThereIsNone) {
  const float disk[] = {0, 0, 0, std::numbers::pi_v<float> * 4}, ball[] = {0, 0, 0, 3};
  std::vector<std::byte> rows(sizeof disk);
  std::memcpy(rows.data(), disk, sizeof disk);
  writePtc("a.ptc", properties({"x", "y", "z", "area"}), rows);
  std::unique_ptr<RowReader> reader = openGood("a.ptc");
  EXPECT_FLOAT_EQ(float(valueOf(*reader, readAllRows(*reader), 0, "radius")), 2);
  std::memcpy(rows.data(), ball, sizeof ball);
  writePtc("a.ptc", properties({"x", "y", "z", "width"}), rows);
  reader = openGood("a.ptc");
  EXPECT_FLOAT_EQ(float(valueOf(*reader, readAllRows(*reader), 0, "radius")), 1.5f);
}

TEST_F(PtcFiles, PointsWithoutRadiiAreReadWithoutSizes) {
  for (const std::size_t count : {1, 25'000}) {
    const auto columns = properties({"x", "y", "z", "radius"});
    std::vector<std::byte> rows = floatRows(count, columns.size());
    for (std::size_t i = 0; i < count; ++i) std::memset(rows.data() + (4 * i + 3) * 4, 0, 4);
    writePtc("a.ptc", columns, rows);
    std::unique_ptr<RowReader> reader = openGood("a.ptc");
    EXPECT_EQ(reader->element().find("radius"), nullptr);
    EXPECT_THAT(reader->notes(), ElementsAre(HasSubstr("all radii are 0")));
    const float two = 2;
    for (std::size_t i = 0; i < count; i += 2) {
      std::memcpy(rows.data() + (4 * i + 3) * 4, &two, sizeof two);
    }
    writePtc("a.ptc", columns, rows);
    reader = openGood("a.ptc");
    EXPECT_EQ(valueOf(*reader, readAllRows(*reader), 0, "radius"), 2);
    EXPECT_THAT(reader->notes(), ElementsAre());
  }
}

TEST_F(PtcFiles, OtherTypesBecomeFloatsWithANote) {
  std::vector<RowProperty> columns = {rowProperty("x", ValueType::kFloat64),
                                      rowProperty("y", ValueType::kFloat64),
                                      rowProperty("z", ValueType::kFloat64),
                                      rowProperty("red", ValueType::kUint8),
                                      rowProperty("green", ValueType::kUint8),
                                      rowProperty("blue", ValueType::kUint8),
                                      rowProperty("radius")};
  std::vector<std::byte> rows(31);
  const double position[3] = {0.5, 1e9, -3};
  std::memcpy(rows.data(), position, sizeof position);
  rows[24] = std::byte{255};
  writePtc("a.ptc", columns, rows);
  EXPECT_THAT(notes_, ElementsAre("double becomes float: x y z",
                                  "sRGB becomes scene-linear float: red green blue"));
  const std::unique_ptr<RowReader> reader = openGood("a.ptc");
  const std::vector<std::byte> read = readAllRows(*reader);
  EXPECT_EQ(valueOf(*reader, read, 0, "y"), 1e9);
  EXPECT_EQ(valueOf(*reader, read, 0, "red"), 1);
}

TEST_F(PtcFiles, CameraOfAnotherCloudIsKept) {
  PtcHeader header;
  header.version = 1;
  header.camera.eye_from_world[7] = 5;
  header.camera.format = {1920, 1080, 0.5f};
  const std::vector<std::byte> bytes = formatPtcHeader(header);
  write("like.ptc", {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  const std::unique_ptr<RowReader> like = openGood("like.ptc");
  EXPECT_EQ(like->element().count, 0u);
  EXPECT_THAT(readAllRows(*like), IsEmpty());
  writePtc("a.ptc", properties({"x", "y", "z"}), floatRows(2, 3), 0, like.get());
  const std::unique_ptr<RowReader> reader = openGood("a.ptc");
  ASSERT_NE(ptcCameraOf(*reader), nullptr);
  EXPECT_EQ(ptcCameraOf(*reader)->eye_from_world[7], 5);
  EXPECT_EQ(ptcCameraOf(*reader)->format[2], 0.5f);
}

TEST_F(PtcFiles, CompressedFilesAreReadAndWritten) {
  const auto columns = properties({"x", "y", "z", "radius", "occlusion"});
  const std::vector<std::byte> rows = floatRows(30000, columns.size());
  writePtc("a.ptc", columns, rows);
  writePtc("a.ptc.gz", columns, rows);
  EXPECT_LT(contents("a.ptc.gz").size(), contents("a.ptc").size());
  const std::unique_ptr<RowReader> plain = openGood("a.ptc"), packed = openGood("a.ptc.gz");
  EXPECT_FALSE(packed->isSeekable());
  EXPECT_TRUE(readAllRows(*plain) == readAllRows(*packed, 999));
  ASSERT_TRUE(packed->rewind().ok());
  expectReaderKeepsContract(*packed);
}

TEST_F(PtcFiles, TwinVariablesGetNamesOfTheirOwn) {
  PtcHeader header;
  header.count = 1;
  header.variables = {{"_area", ChannelKind::kFloat},
                      {"_area", ChannelKind::kFloat},
                      {"P", ChannelKind::kPoint},
                      {"radius", ChannelKind::kFloat},
                      {"frame", ChannelKind::kMatrix},
                      {"up", ChannelKind::kNormal},
                      {std::string(60, 'n'), ChannelKind::kFloat},
                      {std::string(60, 'n'), ChannelKind::kFloat}};
  std::vector<std::byte> bytes = formatPtcHeader(header);
  const float one = 1;
  constexpr std::size_t kRadiusAt = 16;
  bytes.resize(bytes.size() + header.recordBytes());
  std::memcpy(bytes.data() + bytes.size() - header.recordBytes() + kRadiusAt, &one, sizeof one);
  write("a.ptc", {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  const std::unique_ptr<RowReader> reader = openGood("a.ptc");
  ASSERT_NE(reader, nullptr);
  const std::string row = describeRow(reader->element());
  EXPECT_THAT(row, HasSubstr("float area, float _area_2, float P_2_x, float P_2_y, float P_2_z, "
                             "float radius_2, float frame_0"));
  EXPECT_THAT(row, HasSubstr("float frame_15, float up_x, float up_y, float up_z"));
  EXPECT_EQ(reader->element().row_bytes, 7 * 4 + header.recordBytes() - kPtcPointBytes);
}

TEST_F(PtcFiles, RenamesMapAndDropChannels) {
  const auto columns = properties({"x", "y", "z", "radius", "weight", "occlusion"});
  const std::vector<std::byte> rows = floatRows(3, columns.size());
  writePtc("a.ptc", columns, rows);
  RowReaderOptions options;
  options.channels = {{"weight", "area"}, {"N", "-"}, {"radius", "-"}};
  const std::unique_ptr<RowReader> reader = openGood("a.ptc", options);
  EXPECT_EQ(describeRow(reader->element()),
            "float x, float y, float z, float area, float occlusion");
  const std::vector<std::byte> read = readAllRows(*reader);
  float weight;
  std::memcpy(&weight, &rows[(2 * 6 + 4) * 4], 4);
  EXPECT_EQ(valueOf(*reader, read, 2, "area"), weight);

  options.channels = {
      {"P", "-"}, {"N", "-"}, {"radius", "-"}, {"weight", "-"}, {"_occlusion", "-"}};
  EXPECT_EQ(openPtc(path("a.ptc"), options).status().code(), StatusCode::kInvalidArgument);
}

TEST_F(PtcFiles, EveryTruncationIsFound) {
  for (int version = 0; version <= kNewestPtcVersion; ++version) {
    const auto columns = properties({"x", "y", "z", "area"});
    writePtc("a.ptc", columns, floatRows(3, columns.size()), version);
    const std::string whole = contents("a.ptc");
    EXPECT_EQ(readAllRows(*openGood("a.ptc")).size(), 3 * 32u);
    expectEveryTruncationFails(openPtc, whole, whole.size());
    expectDamageIsHarmless(openPtc, whole, 3);
  }
}

TEST_F(PtcFiles, BytesAfterTheLastPointAreNoted) {
  writePtc("a.ptc", properties({"x", "y", "z", "radius"}), floatRows(3, 4));
  write("b.ptc", contents("a.ptc") + "abc");
  EXPECT_THAT(openGood("b.ptc")->notes(), ElementsAre(HasSubstr("3 bytes behind the last point")));
}

TEST_F(PtcFiles, DamagedHeadersAreRefused) {
  const auto columns = properties({"x", "y", "z", "area", "albedo_r", "albedo_g", "albedo_b"});
  writePtc("a.ptc", columns, floatRows(3, columns.size()));
  const std::string good = contents("a.ptc");
  const auto patched = [&good](std::size_t at, auto value) {
    std::string text = good;
    std::memcpy(&text[at], &value, sizeof value);
    return text;
  };
  EXPECT_THAT(refusalOf(patched(0, 'q')), HasSubstr("begins with 'qptc', expected 'pptc'"));
  EXPECT_THAT(refusalOf(patched(4, 3)), HasSubstr("found version 3, expected 0, 1 or 2"));
  EXPECT_THAT(refusalOf(patched(4, -1)), HasSubstr("found version -1"));
  for (const double count : {-1.0, 2.5, 1e300, double(NAN), double(INFINITY), 0x1p63}) {
    EXPECT_THAT(refusalOf(patched(kCountAt, count)), HasSubstr("expected a whole number"));
  }
  EXPECT_THAT(refusalOf(patched(kCountAt, 0x1p62)), HasSubstr("hold 3 records of 36 bytes"));
  EXPECT_THAT(refusalOf(patched(kVariablesAt, -1)), HasSubstr("found -1 variables"));
  EXPECT_THAT(refusalOf(patched(kVariablesAt, 1 << 30)), HasSubstr("expected 0 to 256"));
  EXPECT_THAT(refusalOf(patched(kVariablesAt, 1)), HasSubstr("found 4 floats a point, expected 1"));
  EXPECT_THAT(refusalOf(patched(kVariablesAt + 4, 5)), HasSubstr("expected 4 by the types"));
  EXPECT_THAT(refusalOf(patched(kVariablesAt + 8, 'g')),
              HasSubstr("found 'gloat _area', expected"));
  EXPECT_THAT(refusalOf(patched(kVariablesAt + 13, '_')), HasSubstr("found 'float__area'"));
}

TEST_F(PtcFiles, SeveralBlanksMayFollowAType) {
  writePtc("a.ptc", properties({"x", "y", "z", "area"}), floatRows(1, 4));
  std::string text = contents("a.ptc");
  text.replace(text.find("float _area"), 11, "float  \t_area");
  write("b.ptc", text);
  EXPECT_NE(openGood("b.ptc")->element().find("area"), nullptr);
}

TEST_F(PtcFiles, CompressedCountThatLiesFailsWithoutMemory) {
  PtcHeader header;
  header.count = std::uint64_t{1} << 60;
  std::vector<std::byte> bytes = formatPtcHeader(header);
  bytes.resize(bytes.size() + 3 * kPtcPointBytes);
  Result<ByteOutput> output = ByteOutput::create(path("b.ptc.gz"));
  ASSERT_TRUE(output.ok() && output->append(bytes).ok() && output->commit().ok());
  const std::unique_ptr<RowReader> reader = openGood("b.ptc.gz");
  EXPECT_EQ(reader->element().count, std::uint64_t{1} << 60);
  AlignedBuffer buffer;
  const Result<Bytes> rows = reader->readRows(~std::size_t{0}, buffer);
  EXPECT_THAT(rows.status().message(), HasSubstr("file ends early"));
  EXPECT_LT(buffer.capacity(), std::size_t{64} << 20);
  EXPECT_EQ(reader->readRows(1, buffer).status().message(), rows.status().message());
  ASSERT_TRUE(reader->rewind().ok());
  EXPECT_TRUE(reader->readRows(3, buffer).ok());
}

TEST_F(PtcFiles, RowsThatCannotBeWrittenAreRefused) {
  RowWriterOptions options;
  options.properties = properties({"x", "y"});
  EXPECT_THAT(createPtc(path("a.ptc"), options).status().message(), HasSubstr("no positions"));
  options.properties = properties({"x", "y", "z"});
  Result<std::unique_ptr<RowWriter>> writer = createPtc(path("a.ptc"), options);
  ASSERT_TRUE(writer.ok());
  EXPECT_EQ((*writer)->writeRows(std::vector<std::byte>(13)).code(), StatusCode::kInvalidArgument);
  writer->reset();
  EXPECT_EQ(fileCount(), 0);
}

TEST(PtcSamples, HoldWhatTheirReadmeSays) {
  const std::filesystem::path directory =
      std::filesystem::path(SURFEIT_SHARED_DATA_DIR) / "particles";
  if (!std::filesystem::exists(directory)) GTEST_SKIP() << "no " << directory;
  const auto open = [&](const char* name) {
    return std::move(openPtc((directory / name).string(), {}).value());
  };
  const std::unique_ptr<RowReader> lion = open("lion_20k.ptc"), lion2 = open("lion_20k_v2.ptc"),
                                   fragment = open("open3d_fragment.ptc");
  EXPECT_EQ(lion->formatName(), "PTC 0");
  EXPECT_EQ(lion2->formatName(), "PTC 2");
  EXPECT_EQ(lion->element().count, 20000u);
  EXPECT_EQ(fragment->element().count, 113662u);
  EXPECT_EQ(describeRow(lion->element()),
            "float x, float y, float z, float nx, float ny, float nz, float radius, float area, "
            "float radiosity_r, float radiosity_g, float radiosity_b");
  const std::vector<std::byte> rows = readAllRows(*lion);
  EXPECT_TRUE(rows == readAllRows(*lion2));
  double least = 1e9, largest = -1e9;
  for (std::size_t row = 0; row < 20000; ++row) {
    least = std::min(least, valueOf(*lion, rows, row, "z"));
    largest = std::max(largest, valueOf(*lion, rows, row, "z"));
    const double length =
        std::hypot(valueOf(*lion, rows, row, "nx"), valueOf(*lion, rows, row, "ny"),
                   valueOf(*lion, rows, row, "nz"));
    EXPECT_NEAR(length, 1, 1e-6);
  }
  EXPECT_NEAR(least, -3.445, 1e-4);
  EXPECT_NEAR(largest, 1.118, 1e-4);
  ASSERT_TRUE(fragment->rewind().ok());
  expectReaderKeepsContract(*fragment);
}

}  // namespace
}  // namespace surfeit
