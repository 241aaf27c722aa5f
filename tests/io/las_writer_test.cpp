#include "cloud/scans/las_writer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include "io/compressed_files.h"
#include "io/convert_tables.h"
#include "io/las_test_file.h"

namespace surfeit {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

class LasWriterTest : public ConvertTest {};

// --- From LAS to LAS

TEST_F(LasWriterTest, PointsOfEveryFormatStayTheSameBytes) {
  for (unsigned format = 0; format <= 10; ++format) {
    for (const std::size_t extra : {0, 6}) {
      SCOPED_TRACE(std::to_string(format) + " " + std::to_string(extra));
      std::string text = makeLas(format <= 3 ? 2 : format <= 5 ? 3 : 4, format, 90, extra);
      for (std::size_t i = 0; i < 90; ++i) fillPoint(text, i);
      if (extra > 0) {
        text = withRecords(text, {lasRecord("LASF_Spec", 4, lasDescriptor("Deviation", 4, 8, 0.25)),
                                  lasRecord("LASF_Projection", 2112, "PROJCS[1]"),
                                  lasRecord("me", 9, std::string(5000, 'm'))});
      }
      write("a.las", text);
      convertOk({"a.las"}, "b.las", all());
      const std::string copy = contents("b.las");
      EXPECT_EQ(std::uint8_t(copy[104]), format);
      EXPECT_EQ(copy[25], text[25]);
      EXPECT_TRUE(lasPoints(copy, 90) == lasPoints(text, 90));
      EXPECT_EQ(lasSummaryOf(copy).count, 90u);
      EXPECT_EQ(copy.substr(131, 48), text.substr(131, 48));
      if (extra > 0) {
        EXPECT_EQ(lasRecordOf(copy, "LASF_Projection", 2112), "PROJCS[1]");
        EXPECT_EQ(lasRecordOf(copy, "me", 9), std::string(5000, 'm'));
        EXPECT_EQ(lasRecordOf(copy, "LASF_Spec", 4).substr(0, 192),
                  lasDescriptor("Deviation", 4, 8, 0.25));
      }
      // Once more, it is the same file
      convertOk({"b.las"}, "c.las", all());
      EXPECT_TRUE(contents("c.las") == copy);
    }
  }
}

TEST_F(LasWriterTest, HeadersCountAndBoundWhatIsWritten) {
  std::string text = makeLas(4, 7, 100);
  for (std::size_t i = 0; i < 100; ++i) fillPoint(text, i);
  write("a.las", text);
  ConvertOptions options;
  options.filter = "return_number <= 2";
  convertOk({"a.las"}, "b.las", options);
  const std::string las = contents("b.las");
  const LasSummary summary = lasSummaryOf(las);
  EXPECT_EQ(summary.count, 14u);  // of 15 numbers in turn
  EXPECT_EQ(getLas<std::uint64_t>(las, 255), 7u);
  EXPECT_EQ(getLas<std::uint64_t>(las, 263), 7u);
  EXPECT_EQ(getLas<std::uint64_t>(las, 271), 0u);
  EXPECT_EQ(getLas<std::uint32_t>(las, 107), 0u);  // formats from 6 on have no older counts
  EXPECT_EQ(summary.least[0], 1e6);
  EXPECT_DOUBLE_EQ(summary.most[0], 1e6 + 0.91);
  EXPECT_DOUBLE_EQ(summary.least[1], 2e6 - 1.82);
  EXPECT_EQ(summary.most[1], 2e6);

  text = makeLas(4, 1, 9);
  for (std::size_t i = 0; i < 9; ++i) fillPoint(text, i);
  write("a.las", text);
  convertOk({"a.las"}, "b.las", all());
  EXPECT_EQ(getLas<std::uint32_t>(contents("b.las"), 107), 9u);
  EXPECT_EQ(getLas<std::uint32_t>(contents("b.las"), 111), 2u);
  EXPECT_EQ(getLas<std::uint64_t>(contents("b.las"), 255), 2u);
}

TEST_F(LasWriterTest, RecordsBehindThePointsAreCopied) {
  std::string text = makeLas(4, 6, 40);
  putLas(text, 227, std::uint64_t(text.size() + 60 + 300));
  putLas(text, 235, std::uint64_t(text.size()));
  putLas(text, 243, std::uint32_t(2));
  const std::string records =
      lasRecord("LASF_Projection", 2112, "GEOGCS[" + std::string(292, 'x') + "]", true) +
      lasRecord("LASF_Spec", 65535, std::string(700'000, 'w'), true);
  write("a.las", text + records);
  ConvertOptions options = all();
  options.every = 2;
  convertOk({"a.las"}, "b.las", options);
  const std::string las = contents("b.las");
  EXPECT_EQ(getLas<std::uint64_t>(las, 247), 20u);
  const std::size_t end = getLas<std::uint32_t>(las, 96) + 20 * 30;
  EXPECT_EQ(getLas<std::uint64_t>(las, 235), end);
  EXPECT_EQ(getLas<std::uint64_t>(las, 227), end + 360);
  EXPECT_EQ(getLas<std::uint32_t>(las, 243), 2u);
  EXPECT_TRUE(las.substr(end) == records);
}

TEST_F(LasWriterTest, OldHeadersBecomeVersion12) {
  std::string text = makeLas(0, 1, 4);
  putLas(text, 4, std::uint32_t(0xABCDEF));  // reserved then, the encoding now
  write("a.las", text);
  convertOk({"a.las"}, "b.las", all());
  EXPECT_EQ(contents("b.las")[25], 2);
  EXPECT_EQ(getLas<std::uint32_t>(contents("b.las"), 4), 0u);
  EXPECT_TRUE(lasPoints(contents("b.las"), 4) == lasPoints(text, 4));
}

TEST_F(LasWriterTest, ResultsAreExtraBytesOfTheSamePoints) {
  std::string text = makeLas(2, 3, 50);
  for (std::size_t i = 0; i < 50; ++i) fillPoint(text, i);
  write("a.las", text);
  const auto like = openRowReader(path("a.las"), [] {
    RowReaderOptions options;
    options.filter = "true";
    return options;
  }());
  ASSERT_TRUE(like.ok());
  RowWriterOptions options;
  options.properties = (*like)->element().properties;
  for (const char* name : {"occlusion", "irradiance_r", "irradiance_g", "irradiance_b"}) {
    options.properties.push_back(rowProperty(name));
  }
  options.properties.push_back(rowProperty("two_sided", kByte));
  options.properties.push_back(rowProperty("weight", kDouble));
  options.like = like->get();
  const auto writer = createRowWriter(path("b.las"), options);
  ASSERT_TRUE(writer.ok()) << writer.status().message();
  EXPECT_THAT((*writer)->notes(), IsEmpty());
  const std::vector<std::byte> rows = readAllRows(**like);
  const std::size_t bytes = (*like)->element().row_bytes;
  std::vector<std::byte> row((*writer)->element().row_bytes);
  for (std::size_t i = 0; i < 50; ++i) {
    for (const RowProperty& property : (*writer)->element().properties) {
      const RowProperty* const from = (*like)->element().find(property.name);
      setValue(property,
               from != nullptr ? rowValue(&rows[i * bytes + from->offset], from->type)
                               : double(i) + property.name.size() / 16.0,
               row.data());
    }
    ASSERT_TRUE((*writer)->writeRows(row).ok());
  }
  ASSERT_TRUE((*writer)->finish().ok());

  // 34 bytes as they were, then 4 floats, a byte and a double
  const std::string las = contents("b.las");
  ASSERT_EQ(getLas<std::uint16_t>(las, 105), 34 + 16 + 1 + 8);
  const std::string described = lasRecordOf(las, "LASF_Spec", 4);
  ASSERT_EQ(described.size(), 6 * 192u);
  const int types[] = {9, 9, 9, 9, 1, 10};
  for (std::size_t i = 0; i < 6; ++i) {
    EXPECT_EQ(described[192 * i + 2], types[i]);
    EXPECT_EQ(std::string(&described[192 * i + 4]),
              options.properties[options.properties.size() - 6 + i].name);
  }
  for (std::size_t i = 0; i < 50; ++i) {
    EXPECT_EQ(lasPoint(las, i).substr(0, 34), lasPoint(text, i));
    EXPECT_EQ(getLas<float>(lasPoint(las, i), 34), float(i) + 9 / 16.0f);
    EXPECT_EQ(getLas<double>(lasPoint(las, i), 51), double(i) + 6 / 16.0);
  }
  convertOk({"b.las"}, "c.ply", all());
  EXPECT_EQ(column(readTable("c.ply"), "irradiance_b")[49], 49.75);
}

TEST_F(LasWriterTest, DroppedAndMovedPointsAreNoCopies) {
  std::string text = makeLas(2, 3, 5, 4);
  for (std::size_t i = 0; i < 5; ++i) fillPoint(text, i);
  write("a.las", withRecords(text, {lasRecord("LASF_Spec", 4, lasDescriptor("h", 9))}));
  ConvertOptions options = all();
  options.drop = {"h", "intensity"};
  convertOk({"a.las"}, "b.las", options);
  EXPECT_EQ(getLas<std::uint16_t>(contents("b.las"), 105), 34);
  EXPECT_EQ(getLas<std::uint16_t>(lasPoint(contents("b.las"), 2), 12), 0);
  EXPECT_EQ(lasPoint(contents("b.las"), 2).substr(14), lasPoint(text, 2).substr(14, 20));

  // Moved by more than 32 bits hold: of a scale and an offset of its own
  options.transform[3] = 1e9;
  convertOk({"a.las"}, "c.las", options);
  EXPECT_NEAR(column(readTable("c.las"), "x")[4], 1e9 + 1e6 + 0.04, 1e-6);
  options.like = path("a.las");
  EXPECT_THAT(
      refusal("a.las", options, "d.las").message(),
      AllOf(HasSubstr("row 0: x is 1001000000"), HasSubstr("scale 0.01 and offset 1000000")));
}

// --- From other formats

TEST_F(LasWriterTest, OtherCloudsBecomeVersion14WithExtraBytes) {
  Table table = tableOf({{"x", kDouble},
                         {"y", kDouble},
                         {"z", kDouble},
                         {"nx", kFloat},
                         {"ny", kFloat},
                         {"nz", kFloat},
                         {"red", kByte},
                         {"green", kByte},
                         {"blue", kByte},
                         {"radius", kFloat},
                         {"classification", kByte}});
  for (int i = 0; i < 100; ++i) {
    table.rows.push_back({412345.678 + i, 5456789.012 + i % 10, 210.5, 0, 0.5, -1, double(i), 188,
                          255, 0.25, double(i % 6)});
  }
  writeTable("a.ply", table);
  convertOk({"a.ply"}, "b.las");
  const std::string las = contents("b.las");
  const LasSummary summary = lasSummaryOf(las);
  EXPECT_EQ(summary.minor, 4u);
  EXPECT_EQ(summary.format, 7u);
  EXPECT_EQ(summary.scale, 1e-4);
  EXPECT_DOUBLE_EQ(summary.least[0], 412345.678);
  EXPECT_DOUBLE_EQ(summary.most[0], 412444.678);
  const std::string point = lasPoint(las, 99);
  EXPECT_EQ(getLas<std::uint16_t>(point, 30), 99 * 257);
  EXPECT_EQ(getLas<std::uint16_t>(point, 34), 65535);
  EXPECT_EQ(point[14], char(1 | 1 << 4));
  EXPECT_EQ(point[16], 3);
  EXPECT_EQ(getLas<float>(point, 36 + 8), -1);
  EXPECT_EQ(std::string(&lasRecordOf(las, "LASF_Spec", 4)[4]), "NormalX");
  EXPECT_EQ(getLas<std::uint64_t>(las, 255), 100u);
  EXPECT_THAT(notes_,
              AllOf(Contains(HasSubstr("LAS has no place for comments: 1 are not kept")),
                    Contains(HasSubstr("return 1 of 1")), Not(Contains(HasSubstr("move")))));
  convertOk({"b.las"}, "c.ply");
  for (const char* name : {"x", "y", "z"}) {
    const std::vector<double> before = column(table, name),
                              after = column(readTable("c.ply"), name);
    for (std::size_t i = 0; i < before.size(); ++i)
      EXPECT_NEAR(after[i], before[i], 1e-9 * before[i]);
  }
  EXPECT_EQ(column(readTable("c.ply"), "nz"), column(table, "nz"));
}

TEST_F(LasWriterTest, ScalesKeepTheDigitsOfSmallAndLargeClouds) {
  for (const auto& [size, is_float] : std::vector<std::pair<double, bool>>{
           {1e-3, true}, {0.15, true}, {30, true}, {5e5, true}, {1e-3, false}, {3e6, false}}) {
    for (const double place : {0.0, is_float ? 0.0 : 1e7}) {
      SCOPED_TRACE(std::to_string(size) + " at " + std::to_string(place));
      Table table = pointsOf({}, is_float ? kFloat : kDouble);
      for (int i = 0; i < 1000; ++i) {
        table.rows.push_back(
            {place + size * std::sin(i), place - size * std::cos(i), size * i / 1000});
      }
      writeTable("a.ply", table);
      convertOk({"a.ply"}, "b.las");
      const Table before = readTable("a.ply"), after = readTable("b.las");
      double largest = 0;
      for (std::size_t i = 0; i < 1000; ++i) {
        for (std::size_t axis = 0; axis < 3; ++axis) {
          largest = std::max(largest, std::abs(before.rows[i][axis] - after.rows[i][axis]));
        }
      }
      // Far less than what lies between points: about a thirtieth of the size
      EXPECT_LE(largest, 1e-4 * size);
      if (place == 0) {  // elsewhere doubles themselves are no finer
        EXPECT_THAT(notes_,
                    Contains(AllOf(HasSubstr("points move by up to"), HasSubstr("spacing"))));
      }
      const double scale = getLas<double>(contents("b.las"), 131);
      EXPECT_NEAR(std::log10(scale), std::round(std::log10(scale)), 1e-9);
    }
  }
}

// What a color is follows from the input, where that is not LAS.
TEST_F(LasWriterTest, ColorsTo255InFloatsAreTheSameShades) {
  Table table = tableOf({{"x", kFloat},
                         {"y", kFloat},
                         {"z", kFloat},
                         {"red", kFloat},
                         {"green", kFloat},
                         {"blue", kFloat}});
  table.rows = {{0, 0, 0, 200, 0, 17}, {1, 1, 1, 255, 90, 3}};
  writeTable("a.ply", table);
  convertOk({"a.ply"}, "b.las");
  const std::string las = contents("b.las");
  EXPECT_EQ(getLas<std::uint16_t>(lasPoint(las, 0), 30), 200 * 257);
  EXPECT_EQ(getLas<std::uint16_t>(lasPoint(las, 0), 34), 17 * 257);
  EXPECT_EQ(getLas<std::uint16_t>(lasPoint(las, 1), 32), 90 * 257);
}

TEST_F(LasWriterTest, ValuesThatNoFieldHoldsAreExtraBytes) {
  Table table = tableOf({{"x", kFloat},
                         {"y", kFloat},
                         {"z", kFloat},
                         {"intensity", kFloat},
                         {"return_number", kByte},
                         {"user_data", kFloat},
                         {"point_source_id", ValueType::kInt32},
                         {"scan_angle", kFloat}});
  table.rows = {{0, 0, 0, 0.25, 1, 7, 65535, -12.6}, {1, 0, 0, 300, 16, 255, 0, 200}};
  writeTable("a.ply", table);
  convertOk({"a.ply"}, "b.las");
  for (const char* kept :
       {"float intensity_value", "uchar return_number_value", "float scan_angle_value"}) {
    EXPECT_THAT(typesOf(readTable("b.las")), HasSubstr(kept));
  }
  const Table back = readTable("b.las");
  EXPECT_THAT(column(back, "intensity_value"), ElementsAre(0.25, 300));
  EXPECT_THAT(column(back, "return_number_value"), ElementsAre(1, 16));
  EXPECT_THAT(column(back, "user_data"), ElementsAre(7, 255));
  EXPECT_THAT(column(back, "point_source_id"), ElementsAre(65535, 0));
  EXPECT_THAT(notes_,
              Contains(HasSubstr("intensity has values that the field of LAS cannot hold")));
  // The same where they fit
  table.rows[0][3] = 65535;
  table.rows[1][4] = 15;
  table.rows[1][7] = 0.006f;
  writeTable("a.ply", table);
  convertOk({"a.ply"}, "b.las");
  EXPECT_THAT(column(readTable("b.las"), "intensity"), ElementsAre(65535, 300));
  EXPECT_THAT(column(readTable("b.las"), "return_number"), ElementsAre(1, 15));
  EXPECT_EQ(getLas<std::uint16_t>(contents("b.las"), 105), 30);
}

TEST_F(LasWriterTest, PointsWithoutAPositionAreWithheld) {
  Table table =
      pointsOf({{1, 2, 3}, {std::nan(""), 2, 3}, {4, std::numeric_limits<double>::infinity(), 3}});
  writeTable("a.ply", table);
  convertOk({"a.ply"}, "b.las");
  EXPECT_THAT(notes_,
              Contains(HasSubstr("2 points without a finite position are written as with")));
  EXPECT_EQ(lasSummaryOf(contents("b.las")).count, 3u);
  EXPECT_EQ(lasSummaryOf(contents("b.las")).most[0], 1);
  EXPECT_THAT(column(readTable("b.las"), "x"), ElementsAre(1));
}

TEST_F(LasWriterTest, CoordinateReferenceSystemsGoThroughPly) {
  const std::string text = "PROJCS[\"x\", 1]";
  write("a.las", withRecords(makeLas(4, 6, 3), {lasRecord("LASF_Projection", 2112, text)}));
  convertOk({"a.las"}, "b.ply", all());
  convertOk({"b.ply"}, "c.las");
  EXPECT_EQ(lasRecordOf(contents("c.las"), "LASF_Projection", 2112).substr(0, text.size()), text);
  EXPECT_EQ(getLas<std::uint16_t>(contents("c.las"), 6), 16);
  EXPECT_THAT(notes_, Not(Contains(HasSubstr("comment"))));

  const std::vector<std::uint16_t> keys = {1, 1, 0, 2, 1024, 0, 1, 1, 3072, 0, 1, 32610};
  const std::string key_bytes(reinterpret_cast<const char*>(keys.data()), 2 * keys.size());
  write("a.las", withRecords(makeLas(2, 3, 3), {lasRecord("LASF_Projection", 34735, key_bytes)}));
  convertOk({"a.las"}, "b.ply", all());
  convertOk({"b.ply"}, "c.las");
  EXPECT_EQ(lasRecordOf(contents("c.las"), "LASF_Projection", 34735), key_bytes);
  EXPECT_EQ(lasSummaryOf(contents("c.las")).minor, 2u);  // later formats know text alone
  EXPECT_EQ(lasSummaryOf(contents("c.las")).format, 3u);

  // All that the keys say, of every model
  for (const std::vector<std::uint16_t>& words :
       {std::vector<std::uint16_t>{1, 1, 0, 2, 1024, 0, 1, 2, 2048, 0, 1, 4326},
        {1, 1, 0, 2, 1024, 0, 1, 3, 2048, 0, 1, 4978},
        {1, 1, 0, 3, 1024, 0, 1, 1, 3072, 0, 1, 26910, 4099, 0, 1, 9003},
        {1, 1, 0, 4, 1024, 0, 1, 1, 3072, 0, 1, 2263, 4096, 0, 1, 6360, 4099, 0, 1, 9003}}) {
    const std::string record(reinterpret_cast<const char*>(words.data()), 2 * words.size());
    write("f.las", withRecords(makeLas(2, 3, 3), {lasRecord("LASF_Projection", 34735, record)}));
    convertOk({"f.las"}, "b.ply", all());
    convertOk({"b.ply"}, "c.las");
    EXPECT_EQ(lasRecordOf(contents("c.las"), "LASF_Projection", 34735), record) << words[7];
  }

  // Tiles are merged with the system of the first
  write("d.las", contents("a.las"));
  convertOk({"a.las", "d.las"}, "e.las", all());
  EXPECT_EQ(lasRecordOf(contents("e.las"), "LASF_Projection", 34735), key_bytes);
  EXPECT_EQ(lasSummaryOf(contents("e.las")).count, 6u);
}

TEST_F(LasWriterTest, LongNamesAreToldApart) {
  Table table = pointsOf({{1, 2, 3}});
  for (const char* end : {"1", "2", "3"}) {
    table.properties.push_back(
        rowProperty("a_name_of_more_than_32_characters_" + std::string(end)));
    table.rows[0].push_back(end[0]);
  }
  writeTable("a.ply", table);
  convertOk({"a.ply"}, "b.las");
  EXPECT_THAT(notes_, Contains(HasSubstr("is read back as 'a_name_of_more_than_32_character")));
  const Table back = readTable("b.las");
  ASSERT_EQ(back.rows[0].size(), 21u);
  EXPECT_EQ(back.rows[0][18], '1');
  EXPECT_EQ(back.rows[0][20], '3');
}

TEST_F(LasWriterTest, WhatDoesNotFitIsRefused) {
  Table table = tableOf({{"x", kFloat}, {"y", kFloat}});
  table.rows = {{1, 2}};
  writeTable("a.ply", table);
  EXPECT_THAT(refusal("a.ply", {}, "b.las").message(), HasSubstr("expected properties x, y and z"));
  table = pointsOf({{1, 2, 3}});
  for (int i = 0; i < 400; ++i) {
    table.properties.push_back(rowProperty("value" + std::to_string(i), kByte));
    table.rows[0].push_back(i % 256);
  }
  writeTable("a.ply", table);
  EXPECT_THAT(refusal("a.ply", {}, "b.las").message(), HasSubstr("400 extra values of 430 bytes"));
}

TEST_F(LasWriterTest, EmptyAndCompressedFilesAreWritten) {
  writeTable("a.ply", pointsOf({}));
  convertOk({"a.ply"}, "b.las");
  EXPECT_EQ(lasSummaryOf(contents("b.las")).count, 0u);
  EXPECT_EQ(lasSummaryOf(contents("b.las")).most[0], 0);
  EXPECT_EQ(readTable("b.las").rows.size(), 0u);
  writeTable("a.ply", pointsOf({{1, 2, 3}, {4, 5, 6}}));
  convertOk({"a.ply"}, "b.las.gz");
  EXPECT_THAT(column(readTable("b.las.gz"), "z"), ElementsAre(3, 6));
}

// --- Files of others

class SharedLasTest : public LasWriterTest {
 protected:
  void SetUp() override {
    LasWriterTest::SetUp();
    if (!std::filesystem::exists(kCases)) GTEST_SKIP() << "no " << kCases;
  }
  static inline const std::filesystem::path kShared =
      std::filesystem::path(SURFEIT_SHARED_DATA_DIR).parent_path();
  static inline const std::filesystem::path kCases = kShared / "cases";
};

TEST_F(SharedLasTest, FilesOfOthersStayTheSameBytes) {
  for (const char* name :
       {"cases/real/test_data_las_1.2-with-color.las", "cases/georef/utm.las",
        "cases/las/rgb16.las", "cases/las/noise7.las", "data/points/autzen_trim.las"}) {
    SCOPED_TRACE(name);
    std::filesystem::copy_file(kShared / name, path("a.las"),
                               std::filesystem::copy_options::overwrite_existing);
    convertOk({"a.las"}, "b.las", all());
    const std::string before = contents("a.las"), after = contents("b.las");
    const std::uint32_t count = getLas<std::uint32_t>(before, 107);
    EXPECT_EQ(getLas<std::uint32_t>(after, 107), count);
    EXPECT_TRUE(lasPoints(after, count) == lasPoints(before, count));
    for (int number : {34735, 34736, 34737, 2112}) {
      EXPECT_EQ(lasRecordOf(after, "LASF_Projection", number),
                lasRecordOf(before, "LASF_Projection", number));
    }
  }
}

TEST_F(SharedLasTest, CasesAreReadAsTheyShouldBe) {
  const auto read = [&](const char* name) {
    Result<std::unique_ptr<RowReader>> reader = openRowReader(kCases / "las" / name);
    EXPECT_TRUE(reader.ok()) << reader.status().message();
    return std::move(*reader);
  };
  EXPECT_EQ(read("count_small.las")->element().count, 1500u);
  EXPECT_EQ(read("count_zero.las")->element().count, 1500u);
  EXPECT_THAT(read("count_zero.las")->notes(), Contains(HasSubstr("the file has 1500")));
  EXPECT_THAT(read("withheld.las")->notes(), Contains(HasSubstr("withheld")));
  EXPECT_THAT(read("noise7.las")->notes(), Contains(HasSubstr("of noise")));
  for (const char* name : {"withheld.las", "noise7.las"}) {
    const std::unique_ptr<RowReader> reader = read(name);
    const std::vector<std::byte> rows = readAllRows(*reader);
    for (std::size_t i = 0; i < reader->element().count; ++i) {
      ASSERT_GE(valueOf(*reader, rows, i, "z"), -1) << name << " " << i;
    }
  }
}

}  // namespace
}  // namespace surfeit
