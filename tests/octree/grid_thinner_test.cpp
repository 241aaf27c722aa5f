// Clouds thinned by a grid: convert with a spacing.
#include "index/clouds/grid_thinner.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "io/convert_tables.h"

namespace surfeit {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

class GridThinnerTest : public ConvertTest {
 protected:
  static ConvertOptions spaced(double spacing) {
    ConvertOptions options;
    options.spacing = spacing;
    return options;
  }

  double unit() { return std::uniform_real_distribution<double>(0, 1)(random_); }

  static Table emptyTable() {
    return tableOf({{"x", kDouble},
                    {"y", kDouble},
                    {"z", kDouble},
                    {"radius", kFloat},
                    {"area", kFloat},
                    {"power_r", kFloat},
                    {"power_g", kFloat},
                    {"power_b", kFloat},
                    {"number", kDouble}});
  }

  // Two squares beside each other, the left one with a hundred times the density.
  Table twoDensities(std::size_t sparse, double shift = 0) {
    Table table = emptyTable();
    for (std::size_t i = 0; i < 101 * sparse; ++i) {
      const bool is_dense = i % 101 != 0;
      const double side = is_dense ? 0 : 1;
      table.rows.push_back({shift + side + unit(), shift + unit(), 0.001 * unit(),
                            is_dense ? 0.01 : 0.1, is_dense ? 1e-4 : 1e-2, unit(), 1, 0,
                            double(i)});
    }
    return table;
  }

  static double sumOf(const Table& table, const std::string& name) {
    const std::vector<double> values = column(table, name);
    return std::accumulate(values.begin(), values.end(), 0.0);
  }

  // The row of each cell that is to be kept, by a map.
  static std::vector<double> expectedNumbers(const Table& table, double spacing) {
    struct Best {
      double distance_sq, number;
    };
    std::map<std::vector<double>, Best> best;
    for (const std::vector<double>& row : table.rows) {
      std::vector<double> cell;
      double distance_sq = 0;
      for (int axis = 0; axis < 3; ++axis) {
        const double at = row[std::size_t(axis)] / spacing;
        cell.push_back(std::floor(at));
        distance_sq += (at - cell.back() - 0.5) * (at - cell.back() - 0.5);
      }
      const auto [found, is_new] = best.insert({cell, {distance_sq, row.back()}});
      if (!is_new && distance_sq < found->second.distance_sq) {
        found->second = {distance_sq, row.back()};
      }
    }
    std::vector<double> numbers;
    for (const auto& [cell, kept] : best) numbers.push_back(kept.number);
    std::sort(numbers.begin(), numbers.end());
    return numbers;
  }

