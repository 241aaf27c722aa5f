// Clouds thinned for cameras: convert with a density of cameras.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <numbers>
#include <numeric>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "io/convert_tables.h"

namespace surfeit {
namespace {

using testing::HasSubstr;

class CameraThinnerTest : public ConvertTest {
 protected:
  // At the origin, looks along x; 40 degrees, 100 pixels high and wide.
  static ConvertOptions alongX(double pixels) {
    ConvertOptions options;
    options.density.cameras.push_back({{0, 0, 0}, {1, 0, 0}, {}, 40});
    options.density.width = options.density.height = 100;
    options.density.pixels = pixels;
    return options;
  }
  static double pixelEdge() { return 2 * std::tan(std::numbers::pi / 9) / 100; }

  // Points at random on a floor of 40 by 40 with an area each.
  Table floorOf(std::size_t count) {
    Table table = tableOf(
        {{"x", kDouble}, {"y", kDouble}, {"z", kDouble}, {"area", kFloat}, {"id", kDouble}});
    std::uniform_real_distribution<double> place(-20, 20), area(0.5, 2);
    for (std::size_t i = 0; i < count; ++i) {
      table.rows.push_back({place(random_), -0.5, place(random_), area(random_), double(i)});
    }
    return table;
  }
  static double sumOf(const Table& table, const std::string& name) {
    const std::vector<double> values = column(table, name);
    return std::accumulate(values.begin(), values.end(), 0.0);
  }

  std::mt19937 random_{3};
};

TEST_F(CameraThinnerTest, SpacingFollowsThePixelsAndAreasAddUp) {
  const Table table = floorOf(200'000);
  writeTable("a.ply", table);
  const ConvertOptions options = alongX(12);
  convertOk({"a.ply"}, "b.ply", options);
  const Table thin = readTable("b.ply");
  EXPECT_LT(thin.rows.size(), 20'000u);
  EXPECT_NEAR(sumOf(thin, "area") / sumOf(table, "area"), 1, 1e-6);

  // Surfels per area in view, in octaves of distance: an area of 12 by 12 pixels each, within the
  // factor of 2 of the areas of neighbouring grids
  std::map<int, int> count;
  for (const std::vector<double>& row : thin.rows) {
    const double slope = std::tan(std::numbers::pi / 9), x = row[0];
    if (!(x > 2 && std::abs(row[2]) < slope * x)) continue;
    const int octave = int(std::floor(std::log2(x)));
    ++count[octave];
  }
  for (const auto& [octave, found] : count) {
    if (octave < 1 || octave > 3) continue;
    const double begin = std::ldexp(1, octave), end = 2 * begin;
    const double slope = std::tan(std::numbers::pi / 9);
    const double edge = 12 * pixelEdge();
    // Area between both distances by the area of a surfel: integral of 2 s x / (e^2 x^2)
    const double expected = 2 * slope / (edge * edge) * std::log(end / begin);
    EXPECT_GT(found, 0.6 * expected) << octave;
    EXPECT_LT(found, 1.7 * expected) << octave;
  }
}

TEST_F(CameraThinnerTest, TwoCamerasKeepAtLeastWhatEachKeeps) {
  writeTable("a.ply", floorOf(50'000));
  ConvertOptions one = alongX(10), other = alongX(10), both = alongX(10);
  other.density.cameras[0].look_at = {0, 0, 1};
  both.density.cameras.push_back(other.density.cameras[0]);
  const std::uint64_t first = convertOk({"a.ply"}, "b.ply", one).written_records;
  const std::uint64_t second = convertOk({"a.ply"}, "c.ply", other).written_records;
  const std::uint64_t all = convertOk({"a.ply"}, "d.ply", both).written_records;
  EXPECT_GT(all, std::max(first, second));
  EXPECT_LT(all, first + second);
}

TEST_F(CameraThinnerTest, AMoveKeepsMostRecordsAndMemoryDoesNotShow) {
  writeTable("a.ply", floorOf(200'000));
  ConvertOptions options = alongX(10);
  convertOk({"a.ply"}, "b.ply", options);
  const Table before = readTable("b.ply");
  options.memory_bytes = std::uint64_t{25} << 20;  // two sorters of 8 MiB, which spill
  convertOk({"a.ply"}, "c.ply", options);
  EXPECT_EQ(readTable("c.ply").rows, before.rows);

  options.density.cameras[0].eye.x += 0.02;
  options.density.cameras[0].look_at.x += 0.02;
  convertOk({"a.ply"}, "d.ply", options);
  const std::vector<double> ids = column(before, "id");
  const std::set<double> kept(ids.begin(), ids.end());
  std::size_t same = 0;
  const std::vector<double> moved = column(readTable("d.ply"), "id");
  for (const double id : moved) same += kept.count(id);
  EXPECT_GT(double(same), 0.95 * double(moved.size()));
}

TEST_F(CameraThinnerTest, CamerasAndOtherThinningExcludeEachOther) {
  writeTable("a.ply", floorOf(10));
  ConvertOptions options = alongX(1);
  options.spacing = 1;
  TestProgress progress;
  const auto spaced = convertClouds({path("a.ply")}, path("b.ply"), options, progress);
  ASSERT_FALSE(spaced.ok());
  EXPECT_THAT(spaced.status().message(), HasSubstr("found cameras with every or spacing"));
  options = alongX(1);
  options.density.cameras[0].look_at = {0, 0, 0};
  const auto blind = convertClouds({path("a.ply")}, path("b.ply"), options, progress);
  ASSERT_FALSE(blind.ok());
  EXPECT_THAT(blind.status().message(), HasSubstr("camera 1: the eye stands on the look-at"));
}

}  // namespace
}  // namespace surfeit
