// What the tests against OpenVDB's own library share: grids in and out of files, and their rows as
// columns.
#pragma once

#include <gtest/gtest.h>
#include <openvdb/io/File.h>
#include <openvdb/openvdb.h>

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "cloud/vdb/vdb_reader.h"
#include "io/test_directory.h"

namespace surfeit {

namespace vdb = openvdb;

// All rows of a file, property by property.
struct Table {
  RowLayout element;
  std::vector<std::string> notes;
  std::map<std::string, std::vector<double>> columns;
  std::size_t size() const { return columns.empty() ? 0 : columns.begin()->second.size(); }
  const std::vector<double>& operator[](const std::string& name) const {
    static const std::vector<double> kNone;
    const auto found = columns.find(name);
    EXPECT_NE(found, columns.end()) << name;
    return found == columns.end() ? kNone : found->second;
  }
};

inline Table readTable(const std::string& path, std::size_t batch = 1000,
                       const RowReaderOptions& options = {}) {
  Table table;
  Result<std::unique_ptr<RowReader>> opened = openVdb(path, options);
  EXPECT_TRUE(opened.ok()) << opened.status().message();
  if (!opened.ok()) return table;
  RowReader& reader = **opened;
  table.element = reader.element();
  table.notes = reader.notes();
  AlignedBuffer buffer;
  while (true) {
    const Result<Bytes> rows = reader.readRows(batch, buffer);
    EXPECT_TRUE(rows.ok()) << rows.status().message();
    if (!rows.ok() || rows->empty()) break;
    for (std::size_t at = 0; at < rows->size(); at += table.element.row_bytes) {
      for (const RowProperty& property : table.element.properties) {
        table.columns[property.name].push_back(
            rowValue(rows->data() + at + property.offset, property.type));
      }
    }
  }
  EXPECT_EQ(table.size(), table.element.count);
  return table;
}

class VdbTest : public DirectoryTest {
 protected:
  void SetUp() override {
    DirectoryTest::SetUp();
    vdb::initialize();
  }

  std::string save(const vdb::GridCPtrVec& grids, std::uint32_t compression,
                   const std::string& name = "grids.vdb") const {
    vdb::io::File file(path(name));
    file.setCompression(compression);
    file.write(grids);
    file.close();
    return path(name);
  }
  template <typename GridT>
  typename GridT::Ptr load(const std::string& name, const std::string& grid) const {
    vdb::io::File file(path(name));
    file.open();
    auto read = vdb::gridPtrCast<GridT>(file.readGrid(grid));
    file.close();
    return read;
  }
};

inline constexpr std::uint32_t kCompressions[] = {
    vdb::io::COMPRESS_NONE, vdb::io::COMPRESS_ZIP, vdb::io::COMPRESS_ACTIVE_MASK,
    vdb::io::COMPRESS_BLOSC | vdb::io::COMPRESS_ACTIVE_MASK, vdb::io::COMPRESS_BLOSC};

inline std::vector<vdb::Vec3f> somePoints(std::size_t count) {
  std::mt19937 random(7);
  std::uniform_real_distribution<float> uniform(-3, 3);
  std::vector<vdb::Vec3f> points;
  for (std::size_t i = 0; i < count; ++i) {
    const float x = uniform(random), y = uniform(random), z = uniform(random);
    points.emplace_back(x, y, z * 0.1f);
  }
  return points;
}

// Every active voxel once, in the order of the tree, with the grid's value.
template <typename GridT, typename Component>
void expectVolume(const Table& table, const GridT& grid, const std::vector<std::string>& names,
                  Component component, double tolerance = 0) {
  EXPECT_EQ(table.size(), grid.activeVoxelCount());
  const auto accessor = grid.getConstAccessor();
  vdb::Coord last;
  for (std::size_t row = 0; row < table.size(); ++row) {
    const vdb::Coord voxel(int(table["voxel_i"][row]), int(table["voxel_j"][row]),
                           int(table["voxel_k"][row]));
    ASSERT_TRUE(accessor.isValueOn(voxel)) << voxel;
    ASSERT_TRUE(row == 0 || voxel != last);
    last = voxel;
    for (std::size_t c = 0; c < names.size(); ++c) {
      ASSERT_NEAR(table[names[c]][row], component(accessor.getValue(voxel), c), tolerance);
    }
    const vdb::Vec3d world = grid.indexToWorld(voxel);
    ASSERT_NEAR(table["x"][row], world[0], 1e-5);
    ASSERT_NEAR(table["z"][row], world[2], 1e-5);
  }
}

inline constexpr auto kScalar = [](auto value, std::size_t) { return double(value); };
inline constexpr auto kVector = [](const auto& value, std::size_t c) {
  return double(value[int(c)]);
};

}  // namespace surfeit
