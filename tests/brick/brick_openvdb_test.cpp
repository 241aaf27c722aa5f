// OpenVDB's own library reads the brick maps that we write.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <openvdb/io/File.h>
#include <openvdb/openvdb.h>
#include <openvdb/tools/Interpolation.h>

#include <array>
#include <cmath>
#include <map>
#include <string>

#include "io/test_directory.h"
#include "surfeit/brick.h"

namespace surfeit {
namespace {

class BrickOpenVdb : public DirectoryTest {};

// A square of points in x and y, facing up, and one facing down below it, both across the origin.
std::string twoSquares() {
  std::string text =
      "ply\nformat ascii 1.0\nelement vertex 20000\nproperty float x\nproperty float y\n"
      "property float z\nproperty float nx\nproperty float ny\nproperty float nz\n"
      "property float area\nproperty float occlusion\nproperty float irradiance_r\n"
      "property float irradiance_g\nproperty float irradiance_b\nend_header\n";
  for (int side = 0; side < 2; ++side) {
    for (int i = 0; i < 10000; ++i) {
      const double x = (i % 100 + 0.5) / 50 - 1, y = (i / 100 + 0.5) / 50 - 1;
      text += fmt::format("{} {} {} 0 0 {} 0.0004 {} {} {} {}\n", x, y, side == 0 ? 0.3 : -0.3,
                          side == 0 ? 1 : -1, 0.5 + 0.4 * x, 2 + x, 2 + y, side);
    }
  }
  return text;
}

TEST_F(BrickOpenVdb, ItsLoaderFindsEveryVoxel) {
  write("a.ply", twoSquares());
  BrickOptions options;
  options.max_error = 0.02;
  Progress progress;
  const Result<BrickStats> stats = brickClouds({path("a.ply")}, path("out.vdb"), options, progress);
  ASSERT_TRUE(stats.ok()) << stats.status().message();
  const Result<BrickMap> map = BrickMap::open(path("out.vdb"));
  ASSERT_TRUE(map.ok()) << map.status().message();

  openvdb::initialize();
  openvdb::io::File file(path("out.vdb"));
  file.open();
  std::map<int, std::uint64_t> voxels;
  const openvdb::GridPtrVecPtr grids = file.getGrids();
  for (const openvdb::GridBase::Ptr& grid : *grids) {
    const auto level = grid->metaValue<openvdb::Int64>("brick_level");
    const std::string direction = grid->metaValue<std::string>("brick_direction");
    const std::string channel = grid->metaValue<std::string>("brick_channel");
    EXPECT_EQ(grid->getName(), fmt::format("{}:{}:{}", channel, level, direction));
    EXPECT_TRUE(direction == "pz" || direction == "nz") << direction;
    EXPECT_DOUBLE_EQ(grid->voxelSize().x(), map->voxelSize(int(level)));
    EXPECT_EQ(grid->metaValue<openvdb::Int64>("file_voxel_count"),
              openvdb::Int64(grid->activeVoxelCount()));
    if (channel != "area") continue;
    voxels[int(level)] += grid->activeVoxelCount();
    double area = 0;
    const auto weights = openvdb::gridPtrCast<openvdb::FloatGrid>(grid);
    for (auto voxel = weights->cbeginValueOn(); voxel; ++voxel) {
      area += double(*voxel);
      // The plane lies within the voxel, whose centre the transform gives
      const openvdb::Vec3d centre = grid->indexToWorld(voxel.getCoord());
      EXPECT_LE(std::abs(std::abs(centre.z()) - 0.3), 0.5001 * grid->voxelSize().x());
    }
    if (level + 1 == map->levelCount()) {
      EXPECT_NEAR(area, 4, 1e-3);
    }
  }
  ASSERT_EQ(stats->level_voxels.size(), std::size_t(map->levelCount()));
  for (int level = 0; level < map->levelCount(); ++level) {
    EXPECT_EQ(voxels[level], stats->level_voxels[std::size_t(level)]) << level;
  }
  file.close();
}

TEST_F(BrickOpenVdb, ValuesAreThoseOfItsGrids) {
  write("a.ply", twoSquares());
  BrickOptions options;
  options.max_error = 0;
  Progress progress;
  ASSERT_TRUE(brickClouds({path("a.ply")}, path("out.vdb"), options, progress).ok());
  const Result<BrickMap> map = BrickMap::open(path("out.vdb"));
  ASSERT_TRUE(map.ok()) << map.status().message();
  ASSERT_EQ(map->valueCount(), 4u);

  openvdb::initialize();
  openvdb::io::File file(path("out.vdb"));
  file.open();
  const auto occlusion = openvdb::gridPtrCast<openvdb::FloatGrid>(file.readGrid("occlusion:0:pz"));
  const auto irradiance =
      openvdb::gridPtrCast<openvdb::Vec3SGrid>(file.readGrid("irradiance:0:nz"));
  std::size_t count = 0;
  std::array<float, 4> values = {};
  for (auto voxel = occlusion->cbeginValueOn(); voxel; ++voxel, ++count) {
    const openvdb::Vec3d at = occlusion->indexToWorld(voxel.getCoord());
    ASSERT_TRUE(*map->lookup({at.x(), at.y(), at.z()}, {0, 0, 1}, 0, &values[0]));
    EXPECT_NEAR(values[0], *voxel, 1e-6f);
    EXPECT_NEAR(values[0], 0.5 + 0.4 * at.x(), 0.01);
  }
  for (auto voxel = irradiance->cbeginValueOn(); voxel; ++voxel, ++count) {
    const openvdb::Vec3d at = irradiance->indexToWorld(voxel.getCoord());
    ASSERT_TRUE(*map->lookup({at.x(), at.y(), at.z()}, {0, 0, -1}, 0, &values[0]));
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(values[std::size_t(c) + 1], (*voxel)[c], 1e-6f);
  }
  EXPECT_GT(count, 4000u);
  file.close();
}

}  // namespace
}  // namespace surfeit
