// OpenVDB's own library writes the volumes that we read.
#include "cloud/vdb/vdb_volume_reader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <openvdb/tools/LevelSetSphere.h>
#include <openvdb/tools/LevelSetUtil.h>

#include <cmath>
#include <string>

#include "io/vdb_test_grids.h"

namespace surfeit {
namespace {

class VdbVolumeReaderTest : public VdbTest {};

TEST_F(VdbVolumeReaderTest, LevelSetsAndFogVolumesAreReadForEveryCompression) {
  const auto level_set =
      vdb::tools::createLevelSetSphere<vdb::FloatGrid>(3.0f, vdb::Vec3f(1, 2, -30), 0.125f);
  auto fog = level_set->deepCopy();
  vdb::tools::sdfToFogVolume(*fog);
  fog->setName("smoke");
  for (const std::uint32_t compression : kCompressions) {
    const Table distance = readTable(save({level_set}, compression));
    expectVolume(distance, *level_set, {"distance"}, kScalar);
    const double radius = std::cbrt(std::pow(0.125, 3) * 3 / (4 * M_PI));
    EXPECT_NEAR(distance["radius"][0], radius, 1e-6);
    expectVolume(readTable(save({fog}, compression), 33), *fog, {"smoke"}, kScalar);
    const auto half = fog->deepCopy();
    half->setSaveFloatAsHalf(true);
    expectVolume(readTable(save({half}, compression)), *fog, {"smoke"}, kScalar, 5e-4);
  }
}

TEST_F(VdbVolumeReaderTest, TilesAreExpandedAndValuesOfEveryTypeRead) {
  const auto fill = [](auto grid, auto value, auto other) {
    grid->setTransform(vdb::math::Transform::createLinearTransform(0.5));
    grid->fill(vdb::CoordBBox(vdb::Coord(-9), vdb::Coord(140, 22, 30)), value);
    grid->tree().setValue(vdb::Coord(5000, -4097, 3), other);
    grid->tree().setValue(vdb::Coord(-1), other);
    return grid;
  };
  for (const std::uint32_t compression : kCompressions) {
    const auto real = fill(vdb::DoubleGrid::create(), 0.1, 0.3);
    real->setName("pressure");
    expectVolume(readTable(save({real}, compression)), *real, {"pressure"}, kScalar);
    const auto whole = fill(vdb::Int32Grid::create(), -5, 123456789);
    whole->setName("cells");
    expectVolume(readTable(save({whole}, compression)), *whole, {"cells"}, kScalar);
    const auto vector = fill(vdb::Vec3SGrid::create(), vdb::Vec3f(1, 2, 3), vdb::Vec3f(4, 5, -6));
    vector->setName("Cd");
    expectVolume(readTable(save({vector}, compression)), *vector, {"red", "green", "blue"},
                 kVector);
    const auto wide = fill(vdb::Vec3DGrid::create(), vdb::Vec3d(1, 2, 3), vdb::Vec3d(0.1));
    wide->setName("force");
    expectVolume(readTable(save({wide}, compression)), *wide, {"force_x", "force_y", "force_z"},
                 kVector);
  }
}

TEST_F(VdbVolumeReaderTest, OtherGridsOfTheSameTransformAreValuesOfTheRows) {
  auto density = vdb::FloatGrid::create();
  density->setName("density");
  density->fill(vdb::CoordBBox(vdb::Coord(-20), vdb::Coord(20, 40, 30)), 0.5f);
  auto temperature = vdb::FloatGrid::create(-1);
  temperature->setName("temperature");
  auto emission = vdb::Vec3SGrid::create();
  emission->setName("emission");
  emission->fill(vdb::CoordBBox(vdb::Coord(-200), vdb::Coord(200)), vdb::Vec3f(1, 2, 3));
  for (int i = -30; i < 30; i += 3) {
    temperature->tree().setValue(vdb::Coord(i, i / 2, 5 - i), float(i));
    emission->tree().setValue(vdb::Coord(i, i, i), vdb::Vec3f(float(i)));
  }
  auto elsewhere = vdb::FloatGrid::create();
  elsewhere->setName("elsewhere");
  elsewhere->setTransform(vdb::math::Transform::createLinearTransform(2));
  const std::string file = save({density, temperature, emission, elsewhere}, kCompressions[3]);

  const Table table = readTable(file);
  expectVolume(table, *density, {"density"}, kScalar);
  for (std::size_t row = 0; row < table.size(); ++row) {
    const vdb::Coord voxel(int(table["voxel_i"][row]), int(table["voxel_j"][row]),
                           int(table["voxel_k"][row]));
    ASSERT_EQ(table["temperature"][row], temperature->tree().getValue(voxel)) << voxel;
    ASSERT_EQ(table["emission_g"][row], emission->tree().getValue(voxel)[1]) << voxel;
  }
  EXPECT_THAT(table.notes, testing::ElementsAre(testing::HasSubstr("elsewhere")));

  RowReaderOptions options;
  options.part = "temperature";
  expectVolume(readTable(file, 10, options), *temperature, {"temperature"}, kScalar);
}

}  // namespace
}  // namespace surfeit
