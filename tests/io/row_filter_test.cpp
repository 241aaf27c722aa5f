#include "cloud/rows/row_filter.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "cloud/rows/filtered_reader.h"
#include "io/convert_tables.h"

namespace surfeit {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

// Rows of a byte, a float and a double.
class RowFilterTest : public testing::Test {
 protected:
  RowFilterTest() {
    element_.properties = {rowProperty("classification", ValueType::kUint8),
                           rowProperty("return_number", ValueType::kUint8),
                           rowProperty("radius"),
                           rowProperty("gps_time", ValueType::kFloat64),
                           rowProperty("odd(name)", ValueType::kInt16),
                           rowProperty("nx"),
                           rowProperty("true_colour", ValueType::kUint8)};
    packRow(element_);
  }

  // Whether the condition holds for a row of these values.
  bool holds(const std::string& text, const std::vector<double>& values) {
    const Result<RowFilter> filter = RowFilter::create(text, element_.properties);
    EXPECT_TRUE(filter.ok()) << filter.status().message();
    if (!filter.ok()) return false;
    std::vector<std::byte> row(element_.row_bytes);
    for (std::size_t i = 0; i < values.size(); ++i) {
      setValue(element_.properties[i], values[i], row.data());
    }
    RowFilter::Workspace workspace;
    std::uint8_t answer = 2;
    filter->test(row.data(), row.size(), 1, workspace, &answer);
    EXPECT_LT(answer, 2);
    return answer == 1;
  }

  std::string refusal(const std::string& text) {
    const Result<RowFilter> filter = RowFilter::create(text, element_.properties);
    EXPECT_FALSE(filter.ok()) << text;
    EXPECT_EQ(filter.status().code(), StatusCode::kInvalidArgument);
    return filter.status().message();
  }