  std::mt19937 random_{7};
};

TEST_F(GridThinnerTest, OneRecordOfACellStandsForAll) {
  Table table = emptyTable();
  table.rows = {{0.1, 0, 0, 1, 2, 1, 2, 3, 0},
                {0.6, 0.5, 0.5, 2, 3, 1, 2, 3, 1},
                {1.1, 0, 0, 5, 7, 1, 1, 1, 2},
                {0.9, 0, 0, 9, 7, 1, 2, 4, 3},
                {-.1, 0, 0, 5, 7, 1, 1, 1, 4}};
  writeTable("a.ply", table);
  const ConvertStats stats = convertOk({"a.ply"}, "b.ply", spaced(1));
  EXPECT_EQ(stats.records, 5u);
  EXPECT_EQ(stats.thinned_records, 2u);
  EXPECT_EQ(stats.written_records, 3u);
  EXPECT_THAT(readTable("b.ply").rows, ElementsAre(ElementsAre(0.6, 0.5, 0.5, 4, 12, 3, 6, 10, 1),
                                                   ElementsAre(1.1, 0, 0, 5, 7, 1, 1, 1, 2),
                                                   ElementsAre(-.1, 0, 0, 5, 7, 1, 1, 1, 4)));
}

TEST_F(GridThinnerTest, RadiiGrowByTheCountWhereThereIsNoArea) {
  Table table = tableOf({{"x", kFloat}, {"y", kFloat}, {"z", kFloat}, {"width", kByte}});
  table.rows = {{0, 0, 0, 3}, {0, 0, 0, 5}, {0, 0, 0, 5}, {0, 0, 0, 5}};
  writeTable("a.ply", table);
  convertOk({"a.ply"}, "b.ply", spaced(0.5));
  EXPECT_THAT(readTable("b.ply").rows, ElementsAre(ElementsAre(0, 0, 0, 6)));
  EXPECT_EQ(typesOf(readTable("b.ply")), "float x, float y, float z, float width");
}

TEST_F(GridThinnerTest, AreaAndPowerStayAndDensityBecomesEven) {
  const Table table = twoDensities(1000);
  writeTable("a.ply", table);
  convertOk({"a.ply"}, "b.ply", spaced(0.1));
  const Table thin = readTable("b.ply");
  for (const char* name : {"area", "power_r", "power_g"}) {
    const double sum = sumOf(table, name);
    EXPECT_NEAR(sumOf(thin, name), sum, 1e-6 * sum) << name;
  }
  EXPECT_EQ(column(thin, "number"), expectedNumbers(table, 0.1));
  double dense = 0;
  for (const double x : column(thin, "x")) dense += x < 1 ? 1 : 0;
  EXPECT_EQ(dense, 100);
  EXPECT_EQ(double(thin.rows.size()), 200);
}

TEST_F(GridThinnerTest, MemoryDoesNotShow) {
  const Table table = twoDensities(3000);
  writeTable("a.ply", table);
  for (const double spacing : {0.003, 0.3}) {
    ConvertOptions options = spaced(spacing);
    options.memory_bytes = std::uint64_t{25} << 20;  // two sorters of 8 MiB, which spill
    convertOk({"a.ply"}, "small.ply", options);
    options.memory_bytes = std::uint64_t{1} << 30;
    convertOk({"a.ply"}, "large.ply", options);
    EXPECT_EQ(contents("small.ply"), contents("large.ply"));
    EXPECT_EQ(column(readTable("small.ply"), "number"), expectedNumbers(table, spacing));
  }
}

TEST_F(GridThinnerTest, FilesDoNotShow) {
  const Table table = twoDensities(100);
  writeTable("a.ply", table);
  Table left = table, right = table;
  left.rows.resize(4000);
  right.rows.erase(right.rows.begin(), right.rows.begin() + 4000);
  writeTable("left.ply", left);
  writeTable("right.ply", right);
  convertOk({"a.ply"}, "one.ply", spaced(0.07));
  convertOk({"left.ply", "right.ply"}, "two.ply", spaced(0.07));
  EXPECT_EQ(contents("one.ply"), contents("two.ply"));
  convertOk({"right.ply", "left.ply"}, "turned.ply", spaced(0.07));
  const auto numbers = [&](const char* name) {
    const std::vector<double> values = column(readTable(name), "number");
    return std::multiset<double>(values.begin(), values.end());
  };
  EXPECT_EQ(numbers("one.ply"), numbers("turned.ply"));
}

TEST_F(GridThinnerTest, CoordinatesOfMapsKeepTheirDigits) {
  const Table table = twoDensities(100, 5e6);
  writeTable("a.ply", table);
  convertOk({"a.ply"}, "b.ply", spaced(0.01));
  const Table thin = readTable("b.ply");
  EXPECT_EQ(column(thin, "number"), expectedNumbers(table, 0.01));
  EXPECT_LT(thin.rows.size(), table.rows.size());
}

// What is written counts: after moving, cropping and choosing.
TEST_F(GridThinnerTest, OtherOptionsComeFirst) {
  Table table = pointsOf({{1, 0, 0}, {2, 0, 0}, {3, 0, 0}, {50, 0, 0}});
  writeTable("a.ply", table);
  ConvertOptions options = spaced(1);
  options.transform = {0.5, 0, 0, 0, 0, 0.5, 0, 0, 0, 0, 0.5, 0};
  options.crop = CropBox{{0, 0, 0}, {10, 1, 1}};
  options.filter = "x != 3";
  const ConvertStats stats = convertOk({"a.ply"}, "b.ply", options);
  EXPECT_THAT(readTable("b.ply").rows, ElementsAre(ElementsAre(.5, 0, 0), ElementsAre(1, 0, 0)));
  EXPECT_EQ(stats.cropped_records, 1u);
  // In place, from a compressed file
  convertOk({"a.ply"}, "c.ply.gz");
  convertOk({"c.ply.gz"}, "c.ply.gz", spaced(10));
  EXPECT_THAT(readTable("c.ply.gz").rows, ElementsAre(ElementsAre(3, 0, 0), ElementsAre(50, 0, 0)));
}

TEST_F(GridThinnerTest, RecordsWithoutAPlaceAreToldAndLeftOut) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  writeTable("a.ply", pointsOf({{1, 0, 0}, {nan, 0, 0}, {1, 0, -HUGE_VAL}}));
  const ConvertStats stats = convertOk({"a.ply"}, "b.ply", spaced(1));
  EXPECT_EQ(stats.placeless_records, 2u);
  EXPECT_THAT(notes_, ElementsAre(HasSubstr("2 records without a finite position are left out")));
  EXPECT_THAT(readTable("b.ply").rows, ElementsAre(ElementsAre(1, 0, 0)));
}

TEST_F(GridThinnerTest, ImpossibleGridsAreRefused) {
  writeTable("a.ply", pointsOf({{1, 0, 0}}));
  for (const double spacing : {0.0, -1.0, HUGE_VAL, double(NAN)}) {
    const Status status = refusal("a.ply", spaced(spacing));
    EXPECT_EQ(status.code(), StatusCode::kInvalidArgument);
    EXPECT_THAT(status.message(), HasSubstr("expected a finite length above 0"));
  }
  for (const double spacing : {1e-17, 5e-324}) {
    EXPECT_THAT(refusal("a.ply", spaced(spacing)).message(), HasSubstr("give a larger spacing"));
  }
  ConvertOptions both = spaced(1);
  both.every = 2;
  EXPECT_EQ(refusal("a.ply", both).code(), StatusCode::kInvalidArgument);
  ConvertOptions small = spaced(1);
  small.memory_bytes = std::uint64_t{20} << 20;
  EXPECT_EQ(refusal("a.ply", small).code(), StatusCode::kBudgetTooSmall);
  Table placeless = tableOf({{"radius", kFloat}});
  writeTable("none.ply", placeless);
  EXPECT_EQ(refusal("none.ply", spaced(1)).code(), StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace surfeit
