#include "surfeit/convert.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "cloud/edits/row_union.h"
#include "io/convert_tables.h"

namespace surfeit {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

// --- Merging

TEST_F(ConvertTest, MergedCloudsHaveThePropertiesOfAll) {
  Table a = tableOf({{"x", kFloat}, {"y", kFloat}, {"z", kFloat}, {"radius", kFloat}});
  a.rows = {{1, 2, 3, 0.5}};
  Table b = tableOf({{"group", kByte}, {"z", kDouble}, {"y", kDouble}, {"x", kDouble}});
  b.rows = {{7, 30.125, 20, 1e-300}, {8, 31, 21, 11}};
  writeTable("a.ply", a);
  writeTable("b.ply", b);
  const ConvertStats stats = convertOk({"a.ply", "b.ply"}, "both.ply");
  EXPECT_EQ(stats.records, 3u);
  EXPECT_EQ(stats.written_records, 3u);
  EXPECT_THAT(stats.properties,
              ElementsAre("double x", "double y", "double z", "float radius", "uchar group"));
  const Table both = readTable("both.ply");
  EXPECT_THAT(both.rows,
              ElementsAre(ElementsAre(1, 2, 3, 0.5, 0), ElementsAre(1e-300, 20, 30.125, 0, 7),
                          ElementsAre(11, 21, 31, 0, 8)));
  EXPECT_THAT(notes_, ElementsAre(path("a.ply") + ": not there, 0 is written: group",
                                  path("b.ply") + ": not there, 0 is written: radius"));
}

// Names that are numbers, or differ by their case alone.
TEST_F(ConvertTest, OddNamesOfColumnsComeBack) {
  for (const char* file : {"odd.csv", "odd.xyz", "odd.ply"}) {
    for (const std::vector<const char*>& odd :
         {std::vector{"nan", "inf", "Infinity"}, std::vector{"X", "Y", "Z"}}) {
      Table table;
      for (const char* name : odd)
        table.properties.push_back(tableOf({{name, kFloat}}).properties[0]);
      for (const char* name : {"x", "y", "z"}) {
        table.properties.push_back(tableOf({{name, kFloat}}).properties[0]);
      }
      table.rows = {{1, 2, 3, 4, 5, 6}, {.5, .25, .125, 7, 8, 9.5}};
      writeTable(file, table);
      const Table read = readTable(file);
      ASSERT_EQ(read.properties.size(), 6u) << file;
      for (std::size_t i = 0; i < 6; ++i) {
        EXPECT_EQ(read.properties[i].name, table.properties[i].name) << file;
      }
      EXPECT_EQ(read.rows, table.rows) << file;
    }
  }
}

TEST_F(ConvertTest, MergedColorsKeepTheirShade) {
  const auto colors = [](ValueType type) {
    return tableOf({{"x", kFloat},
                    {"y", kFloat},
                    {"z", kFloat},
                    {"red", type},
                    {"green", type},
                    {"blue", type}});
  };
  Table bytes = colors(kByte), words = colors(ValueType::kUint16), floats = colors(kFloat);
  bytes.rows = {{0, 0, 0, 255, 188, 0}};
  words.rows = {{0, 0, 0, 65535, 188 * 257, 1}};
  floats.rows = {{0, 0, 0, 2, 0.5, 0.25}};
  writeTable("bytes.ply", bytes);
  writeTable("words.ply", words);
  writeTable("floats.ply", floats);
  convertOk({"bytes.ply", "words.ply"}, "integers.ply");
  EXPECT_THAT(readTable("integers.ply").rows,
              ElementsAre(ElementsAre(0, 0, 0, 65535, 188 * 257, 0),
                          ElementsAre(0, 0, 0, 65535, 188 * 257, 1)));
  convertOk({"bytes.ply", "floats.ply", "words.ply"}, "linear.ply");
  const Table linear = readTable("linear.ply");
  EXPECT_EQ(typesOf(linear), "float x, float y, float z, float red, float green, float blue");
  EXPECT_THAT(column(linear, "red"), ElementsAre(1, 2, 1));
  EXPECT_NEAR(column(linear, "green")[0], 0.5029, 1e-4);
  EXPECT_EQ(column(linear, "green")[0], column(linear, "green")[2]);
}

TEST_F(ConvertTest, CodesOfLightStayThatLightInEveryFormat) {
  Table table = tableOf({{"x", kFloat},
                         {"y", kFloat},
                         {"z", kFloat},
                         {"radiosity_r", kByte},
                         {"radiosity_g", kByte},
                         {"radiosity_b", kByte},
                         {"albedo_r", ValueType::kUint16},
                         {"albedo_g", ValueType::kUint16},
                         {"albedo_b", ValueType::kUint16}});
  table.rows = {{1, 2, 3, 128, 255, 0, 188 * 257, 65535, 0}};
  writeTable("a.ply", table);
  for (const char* name :
       {"b.ply", "b.ptc", "b.vdb", "b.prt", "b.bgeo", "b.pdb", "b.csv", "b.xyz.gz"}) {
    SCOPED_TRACE(name);
    convertOk({"a.ply"}, name);
    const auto reader = openRowReader(path(name));
    ASSERT_TRUE(reader.ok());
    const std::vector<std::byte> row = readAllRows(**reader);
    const RowLayout& element = (*reader)->element();
    for (const RowChannel& channel : channelsOf(element)) {
      const bool is_radiosity = channel.name == "radiosity";
      if (!is_radiosity && channel.name != "albedo") continue;
      EXPECT_NEAR(channelValue(element, channel, 0, row.data()), is_radiosity ? .21586 : .5029,
                  1e-4);
      EXPECT_NEAR(channelValue(element, channel, 1, row.data()), 1, 1e-6);
      EXPECT_EQ(channelValue(element, channel, 2, row.data()), 0);
    }
    EXPECT_EQ(channelsOf(element).size(), std::string(name) == "b.ptc" ? 4u : 3u);
  }
}

TEST_F(ConvertTest, FormatsMixAndEmptyCloudsAddNothing) {
  writeTable("a.xyz", pointsOf({{1, 2, 3}}));
  writeTable("b.ptc", pointsOf({{4, 5, 6}}));
  writeTable("none.ply", pointsOf({}));
  convertOk({"none.ply", "a.xyz", "none.ply", "b.ptc"}, "all.ply.gz", [] {
    ConvertOptions options;
    options.keep = {"position"};
    return options;
  }());
  EXPECT_THAT(readTable("all.ply.gz").rows,
              ElementsAre(ElementsAre(1, 2, 3), ElementsAre(4, 5, 6)));
}

TEST(RowUnion, WidestTypeHoldsTheValuesOfBoth) {
  for (int a = 0; a < 8; ++a) {
    for (int b = 0; b < 8; ++b) {
      const ValueType wide = widestType(ValueType(a), ValueType(b));
      EXPECT_EQ(wide, widestType(ValueType(b), ValueType(a)));
      for (const int narrow : {a, b}) {
        visitValueType(ValueType(narrow), [&]<typename T>(std::type_identity<T>) {
          for (const T value : {std::numeric_limits<T>::lowest(), std::numeric_limits<T>::max()}) {
            std::byte bytes[8];
            RowProperty property;
            property.type = wide;
            setValue(property, double(value), bytes);
            EXPECT_EQ(rowValue(bytes, wide), double(value)) << a << " " << b;
          }
        });
      }
    }
  }
}

// --- Moving

TEST_F(ConvertTest, LargeCoordinatesKeepTheirPrecision) {
  writeTable("a.ply",
             pointsOf({{637000.25, 851249.75, 417.0625}, {637000.24, 851249.75, 0}}, kDouble));
  ConvertOptions options;
  options.crop = CropBox{{0.25, 0, 0}, {1, 1, 1e9}};
  options.transform = {1, 0, 0, -637000, 0, 1, 0, -851249, 0, 0, 2, 0};
  convertOk({"a.ply"}, "b.ply", options);
  const Table moved = readTable("b.ply");
  EXPECT_EQ(typesOf(moved), "double x, double y, double z");
  EXPECT_THAT(moved.rows, ElementsAre(ElementsAre(0.25, 0.75, 834.125)));
  // Narrowed only by the writer
  convertOk({"a.ply"}, "b.ptc", options);
  EXPECT_THAT(column(readTable("b.ptc"), "x"), ElementsAre(0.25));
}

// Floats stand half a unit apart there.
TEST_F(ConvertTest, FloatsThatAreMovedFarKeepTheirDigits) {
  Table table = tableOf({{"x", kFloat}, {"y", kFloat}, {"z", kFloat}, {"radius", kFloat}});
  for (int i = 0; i < 4; ++i) table.rows.push_back({0.25 * i, 0.125 * i, 0.5, 0.1f});
  writeTable("a.ply", table);
  ConvertOptions options;
  options.transform = {1, 0, 0, 5e5, 0, 1, 0, 5e6, 0, 0, 1, 0};
  for (const char* name : {"b.ply", "b.csv", "b.prt"}) {
    convertOk({"a.ply"}, name, options);
    const Table moved = readTable(name);
    EXPECT_THAT(column(moved, "x"), ElementsAre(500000, 500000.25, 500000.5, 500000.75)) << name;
    EXPECT_THAT(column(moved, "y"), ElementsAre(5000000, 5000000.125, 5000000.25, 5000000.375))
        << name;
    EXPECT_THAT(notes_, Not(Contains(HasSubstr("positions are floats")))) << name;
  }
  // Where there are only floats, what is lost is told, and what is not lost is not
  for (const char* name : {"b.ptc", "b.bgeo", "b.pdb"}) {
    notes_.clear();
    convertOk({"a.ply"}, name, options);
    EXPECT_THAT(notes_, Contains(HasSubstr("positions are floats in this format: they move by")))
        << name;
  }
  options.transform = {1, 0, 0, 2, 0, 1, 0, 0, 0, 0, 1, 0};
  notes_.clear();
  convertOk({"a.ply"}, "b.bgeo", options);
  EXPECT_THAT(notes_, Not(Contains(HasSubstr("positions are floats"))));
  // A turn and a scale cost no digits
  options.transform = {0, 2, 0, 0, -2, 0, 0, 0, 0, 0, 2, 0};
  convertOk({"a.ply"}, "b.ply", options);
  EXPECT_THAT(typesOf(readTable("b.ply")), HasSubstr("float x, float y, float z"));
}

TEST_F(ConvertTest, ChannelsMoveByWhatTheyAre) {
  Table table = tableOf({{"x", ValueType::kInt16},
                         {"y", ValueType::kInt32},
                         {"z", kFloat},
                         {"nx", kFloat},
                         {"ny", kFloat},
                         {"nz", kFloat},
                         {"velocity_x", kFloat},
                         {"velocity_y", kFloat},
                         {"velocity_z", kFloat},
                         {"view_x", kFloat},
                         {"view_y", kFloat},
                         {"view_z", kFloat},
                         {"uv_x", kFloat},
                         {"uv_y", kFloat},
                         {"uv_z", kFloat},
                         {"radius", kFloat},
                         {"area", kDouble},
                         {"occlusion", kFloat}});
  table.rows = {{1, 2, 3, 0.6, 0.8, 0, 1, 1, 1, 3, 0, 4, 9, 9, 9, 0.5, 2, 0.25},
                {1, 2, 3, 0, 0, 0, 0, 0, 0, 0, 0, 0, 9, 9, 9, 1, 1, 1}};
  writeTable("a.ply", table);
  ConvertOptions options;
  options.transform = {-2, 0, 0, 10, 0, 1, 0, 20, 0, 0, 4, 30};  // mirrors; volume 8
  convertOk({"a.ply"}, "b.ply", options);
  const Table moved = readTable("b.ply");
  EXPECT_THAT(typesOf(moved), HasSubstr("double x, double y, double z, "));
  const std::vector<double>& row = moved.rows[0];
  EXPECT_EQ(std::vector<double>(row.begin(), row.begin() + 3), (std::vector<double>{8, 22, 42}));
  // The plane of a normal stays perpendicular to it, its front in front
  const double normal_length = std::hypot(-0.3, 0.8);
  EXPECT_NEAR(row[3], -0.3 / normal_length, 1e-6);
  EXPECT_NEAR(row[4], 0.8 / normal_length, 1e-6);
  EXPECT_EQ(std::vector<double>(row.begin() + 6, row.begin() + 9), (std::vector<double>{-2, 1, 4}));
  EXPECT_NEAR(std::hypot(row[9], row[10], row[11]), 5, 1e-5);
  EXPECT_NEAR(row[9] / row[11], -6.0 / 16, 1e-6);
  EXPECT_EQ(std::vector<double>(row.begin() + 12, row.begin() + 15),
            (std::vector<double>{9, 9, 9}));
  EXPECT_NEAR(row[15], 1, 1e-6);
  EXPECT_NEAR(row[16], 8, 1e-12);
  EXPECT_EQ(row[17], 0.25);
  EXPECT_EQ(std::vector<double>(moved.rows[1].begin() + 3, moved.rows[1].begin() + 12),
            std::vector<double>(9, 0.0));
  EXPECT_THAT(notes_, ElementsAre(HasSubstr("the scale differs by direction")));
}

TEST_F(ConvertTest, RotationsKeepSizesAndTellNothing) {
  Table table = tableOf({{"x", kFloat}, {"y", kFloat}, {"z", kFloat}, {"radius", kFloat}});
  table.rows = {{1, 2, 3, 0.7f}};
  writeTable("a.ply", table);
  ConvertOptions options;
  options.transform = {1, 0, 0, 0, 0, 0, 1, 0, 0, -1, 0, 0};
  convertOk({"a.ply"}, "b.ply", options);
  EXPECT_THAT(readTable("b.ply").rows, ElementsAre(ElementsAre(1, 3, -2, 0.7f)));
  EXPECT_THAT(notes_, IsEmpty());
}

TEST_F(ConvertTest, MapsThatFlattenAreRefused) {
  writeTable("a.ply", pointsOf({{1, 2, 3}}));
  ConvertOptions options;
  options.transform = {1, 0, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0};
  EXPECT_EQ(refusal("a.ply", options).code(), StatusCode::kInvalidArgument);
  options.transform = {1, 2, 3, 0, 4, 5, 6, 0, 7, 8, 9, 0};
  EXPECT_THAT(refusal("a.ply", options).message(), HasSubstr("determinant"));
  options.transform = {1, 0, 0, NAN, 0, 1, 0, 0, 0, 0, 1, 0};
  EXPECT_THAT(refusal("a.ply", options).message(), HasSubstr("expected finite numbers"));
  options.transform = {1e-30, 0, 0, 0, 0, 1e-30, 0, 0, 0, 0, 1e-30, 0};
  convertOk({"a.ply"}, "tiny.ply", options);
  EXPECT_EQ(column(readTable("tiny.ply"), "z")[0], double(3e-30f));
}

// --- Choosing

TEST_F(ConvertTest, EveryNthRecordOfEachInputIsTaken) {
  // More than a batch
  Table table = pointsOf({});
  for (int i = 0; i < 300'000; ++i) table.rows.push_back({double(i), 1, 2});
  writeTable("a.ply", table);
  for (const std::uint64_t every : {2u, 7u, 100'000u, 299'999u, 300'000u, 1'000'000u}) {
    ConvertOptions options;
    options.every = every;
    const ConvertStats stats = convertOk({"a.ply", "a.ply"}, "b.ply", options);
    const std::vector<double> x = column(readTable("b.ply"), "x");
    const std::size_t taken = std::size_t((300'000 + every - 1) / every);
    ASSERT_EQ(x.size(), 2 * taken);
    for (std::size_t i = 0; i < x.size(); ++i) {
      ASSERT_EQ(x[i], double(i % taken * every)) << "every " << every;
    }
    EXPECT_EQ(stats.written_records + stats.skipped_records, 600'000u);
  }
}

TEST_F(ConvertTest, WhatIsTakenStandsForAll) {
  Table table = tableOf({{"x", kFloat},
                         {"y", kFloat},
                         {"z", kFloat},
                         {"radius", kFloat},
                         {"area", kFloat},
                         {"power_r", kFloat},
                         {"power_g", kFloat},
                         {"power_b", kFloat}});
  for (int i = 0; i < 8; ++i) table.rows.push_back({double(i), 1, 2, .5, .25, 1, 2, 3});
  writeTable("a.ply", table);
  ConvertOptions options;
  options.every = 4;
  convertOk({"a.ply"}, "b.ply", options);
  EXPECT_THAT(readTable("b.ply").rows, ElementsAre(ElementsAre(0, 1, 2, 1, 1, 4, 8, 12),
                                                   ElementsAre(4, 1, 2, 1, 1, 4, 8, 12)));
  options.transform = {2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0};
  convertOk({"a.ply"}, "b.ply", options);
  EXPECT_THAT(readTable("b.ply").rows[1], ElementsAre(8, 2, 4, 2, 4, 4, 8, 12));
}

TEST_F(ConvertTest, CropsSideBySideShareNoRecord) {
  Table table = pointsOf({{0.5, 0, 0}, {NAN, 0, 0}, {INFINITY, 0, 0}});
  std::mt19937 random(5);
  for (int i = 0; i < 5000; ++i) table.rows.push_back({double(random() % 100) / 100, 0, 0});
  writeTable("a.ply", table);
  std::uint64_t sum = 0;
  for (const double begin : {0.0, 0.5}) {
    ConvertOptions options;
    options.crop = CropBox{{begin, -1, -1}, {begin + 0.5, 1, 1}};
    const ConvertStats stats = convertOk({"a.ply"}, "b.ply", options);
    EXPECT_EQ(stats.cropped_records + stats.written_records, 5003u);
    sum += stats.written_records;
    for (const double x : column(readTable("b.ply"), "x")) {
      EXPECT_TRUE(x >= begin && x < begin + 0.5) << x;
    }
  }
  EXPECT_EQ(sum, 5001u);
}

TEST_F(ConvertTest, ChannelsAreNamedKeptAndDropped) {
  writeTable("a.ply", fullTable());
  ConvertOptions options;
  options.channels = "occlusion=shadow,radius=-";
  options.keep = {"shadow", "radiosity", "nz"};
  EXPECT_THAT(convertOk({"a.ply"}, "b.ply", options).properties,
              ElementsAre("float x", "float y", "float z", "float nz", "float radiosity_r",
                          "float radiosity_g", "float radiosity_b", "float shadow"));
  EXPECT_EQ(column(readTable("b.ply"), "shadow"), column(readTable("a.ply"), "occlusion"));
  options.keep = {};
  options.drop = {"position"};
  EXPECT_THAT(typesOf((convertOk({"a.ply"}, "b.ply", options), readTable("b.ply"))),
              testing::StartsWith("float nx, "));
  options.drop = {"radius"};
  EXPECT_THAT(refusal("a.ply", options).message(),
              HasSubstr("drop: found no channel 'radius', expected one of position normal area"));
  options.keep = {"area"};
  EXPECT_EQ(refusal("a.ply", options).code(), StatusCode::kInvalidArgument);
}

// --- Failures

TEST_F(ConvertTest, OptionsThatCannotWorkAreRefused) {
  writeTable("a.ply", pointsOf({{1, 2, 3}}));
  Table bare = tableOf({{"radius", kFloat}});
  bare.rows = {{1}};
  writeTable("bare.ply", bare);
  ConvertOptions options;
  EXPECT_THAT(refusal("a.ply", options, "a.jpg").message(), HasSubstr("expected a name"));
  options.every = 0;
  EXPECT_EQ(refusal("a.ply", options).code(), StatusCode::kInvalidArgument);
  options.every = 1;
  options.crop = CropBox{{0, 0, 0}, {1, 0, 1}};
  EXPECT_THAT(refusal("a.ply", options).message(), HasSubstr("crop: found 0 to 0 along y"));
  options.crop = CropBox{{0, 0, 0}, {1, 1, 1}};
  EXPECT_THAT(refusal("bare.ply", options).message(), HasSubstr("found no property x"));
  options = {};
  options.channels = "x";
  EXPECT_EQ(refusal("a.ply", options).code(), StatusCode::kInvalidArgument);
  TestProgress progress;
  EXPECT_EQ(convertClouds({}, path("b.ply"), {}, progress).status().code(),
            StatusCode::kInvalidArgument);
}

TEST_F(ConvertTest, DamageLeavesTheOldFile) {
  Table table = pointsOf({});
  for (int i = 0; i < 1000; ++i) table.rows.push_back({double(i), 1, 2});
  writeTable("a.ply.gz", table);
  writeTable("old.ply", pointsOf({{1, 2, 3}}));
  const std::string old = contents("old.ply");
  std::string packed = contents("a.ply.gz");
  packed.resize(packed.size() / 2);
  write("cut.ply.gz", packed);
  TestProgress progress;
  const Status status =
      convertClouds({path("old.ply"), path("cut.ply.gz")}, path("old.ply"), {}, progress).status();
  EXPECT_EQ(status.code(), StatusCode::kCorruption);
  EXPECT_THAT(status.message(), HasSubstr("cut.ply.gz"));
  EXPECT_TRUE(contents("old.ply") == old);
  EXPECT_EQ(fileCount(), 3);
  // It may be replaced by what is made of it
  convertOk({"old.ply", "old.ply"}, "old.ply");
  EXPECT_EQ(readTable("old.ply").rows.size(), 2u);
}

TEST_F(ConvertTest, CancellingLeavesNothing) {
  Table table = pointsOf({});
  for (int i = 0; i < 300'000; ++i) table.rows.push_back({double(i), 1, 2});
  writeTable("a.ply", table);
  for (const char* name : {"b.ply", "b.ptc.gz", "b.vdb", "b.pdb", "b.csv"}) {
    for (const std::uint64_t most : {0u, 1u, 100'000u}) {
      TestProgress progress(most);
      const Status status = convertClouds({path("a.ply")}, path(name), {}, progress).status();
      EXPECT_EQ(status.code(), StatusCode::kInterrupted) << name;
      EXPECT_EQ(fileCount(), 1) << name;
    }
  }
}

TEST_F(ConvertTest, CancellingWhileTheFileIsCompletedLeavesNothing) {
  class CancelInFinish : public Progress {
   public:
    void beginPhase(std::string_view name, std::uint64_t, std::string_view) override {
      is_finishing_ = name == "finish";
    }
    bool isCancelled() const override { return is_finishing_; }

   private:
    bool is_finishing_ = false;
  };
  Table table = pointsOf({});
  for (int i = 0; i < 30'000; ++i) table.rows.push_back({double(i), 1, 2});
  writeTable("a.ply", table);
  for (const char* name : {"b.ply.gz", "b.ptc.zst", "b.xyz.gz", "b.vdb", "b.pdb"}) {
    CancelInFinish progress;
    const Status status = convertClouds({path("a.ply")}, path(name), {}, progress).status();
    EXPECT_EQ(status.code(), StatusCode::kInterrupted) << name;
    EXPECT_EQ(fileCount(), 1) << name;
  }
}

}  // namespace
}  // namespace surfeit