  RowLayout element_;
};

TEST_F(RowFilterTest, ComparesAndCombines) {
  EXPECT_TRUE(holds("classification == 2", {2}));
  EXPECT_FALSE(holds("classification == 2", {3}));
  EXPECT_TRUE(holds("classification != 7 and return_number == 1", {2, 1}));
  EXPECT_FALSE(holds("classification != 7 and return_number == 1", {7, 1}));
  EXPECT_FALSE(holds("classification != 7 and return_number == 1", {2, 2}));
  EXPECT_TRUE(holds("classification != 7 && return_number == 1 || gps_time > 5", {7, 1, 0, 6}));
  EXPECT_TRUE(holds("not classification == 7", {6}));
  EXPECT_TRUE(holds("not not classification == 7", {7}));
  EXPECT_TRUE(holds("!(classification == 7)", {6}));
  EXPECT_FALSE(holds("classification", {0}));
  EXPECT_TRUE(holds("classification", {9}));
  EXPECT_TRUE(holds("gps_time <= -1.5e2", {0, 0, 0, -150}));
  EXPECT_FALSE(holds("gps_time < -1.5e2", {0, 0, 0, -150}));
  EXPECT_TRUE(holds("gps_time >= .5", {0, 0, 0, 0.5}));
}

TEST_F(RowFilterTest, AndBindsMoreThanOrAndProductsMoreThanSums) {
  EXPECT_TRUE(holds("classification == 1 or classification == 2 and return_number == 9", {1, 0}));
  EXPECT_FALSE(holds("(classification == 1 or classification == 2) and return_number == 9", {1}));
  EXPECT_TRUE(
      holds("1 + 2 * 3 == 7 and (1 + 2) * 3 == 9 and 8 - 2 - 1 == 5 and 8 / 4 / 2 == 1", {}));
  EXPECT_TRUE(holds("-classification + 5 == 3 and -(2) == 0 - 2 and 2 - -1 == 3", {2}));
}

TEST_F(RowFilterTest, FloatsAreWhatTheirDigitsSay) {
  EXPECT_TRUE(holds("radius == 0.1", {0, 0, 0.1}));
  EXPECT_TRUE(holds("0.1 >= radius", {0, 0, 0.1}));
  EXPECT_TRUE(holds("radius <= -0.1", {0, 0, -0.1}));
  EXPECT_FALSE(holds("radius != 0.1", {0, 0, 0.1}));
  EXPECT_TRUE(holds("gps_time == 0.1", {0, 0, 0, 0.1}));
  EXPECT_TRUE(holds("radius < 1e300", {0, 0, 5}));
  EXPECT_FALSE(holds("radius == radius", {0, 0, std::nan("")}));
}

TEST_F(RowFilterTest, NamesAreThoseThatPeopleKnow) {
  for (const char* name : {"return_number", "ReturnNumber", "RETURN_NUMBER", "return", "Return",
                           "\"return_number\"", "'Return Number'"}) {
    EXPECT_TRUE(holds(name + std::string(" == 4"), {0, 4})) << name;
  }
  EXPECT_TRUE(
      holds("class == 3 and Classification == 3 and GpsTime == 2 and time == 2", {3, 0, 0, 2}));
  EXPECT_TRUE(holds("pscale == 2", {0, 0, 2}));
  EXPECT_TRUE(holds("'odd(name)' == -3", {0, 0, 0, 0, -3}));
  EXPECT_TRUE(holds("true and not false", {}));
}

TEST_F(RowFilterTest, RefusalsTellPlaceAndNames) {
  EXPECT_THAT(refusal("classificaton == 7"),
              AllOf(HasSubstr("filter: at 1: found 'classificaton'"),
                    HasSubstr("classification return_number radius gps_time odd(name) nx")));
  EXPECT_THAT(refusal("return == 1 and normal == 3"), HasSubstr("at 17: found 'normal'"));
  EXPECT_THAT(refusal("classification = 7"), HasSubstr("at 16: found '=', expected '=='"));
  EXPECT_THAT(refusal(""), HasSubstr("at 1: found the end"));
  EXPECT_THAT(refusal("(radius > 1"), HasSubstr("at 12: found the end, expected and, or, or )"));
  EXPECT_THAT(refusal("radius > 1)"), HasSubstr("at 11: found ')'"));
  EXPECT_THAT(refusal("radius > "), HasSubstr("at 10: found the end"));
  EXPECT_THAT(refusal("0 < radius < 1"), HasSubstr("two comparisons are written"));
  EXPECT_THAT(refusal("radius > 1x"), HasSubstr("found '1x'"));
  EXPECT_THAT(refusal("radius > 1 2"), HasSubstr("at 12: found '2'"));
  EXPECT_THAT(refusal("radius & 1"), HasSubstr("found '&'"));
  EXPECT_THAT(refusal("'radius"), HasSubstr("a name between quotes"));
  EXPECT_THAT(refusal("and 1"), HasSubstr("found 'and'"));
  EXPECT_THAT(refusal(std::string(100, '(') + "1" + std::string(100, ')')),
              HasSubstr("at most 64 parentheses"));
  std::string many = "1";
  for (int i = 0; i < 300; ++i) many += "+1";
  EXPECT_THAT(refusal(many), HasSubstr("at most 256 steps"));
}

TEST_F(RowFilterTest, TrueNeedsNoLook) {
  const auto isTrue = [&](const char* text) {
    return RowFilter::create(text, element_.properties)->isTrue();
  };
  EXPECT_TRUE(isTrue("true") && isTrue("1"));
  EXPECT_FALSE(isTrue("false") || isTrue("nx"));
}

// Clouds of many rows, read through a filter.
class FilteredReaderTest : public ConvertTest {
 protected:
  static constexpr std::size_t kRows = 100'000;

  void SetUp() override {
    ConvertTest::SetUp();
    Table table;
    table.properties = {rowProperty("x"), rowProperty("y"), rowProperty("z"),
                        rowProperty("id", ValueType::kInt32)};
    for (std::size_t i = 0; i < kRows; ++i) table.rows.push_back({0, 1, 2, double(i)});
    writeTable("a.ply", table);
  }

