#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>

#include "cloud/houdini/bgeo_ascii_reader.h"
#include "cloud/houdini/bgeo_json_reader.h"
#include "cloud/houdini/bgeo_reader.h"
#include "cloud/houdini/bgeo_writer.h"
#include "io/bgeo_json_bytes.h"
#include "io/row_damage_test.h"
#include "io/test_bytes.h"

namespace surfeit {
namespace {

template <typename T>
std::string be(T value) {
  return bigEndian(value);
}
std::string name16(const std::string& name) { return be(std::uint16_t(name.size())) + name; }

std::string header(std::int32_t points, std::int32_t attributes, std::int32_t version = 5) {
  std::string file = "BgeoV" + be(version) + be(points);
  for (const std::int32_t count : {0, 0, 0, attributes, 0, 0, 0}) file += be(count);
  return file;
}

// Two points with a life of two values, an id and a string out of two.
std::string classic() {
  std::string file = header(2, 3);
  file += name16("life") + be(std::uint16_t{2}) + be(std::int32_t{0}) + be(0.0f) + be(0.0f);
  file += name16("id") + be(std::uint16_t{1}) + be(std::int32_t{1}) + be(std::int32_t{0});
  file += name16("kind") + be(std::uint16_t{1}) + be(std::int32_t{4}) + be(std::int32_t{2}) +
          name16("one") + name16("two");
  for (int i = 0; i < 2; ++i) {
    file += be(float(i)) + be(0.5f) + be(-2.0f) + be(1.0f) + be(float(10 + i)) + be(7.0f) +
            be(std::int32_t(100 + i)) + be(std::int32_t(i));
  }
  return file;
}

class BgeoTest : public RowFileTest {};

TEST_F(BgeoTest, ReadsClassicPoints) {
  write("a.bgeo", classic() + std::string("\0\xFF", 2));
  const auto reader = openOk(openBgeo, path("a.bgeo"));
  ASSERT_NE(reader, nullptr);
  EXPECT_EQ(describeRow(reader->element()),
            "float x, float y, float z, float life_0, float life_1, int id, int kind");
  EXPECT_EQ(reader->notes().size(), 1u);
  const std::vector<std::byte> rows = readAllRows(*reader);
  EXPECT_EQ(valueOf(*reader, rows, 1, "x"), 1);
  EXPECT_EQ(valueOf(*reader, rows, 1, "z"), -2);
  EXPECT_EQ(valueOf(*reader, rows, 1, "life_0"), 11);
  EXPECT_EQ(valueOf(*reader, rows, 1, "id"), 101);
  EXPECT_EQ(valueOf(*reader, rows, 1, "kind"), 1);
  ASSERT_TRUE(reader->rewind().ok());
  expectReaderKeepsContract(*reader);
}

TEST_F(BgeoTest, DroppedAttributesAreSteppedOver) {
  write("a.bgeo", classic());
  RowReaderOptions options;
  options.channels = {{"life", "-"}, {"id", "number"}};
  const auto reader = openOk(openBgeo, path("a.bgeo"), options);
  ASSERT_NE(reader, nullptr);
  EXPECT_EQ(describeRow(reader->element()), "float x, float y, float z, int number, int kind");
  const std::vector<std::byte> rows = readAllRows(*reader);
  EXPECT_EQ(valueOf(*reader, rows, 1, "number"), 101);
  EXPECT_EQ(valueOf(*reader, rows, 0, "kind"), 0);
}

TEST_F(BgeoTest, RefusesBadClassicHeaders) {
  EXPECT_NE(refusal(openBgeo, header(2, 0, 6)).find("version 6"), std::string::npos);
  EXPECT_NE(refusal(openBgeo, header(-2, 0)).find("-2 points"), std::string::npos);
  EXPECT_NE(refusal(openBgeo, header(2, -1)).find("-1 attributes"), std::string::npos);
  EXPECT_NE(refusal(openBgeo, header(2'000'000'000, 0)).find("expected 2000000000"),
            std::string::npos);
  const auto attribute = [](std::uint16_t values, std::int32_t type, const std::string& rest) {
    return header(0, 1) + name16("a") + be(values) + be(type) + rest;
  };
  EXPECT_NE(refusal(openBgeo, attribute(0, 0, "")).find("has 0 values"), std::string::npos);
  EXPECT_NE(refusal(openBgeo, attribute(1, 3, "1234")).find("type 3"), std::string::npos);
  EXPECT_NE(refusal(openBgeo, attribute(1, 2, "1234")).find("strings (type 2)"), std::string::npos);
  EXPECT_NE(refusal(openBgeo, attribute(1, 4, be(-1))).find("-1 strings"), std::string::npos);
  EXPECT_NE(refusal(openBgeo, attribute(1, 4, be(2'000'000'000))).find("2000000000 strings"),
            std::string::npos);
  EXPECT_NE(refusal(openBgeo, attribute(65535, 0, "1234")).find("has 65535 values"),
            std::string::npos);
}

TEST_F(BgeoTest, EveryTruncationOfClassicFilesIsRefused) {
  expectEveryTruncationFails(openBgeo, classic(), classic().size());
  expectDamageIsHarmless(openBgeo, classic());
}

TEST_F(BgeoTest, WrittenFilesAreReadBack) {
  RowWriterOptions options;
  for (const char* name :
       {"x",           "y",          "z",          "nx",        "ny",          "nz",
        "radius",      "red",        "green",      "blue",      "radiosity_r", "radiosity_g",
        "radiosity_b", "foo_x",      "foo_y",      "foo_z",     "bar_r",       "bar_g",
        "bar_b",       "velocity_x", "velocity_y", "velocity_z"}) {
    options.properties.push_back(rowProperty(name));
  }
  options.properties.push_back(rowProperty("id", ValueType::kInt32));
  for (const char* file : {"b.bgeo", "b.bgeo.gz", "b.bgeo.zst"}) {
    Result<std::unique_ptr<RowWriter>> writer = createBgeo(path(file), options);
    ASSERT_TRUE(writer.ok()) << writer.status().message();
    EXPECT_TRUE((*writer)->notes().empty());
    const std::vector<std::byte> rows = randomRows((*writer)->element(), 10'000);
    writeAll(**writer, rows);
    const auto reader = openOk(openBgeo, path(file));
    ASSERT_NE(reader, nullptr);
    EXPECT_EQ(describeRow(reader->element()), describeRow((*writer)->element()));
    EXPECT_TRUE(readAllRows(*reader) == rows) << file;
  }
}

TEST_F(BgeoTest, PositionComesFirstWhereverRowsHaveIt) {
  RowWriterOptions options;
  options.properties = {rowProperty("radius", ValueType::kFloat64), rowProperty("x"),
                        rowProperty("y"), rowProperty("z"),
                        rowProperty("count", ValueType::kUint8)};
  Result<std::unique_ptr<RowWriter>> writer = createBgeo(path("b.bgeo"), options);
  ASSERT_TRUE(writer.ok()) << writer.status().message();
  EXPECT_EQ((*writer)->notes().size(), 1u);
  const std::vector<std::byte> rows = randomRows((*writer)->element(), 100);
  writeAll(**writer, rows);
  const auto reader = openOk(openBgeo, path("b.bgeo"));
  ASSERT_NE(reader, nullptr);
  EXPECT_EQ(describeRow(reader->element()), "float x, float y, float z, float radius, int count");
  const std::vector<std::byte> read = readAllRows(*reader);
  for (std::size_t i = 0; i < 100; ++i) {
    const std::byte* row = &rows[i * (*writer)->element().row_bytes];
    EXPECT_EQ(valueOf(*reader, read, i, "radius"), rowValue(row, ValueType::kFloat64));
    EXPECT_EQ(valueOf(*reader, read, i, "count"), rowValue(row + 20, ValueType::kUint8));
  }
}

TEST_F(BgeoTest, WriterNeedsAPosition) {
  RowWriterOptions options;
  options.properties = {rowProperty("radius")};
  EXPECT_EQ(createBgeo(path("b.bgeo"), options).status().code(), StatusCode::kInvalidArgument);
  EXPECT_EQ(fileCount(), 0);
}

TEST_F(BgeoTest, ReadsTheClassicSamples) {
  SURFEIT_SKIP_WITHOUT_PARTICLES();
  const std::string directory = kParticleDirectory;
  const auto lion = openOk(openBgeo, directory + "/lion_20k.bgeo");
  const auto packed = openOk(openBgeo, directory + "/lion_20k.bgeo.gz");
  ASSERT_TRUE(lion && packed);
  EXPECT_EQ(lion->element().count, 20'000u);
  const std::vector<std::byte> rows = readAllRows(*lion);
  EXPECT_TRUE(readAllRows(*packed) == rows);
  EXPECT_NEAR(valueOf(*lion, rows, 0, "x"), -2.231, 1e-3);
  EXPECT_EQ(valueOf(*lion, rows, 19'999, "id"), 19'999);
  EXPECT_TRUE(lion->isSeekable());
  EXPECT_FALSE(packed->isSeekable());

  const auto scatter = openOk(openBgeo, directory + "/partio/scatter.bgeo");
  ASSERT_NE(scatter, nullptr);
  EXPECT_EQ(describeRow(scatter->element()),
            "float x, float y, float z, int id, float red, float green, float blue, int test");
  for (const char* name : {"base", "delta", "json", "scatter", "test"}) {
    const auto reader = openOk(openBgeo, directory + "/partio/" + name + ".bgeo");
    ASSERT_NE(reader, nullptr) << name;
    expectReaderKeepsContract(*reader);
  }
}

// --- Text ---

std::string geo(
    const std::string& points = "0 0.1 0.2 1 (-1.2 10\t0)\n0.1 0.2 0.3 1 (-0.2 10\t1)\n",
    const std::string& count = "2") {
  return "PGEOMETRY V5\nNPoints " + count +
         " NPrims 1\nNPointGroups 0 NPrimGroups 0\nNPointAttrib 2 NVertexAttrib 0 NPrimAttrib 1 "
         "NAttrib 0\nPointAttrib\n\nlife 2 float 0 0\nid 1 int 0\n" +
         points;
}

TEST_F(BgeoTest, ReadsTextPoints) {
  write("a.geo", geo() + "PrimitiveAttrib\ngenerator 1 index 1 papi\n");
  const auto reader = openOk(openBgeoAscii, path("a.geo"));
  ASSERT_NE(reader, nullptr);
  EXPECT_EQ(describeRow(reader->element()),
            "float x, float y, float z, float life_0, float life_1, int id");
  const std::vector<std::byte> rows = readAllRows(*reader);
  EXPECT_FLOAT_EQ(float(valueOf(*reader, rows, 1, "life_0")), -0.2f);
  EXPECT_EQ(valueOf(*reader, rows, 1, "id"), 1);
  ASSERT_TRUE(reader->rewind().ok());
  expectReaderKeepsContract(*reader);
}

TEST_F(BgeoTest, ReadsTextThatIsLongerThanTheBuffer) {
  std::string points;
  for (int i = 0; i < 30'000; ++i) {
    points += std::to_string(i) + " 2 3 1 (4 5 " + std::to_string(i) + ")\n";
  }
  write("a.geo", geo(points, "30000"));
  const auto reader = openOk(openBgeoAscii, path("a.geo"));
  ASSERT_NE(reader, nullptr);
  const std::vector<std::byte> rows = readAllRows(*reader);
  for (const std::size_t i : {std::size_t{0}, std::size_t{12'345}, std::size_t{29'999}}) {
    EXPECT_EQ(valueOf(*reader, rows, i, "x"), double(i));
    EXPECT_EQ(valueOf(*reader, rows, i, "id"), double(i));
  }
}

TEST_F(BgeoTest, RefusesDamagedText) {
  EXPECT_NE(refusal(openBgeoAscii, geo("1 2 3 1 (4 5 6\n1 2 3 1 (4 5 6)")).find("expected ')'"),
            std::string::npos);
  EXPECT_NE(refusal(openBgeoAscii, geo("1 2 3 1 (4 x 6)1 2 3 1 (4 5 6)")).find("found 'x'"),
            std::string::npos);
  EXPECT_NE(refusal(openBgeoAscii, geo("1 2 3 1 (4 5 6)")).find("row"), std::string::npos);
  EXPECT_NE(refusal(openBgeoAscii, geo("1 2 3 1 (4 5 6)", "4000000000")).find("hold at most"),
            std::string::npos);
  EXPECT_NE(refusal(openBgeoAscii, geo("", "-3")).find("NPoints"), std::string::npos);
  expectEveryTruncationFails(openBgeoAscii, geo(), geo().size() - 1);
}

TEST_F(BgeoTest, ReadsTheTextSamples) {
  SURFEIT_SKIP_WITHOUT_PARTICLES();
  const std::string directory = kParticleDirectory;
  const auto cloud = openOk(openBgeoAscii, directory + "/osl_cloud.geo");
  ASSERT_NE(cloud, nullptr);
  EXPECT_EQ(cloud->element().count, 16u);
  expectReaderKeepsContract(*cloud);

  // The same points as text and as bytes
  const auto text = openOk(openBgeoAscii, directory + "/partio/test.geo");
  const auto bytes = openOk(openBgeo, directory + "/partio/test.bgeo");
  ASSERT_TRUE(text && bytes);
  EXPECT_TRUE(readAllRows(*text) == readAllRows(*bytes));
}

// --- Binary JSON, as Houdini writes it ---

using Json = BgeoJsonBytes;

// Positions i, i + 0.25, i + 0.5 of `points` points.
std::vector<float> positions(int points) {
  std::vector<float> values;
  for (int i = 0; i < points; ++i) {
    values.insert(values.end(), {float(i), float(i) + 0.25f, float(i) + 0.5f});
  }
  return values;
}

TEST_F(BgeoTest, ReadsPagesOfJson) {
  for (const bool is_big_endian : {false, true}) {
    const Json json{is_big_endian};
    write("a.bgeo",
          json.geometry(
              100, json.attribute("P", "numeric",
                                  json.values(3, "fpreal32",
                                              json.paged(32, json.text("rawpagedata") +
                                                                 json.floats(positions(100)))))));
    const auto reader = openOk(openBgeoJson, path("a.bgeo"));
    ASSERT_NE(reader, nullptr);
    EXPECT_EQ(describeRow(reader->element()), "float x, float y, float z");
    const std::vector<std::byte> rows = readAllRows(*reader);
    EXPECT_EQ(valueOf(*reader, rows, 99, "z"), 99.5);
    ASSERT_TRUE(reader->rewind().ok());
    expectReaderKeepsContract(*reader);
  }
}

// Pages of 16 points, x by itself and y z together: x is constant in page 0 and 2, y z in page 1.
std::string slicedValues(const Json& json) {
  std::vector<float> raw;
  const auto x = [&](int i) { raw.push_back(float(i)); };
  const auto yz = [&](int i) { raw.insert(raw.end(), {100.0f + float(i), 200.0f + float(i)}); };
  x(0);
  for (int i = 0; i < 16; ++i) yz(i);
  for (int i = 16; i < 32; ++i) x(i);
  yz(16);
  x(32);
  for (int i = 32; i < 40; ++i) yz(i);
  return json.values(3, "fpreal32",
                     json.text("packing") + json.integers({1, 2}) +
                         json.paged(16, json.text("constantpageflags") +
                                            json.list(json.bools({true, false, true}),
                                                      json.list("\x30", "\x31", "\x30")) +
                                            json.text("rawpagedata") + json.floats(raw)));
}

TEST_F(BgeoTest, ReadsSlicesAndConstantPagesOfJson) {
  const Json json;
  write("a.bgeo", json.geometry(40, json.attribute("P", "numeric", slicedValues(json))));
  const auto reader = openOk(openBgeoJson, path("a.bgeo"));
  ASSERT_NE(reader, nullptr);
  const std::vector<std::byte> rows = readAllRows(*reader);
  for (int i = 0; i < 40; ++i) {
    const auto row = std::size_t(i);
    EXPECT_EQ(valueOf(*reader, rows, row, "x"), i < 16 ? 0 : i < 32 ? i : 32);
    EXPECT_EQ(valueOf(*reader, rows, row, "y"), 100 + (i >= 16 && i < 32 ? 16 : i));
    EXPECT_EQ(valueOf(*reader, rows, row, "z"), 200 + (i >= 16 && i < 32 ? 16 : i));
  }
  ASSERT_TRUE(reader->rewind().ok());
  expectReaderKeepsContract(*reader);
}

std::string mixedGeometry(const Json& json) {
  // Tuples, arrays, strings by index, plain numbers, a dropped kind, a defined text
  std::string tuples, ids;
  for (int i = 0; i < 5; ++i) {
    tuples += i % 2 == 0 ? json.floats({float(i), 1, 2})
                         : json.list("\x11" + std::string(1, char(i)), "\x19" + json.raw(1.0f),
                                     "\x1A" + json.raw(2.0));
    ids += json.integer(70 + i);
  }
  return json.geometry(
      5, std::string("\x2B\x05\x06pscale", 9) +
             json.attribute("P", "numeric",
                            json.values(3, "fpreal32", json.text("tuples") + "[" + tuples + "]")) +
             json.attribute("id", "numeric",
                            json.values(1, "int32", json.text("arrays") + "[[" + ids + "]]")) +
             json.list(json.list(json.text("name"), std::string("\x26\x05"), json.text("type"),
                                 json.text("numeric")),
                       json.list(json.text("values"),
                                 json.values(1, "fpreal32",
                                             json.text("arrays") +
                                                 json.list(json.floats({1, 2, 3, 4, 5}))))) +
             json.attribute(
                 "kind", "string",
                 json.values(1, "int32",
                             json.text("arrays") + json.list(json.integers({0, 1, 0, 1, -1})))) +
             json.attribute("settings", "dict", json.list(std::string())));
}

TEST_F(BgeoTest, ReadsTuplesArraysAndStringsOfJson) {
  write("a.bgeo", mixedGeometry(Json{}));
  const auto reader = openOk(openBgeoJson, path("a.bgeo"));
  ASSERT_NE(reader, nullptr);
  EXPECT_EQ(describeRow(reader->element()),
            "float x, float y, float z, int id, float radius, int kind");
  EXPECT_EQ(reader->notes().size(), 2u);
  const std::vector<std::byte> rows = readAllRows(*reader);
  EXPECT_EQ(valueOf(*reader, rows, 3, "x"), 3);
  EXPECT_EQ(valueOf(*reader, rows, 4, "z"), 2);
  EXPECT_EQ(valueOf(*reader, rows, 4, "id"), 74);
  EXPECT_EQ(valueOf(*reader, rows, 4, "radius"), 5);
  EXPECT_EQ(valueOf(*reader, rows, 4, "kind"), -1);
  ASSERT_TRUE(reader->rewind().ok());
  expectReaderKeepsContract(*reader);
}

TEST_F(BgeoTest, RefusesJsonThatDoesNotFit) {
  const Json json;
  const auto position = [&](int points, int count, const std::string& more = "") {
    return json.geometry(
        points, json.attribute("P", "numeric",
                               json.values(3, "fpreal32",
                                           json.paged(32, more + json.text("rawpagedata") +
                                                              json.floats(positions(count))))));
  };
  EXPECT_NE(refusal(openBgeoJson, position(100, 99)).find("297 values, expected 300"),
            std::string::npos);
  EXPECT_NE(refusal(openBgeoJson, position(99, 100)).find("expected 297"), std::string::npos);
  EXPECT_NE(refusal(openBgeoJson, position(-1, 100)).find("0 or more"), std::string::npos);
  EXPECT_NE(refusal(openBgeoJson, position(2'000'000'000, 100)).find("300 values"),
            std::string::npos);
  EXPECT_NE(refusal(openBgeoJson, position(100, 100, json.text("pagesize") + json.integer(0)))
                .find("pages of 0"),
            std::string::npos);
  EXPECT_NE(refusal(openBgeoJson, position(100, 100, json.text("packing") + json.integers({1, 1})))
                .find("2 components"),
            std::string::npos);
  EXPECT_NE(refusal(openBgeoJson,
                    position(100, 100,
                             json.text("constantpageflags") + json.list(json.bools({true, true}))))
                .find("flags of 4 pages"),
            std::string::npos);
  EXPECT_NE(refusal(openBgeoJson, json.geometry(1, "")).find("no point attributes"),
            std::string::npos);
  // An array that claims to be endless, and lengths that wrap
  EXPECT_NE(refusal(openBgeoJson, "\x7FNSJb[" + json.text("a") + "@\x19\xF8" +
                                      littleEndian(std::int64_t{1} << 62))
                .find("array of"),
            std::string::npos);
  EXPECT_NE(refusal(openBgeoJson,
                    "\x7FNSJb[" + json.text("a") + "@\x19\xF8" + littleEndian(std::int64_t{-1}))
                .find("length -1"),
            std::string::npos);
  EXPECT_NE(refusal(openBgeoJson, "\x7FNSJb[" + json.text("a") + std::string(100'000, '['))
                .find("ends early"),
            std::string::npos);
}

TEST_F(BgeoTest, EveryTruncationOfJsonIsRefused) {
  const Json json;
  const std::string sliced = json.geometry(40, json.attribute("P", "numeric", slicedValues(json)));
  expectEveryTruncationFails(openBgeoJson, sliced, sliced.size());
  expectDamageIsHarmless(openBgeoJson, sliced, 3);
  // Its values go through a temporary file, which takes milliseconds
  const std::string mixed = mixedGeometry(json);
  expectEveryTruncationFails(openBgeoJson, mixed, mixed.size(), 11);
  expectDamageIsHarmless(openBgeoJson, mixed, 23);
}

}  // namespace
}  // namespace surfeit
