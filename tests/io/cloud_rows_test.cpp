#include "surfeit/cloud_rows.h"

#include <gtest/gtest.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "io/test_directory.h"

namespace surfeit {
namespace {

struct Point {
  double place[3];
  float normal[3];
  std::uint16_t tag;
};

// Points on a plane, as structs that lie apart.
std::vector<Point> planePoints(std::size_t count) {
  std::vector<Point> points(count);
  for (std::size_t i = 0; i < count; ++i) {
    points[i] = {
        {double(i % 200), 0.25, double(i / 200)}, {0, 1, 0}, static_cast<std::uint16_t>(i)};
  }
  return points;
}

const std::vector<CloudColumn> kColumns = {
    {"x", ColumnType::kFloat64},  {"y", ColumnType::kFloat64},  {"z", ColumnType::kFloat64},
    {"nx", ColumnType::kFloat32}, {"ny", ColumnType::kFloat32}, {"nz", ColumnType::kFloat32},
    {"tag", ColumnType::kUint16}};

template <typename Column, typename Points>
std::vector<Column> columnsOf(Points& points) {
  constexpr std::ptrdiff_t kStride = sizeof(Point);
  auto& first = points.front();
  return {{&first.place[0], kStride},  {&first.place[1], kStride},  {&first.place[2], kStride},
          {&first.normal[0], kStride}, {&first.normal[1], kStride}, {&first.normal[2], kStride},
          {&first.tag, kStride}};
}

class CloudRowsTest : public DirectoryTest {
 protected:
  void writeCloud(const std::string& name, const std::vector<Point>& points, std::size_t chunk) {
    Result<CloudOutput> output = CloudOutput::create(path(name), kColumns, {}, progress_);
    ASSERT_TRUE(output.ok()) << output.status().message();
    std::vector<ColumnValues> values = columnsOf<ColumnValues>(points);
    for (std::size_t first = 0; first < points.size(); first += chunk) {
      const std::size_t count = std::min(chunk, points.size() - first);
      ASSERT_TRUE(output->write(count, values.data()).ok());
      for (ColumnValues& column : values) {
        column.data = static_cast<const std::byte*>(column.data) + count * sizeof(Point);
      }
    }
    EXPECT_EQ(fileCount(), 0);  // not before it is complete
    ASSERT_TRUE(output->finish().ok());
  }

  Progress progress_;
};

TEST_F(CloudRowsTest, ColumnsComeBackInChunksOfAnySize) {
  const std::vector<Point> points = planePoints(70'001);
  writeCloud("a.ply", points, 12'345);
  Result<CloudInput> input = CloudInput::open(path("a.ply"));
  ASSERT_TRUE(input.ok()) << input.status().message();
  EXPECT_EQ(input->count(), points.size());
  ASSERT_EQ(input->columns().size(), kColumns.size());
  for (std::size_t i = 0; i < kColumns.size(); ++i) {
    EXPECT_EQ(input->columns()[i].name, kColumns[i].name);
    EXPECT_EQ(input->columns()[i].type, kColumns[i].type);
  }
  EXPECT_EQ(input->channels()[1].name, "normal");
  EXPECT_EQ(input->channels()[1].properties.size(), 3u);

  std::vector<Point> found(points.size(), Point{});
  std::vector<ColumnTarget> targets = columnsOf<ColumnTarget>(found);
  targets[4].data = nullptr;  // skipped
  std::size_t done = 0;
  for (;;) {
    const Result<std::size_t> count = input->read(9'999, targets.data());
    ASSERT_TRUE(count.ok()) << count.status().message();
    if (*count == 0) break;
    done += *count;
    for (ColumnTarget& target : targets) {
      if (target.data == nullptr) continue;
      target.data = static_cast<std::byte*>(target.data) + *count * sizeof(Point);
    }
  }
  ASSERT_EQ(done, points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    ASSERT_EQ(found[i].place[0], points[i].place[0]) << i;
    ASSERT_EQ(found[i].tag, points[i].tag) << i;
    ASSERT_EQ(found[i].normal[1], 0) << i;
  }
}

TEST_F(CloudRowsTest, SceneOfColumnsHasTheBytesOfTheSceneOfAFile) {
  std::vector<Point> points = planePoints(20'000);
  writeCloud("a.ply", points, points.size());
  ASSERT_TRUE(indexClouds({path("a.ply")}, path("a.sft"), {}, progress_).ok());
  CloudColumns rows;
  rows.count = points.size();
  rows.columns = kColumns;
  rows.values = columnsOf<ColumnValues>(points);
  const Result<IndexStats> stats = indexColumns(rows, path("b.sft"), {}, progress_);
  ASSERT_TRUE(stats.ok()) << stats.status().message();
  EXPECT_EQ(stats->surfels, points.size());
  EXPECT_EQ(contents("a.sft"), contents("b.sft"));
}

TEST_F(CloudRowsTest, SceneIsReadAsACloud) {
  writeCloud("a.ply", planePoints(1'000), 1'000);
  ASSERT_TRUE(indexClouds({path("a.ply")}, path("a.sft"), {}, progress_).ok());
  const Result<CloudInput> input = CloudInput::open(path("a.sft"));
  ASSERT_TRUE(input.ok()) << input.status().message();
  EXPECT_EQ(input->count(), 1'000u);
}

TEST_F(CloudRowsTest, ImpossibleColumnsAndNamesAreRefused) {
  const std::vector<std::vector<CloudColumn>> refused = {
      {}, {{"x", ColumnType::kFloat32}, {"x", ColumnType::kFloat32}}, {{"a b"}}, {{""}}};
  for (const std::vector<CloudColumn>& columns : refused) {
    const Result<CloudOutput> output = CloudOutput::create(path("a.ply"), columns, {}, progress_);
    EXPECT_EQ(output.status().code(), StatusCode::kInvalidArgument);
    CloudColumns rows;
    rows.columns = columns;
    rows.values.resize(columns.size());
    EXPECT_EQ(indexColumns(rows, path("a.sft"), {}, progress_).status().code(),
              StatusCode::kInvalidArgument);
  }
  EXPECT_EQ(CloudOutput::create(path("a.unknown"), kColumns, {}, progress_).status().code(),
            StatusCode::kInvalidArgument);
  EXPECT_EQ(CloudInput::open(path("none.ply")).status().code(), StatusCode::kIoError);
  EXPECT_EQ(fileCount(), 0);
}

}  // namespace
}  // namespace surfeit