  std::unique_ptr<RowReader> open(const std::string& filter, const std::string& name = "a.ply") {
    RowReaderOptions options;
    options.filter = filter;
    Result<std::unique_ptr<RowReader>> reader = openRowReader(path(name), options);
    EXPECT_TRUE(reader.ok()) << reader.status().message();
    return reader.ok() ? std::move(*reader) : nullptr;
  }
};

TEST_F(FilteredReaderTest, CountsAndReadsWhatHolds) {
  for (const auto& [filter, wanted] : std::map<std::string, std::function<bool(std::size_t)>>{
           {"id / 3 >= 20000", [](std::size_t i) { return i >= 60000; }},
           {"id == 99999 or id == 0", [](std::size_t i) { return i == 99999 || i == 0; }},
           {"id != 77", [](std::size_t i) { return i != 77; }},
           {"false", [](std::size_t) { return false; }}}) {
    SCOPED_TRACE(filter);
    const std::unique_ptr<RowReader> reader = open(filter);
    std::vector<double> expected;
    for (std::size_t i = 0; i < kRows; ++i) {
      if (wanted(i)) expected.push_back(double(i));
    }
    ASSERT_EQ(reader->element().count, expected.size());
    const std::vector<std::byte> rows = readAllRows(*reader, 777);
    for (std::size_t i = 0; i < expected.size(); ++i) {
      ASSERT_EQ(valueOf(*reader, rows, i, "id"), expected[i]);
    }
    ASSERT_TRUE(reader->rewind().ok());
    expectReaderKeepsContract(*reader);
    EXPECT_THAT(reader->notes(), ElementsAre(HasSubstr(std::to_string(kRows - expected.size()) +
                                                       " of 100000 points")));
  }
}

TEST_F(FilteredReaderTest, SeeksEveryPlaceOfManyRows) {
  const std::unique_ptr<RowReader> reader = open("not (id > 1000 and id < 40000)");
  AlignedBuffer buffer;
  for (const std::uint64_t row : {0, 1000, 1001, 1002, 61000, 3, 60999, 30000, 30001, 512}) {
    if (row >= reader->element().count) {
      EXPECT_TRUE(reader->seekRow(row).ok() == (row == reader->element().count));
      continue;
    }
    ASSERT_TRUE(reader->seekRow(row).ok());
    const Result<Bytes> rows = reader->readRows(2, buffer);
    ASSERT_TRUE(rows.ok());
    const std::vector<std::byte> kept(rows->begin(), rows->end());
    EXPECT_EQ(valueOf(*reader, kept, 0, "id"), double(row <= 1000 ? row : row + 38999));
  }
}

TEST_F(FilteredReaderTest, WhatTakesAllIsTheReaderItself) {
  const std::unique_ptr<RowReader> reader = open("id >= 0");
  EXPECT_EQ(&reader->file(), reader.get());
  EXPECT_THAT(reader->notes(), IsEmpty());
  EXPECT_EQ(reader->element().count, kRows);
}

TEST_F(FilteredReaderTest, CompressedCloudsAreFiltered) {
  convertOk({"a.ply"}, "a.ply.gz");
  const std::unique_ptr<RowReader> reader = open("id < 10", "a.ply.gz");
  EXPECT_EQ(reader->element().count, 10u);
  expectReaderKeepsContract(*reader);
}

TEST_F(FilteredReaderTest, SelectionsSpareTheSecondCount) {
  RowReaderOptions options;
  options.filter = "id < 10";
  options.selections = std::make_shared<RowSelections>();
  ASSERT_TRUE(openRowReader(path("a.ply"), options).ok());
  const auto again = openRowReader(path("a.ply"), options);
  EXPECT_EQ((*again)->element().count, 10u);
  options.filter = "id < 11";
  EXPECT_EQ((*openRowReader(path("a.ply"), options))->element().count, 11u);
}

TEST_F(FilteredReaderTest, ConversionsFilterBeforeAllElse) {
  ConvertOptions options;
  options.filter = "number > 5 and number <= 9";
  options.channels = "id=number";
  options.every = 2;
  const ConvertStats stats = convertOk({"a.ply"}, "b.ply", options);
  EXPECT_EQ(stats.records, 4u);
  EXPECT_THAT(column(readTable("b.ply"), "number"), ElementsAre(6, 8));
  EXPECT_THAT(notes_, ElementsAre(HasSubstr("99996 of 100000 points are left out by the filter "
                                            "'number > 5 and number <= 9'")));
}

TEST_F(FilteredReaderTest, RefusalsNameTheFile) {
  RowReaderOptions options;
  options.filter = "clas == 2";
  const auto reader = openRowReader(path("a.ply"), options);
  ASSERT_FALSE(reader.ok());
  EXPECT_EQ(reader.status().code(), StatusCode::kInvalidArgument);
  EXPECT_THAT(reader.status().message(),
              AllOf(HasSubstr("a.ply: filter: at 1: found 'clas'"), HasSubstr("x y z id")));
}

}  // namespace
}  // namespace surfeit
