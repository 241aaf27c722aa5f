// OpenVDB's own library reads what we write.
#include "cloud/vdb/vdb_writer.h"

#include <gtest/gtest.h>
#include <openvdb/points/PointCount.h>
#include <openvdb/points/PointDataGrid.h>
#include <openvdb/tools/LevelSetSphere.h>
#include <openvdb/tools/LevelSetUtil.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <string>
#include <vector>

#include "io/vdb_test_grids.h"

namespace surfeit {
namespace {

namespace vp = openvdb::points;

class VdbWriterTest : public VdbTest {};

// What the writer is given: a property and its values.
struct Column {
  RowProperty property;
  std::vector<double> values;
};

Column column(const std::string& name, ValueType type, std::vector<double> values) {
  RowProperty property;
  property.name = name;
  property.type = type;
  return {property, std::move(values)};
}

void writeVdb(const std::string& path, const std::vector<Column>& columns,
              const RowReader* like = nullptr, std::vector<std::string> comments = {}) {
  RowWriterOptions options;
  for (const Column& one : columns) options.properties.push_back(one.property);
  options.like = like;
  options.comments = std::move(comments);
  Result<std::unique_ptr<RowWriter>> writer = createVdb(path, options);
  ASSERT_TRUE(writer.ok()) << writer.status().message();
  std::vector<std::byte> row((*writer)->element().row_bytes);
  for (std::size_t i = 0; i < columns[0].values.size(); ++i) {
    for (std::size_t c = 0; c < columns.size(); ++c) {
      const RowProperty& property = (*writer)->element().properties[c];
      visitValueType(property.type, [&]<typename T>(std::type_identity<T>) {
        const T value = static_cast<T>(columns[c].values[i]);
        std::memcpy(row.data() + property.offset, &value, sizeof(T));
      });
    }
    ASSERT_TRUE((*writer)->writeRows(row).ok());
  }
  const Status status = (*writer)->finish();
  ASSERT_TRUE(status.ok()) << status.message();
}

std::vector<Column> someColumns(std::size_t count) {
  std::vector<double> xyz[3], n, id;
  for (const vdb::Vec3f& point : somePoints(count)) {
    for (int axis = 0; axis < 3; ++axis) xyz[axis].push_back(double(point[axis]));
    id.push_back(double(id.size()));
    n.push_back(std::sin(id.back()));
  }
  using enum ValueType;
  return {column("x", kFloat32, xyz[0]),      column("y", kFloat32, xyz[1]),
          column("z", kFloat32, xyz[2]),      column("nx", kFloat32, n),
          column("ny", kFloat32, n),          column("nz", kFloat32, n),
          column("radius", kFloat32, n),      column("red", kFloat32, n),
          column("green", kFloat32, n),       column("blue", kFloat32, n),
          column("velocity_x", kFloat32, n),  column("velocity_y", kFloat32, n),
          column("velocity_z", kFloat32, n),  column("id", kInt32, id),
          column("wide", kFloat64, n),        column("class", kUint8, id),
          column("big", kUint32, id),         column("radiosity_r", kFloat32, n),
          column("radiosity_g", kFloat32, n), column("radiosity_b", kFloat32, n),
          column("weights_0", kFloat32, n),   column("weights_1", kFloat32, id)};
}

TEST_F(VdbWriterTest, OpenVdbReadsOurPointsWithAllAttributes) {
  const std::vector<Column> columns = someColumns(50000);
  writeVdb(path("ours.vdb"), columns, nullptr, {"made for a test"});

  vdb::io::File file(path("ours.vdb"));
  file.open();
  EXPECT_EQ(file.getMetadata()->metaValue<std::string>("comment0001"), "made for a test");
  const auto grid = vdb::gridPtrCast<vp::PointDataGrid>(file.readGrid("points"));
  ASSERT_NE(grid, nullptr);
  EXPECT_EQ(vp::pointCount(grid->tree()), 50000u);
  const double per_voxel = 50000.0 / double(grid->activeVoxelCount());
  EXPECT_GE(per_voxel, 4);
  EXPECT_LE(per_voxel, 64);

  const auto& descriptor = grid->tree().cbeginLeaf()->attributeSet().descriptor();
  const std::map<std::string, std::string> types = {
      {"P", "vec3s"},         {"N", "vec3s"},   {"pscale", "float"}, {"Cd", "vec3s"},
      {"v", "vec3s"},         {"id", "int32"},  {"wide", "double"},  {"class", "int16"},
      {"radiosity", "vec3s"}, {"big", "int64"}, {"weights", "float"}};
  EXPECT_EQ(descriptor.size(), types.size());
  for (const auto& [name, type] : types) {
    ASSERT_NE(descriptor.find(name), vp::AttributeSet::INVALID_POS) << name;
    EXPECT_EQ(descriptor.valueType(descriptor.find(name)), type) << name;
  }

  // Every point with its values, found again by its id
  std::size_t count = 0;
  for (auto leaf = grid->tree().cbeginLeaf(); leaf; ++leaf) {
    vp::AttributeHandle<vdb::Vec3f> place(leaf->constAttributeArray("P"));
    vp::AttributeHandle<vdb::Vec3f> normal(leaf->constAttributeArray("N"));
    vp::AttributeHandle<int32_t> id(leaf->constAttributeArray("id"));
    vp::AttributeHandle<int64_t> big(leaf->constAttributeArray("big"));
    vp::AttributeHandle<double> wide(leaf->constAttributeArray("wide"));
    vp::AttributeHandle<float> weights(leaf->constAttributeArray("weights"));
    ASSERT_EQ(weights.stride(), 2u);
    for (auto index = leaf->beginIndexOn(); index; ++index, ++count) {
      const std::size_t row = static_cast<std::size_t>(id.get(*index));
      const vdb::Vec3d world = grid->transform().indexToWorld(vdb::Vec3d(place.get(*index)) +
                                                              index.getCoord().asVec3d());
      for (int axis = 0; axis < 3; ++axis) {
        const double expected = columns[std::size_t(axis)].values[row];
        ASSERT_NEAR(world[axis], expected, 1e-6);
        ASSERT_LE(std::abs(place.get(*index)[axis]), 0.5);
      }
      ASSERT_EQ(big.get(*index), int64_t(row));
      ASSERT_EQ(wide.get(*index), columns[14].values[row]);
      ASSERT_EQ(normal.get(*index)[1], float(columns[4].values[row]));
      ASSERT_EQ(weights.get(*index, 1), float(row));
    }
  }
  EXPECT_EQ(count, 50000u);
}

// A stray row makes voxels so large that all others lie in one leaf.
TEST_F(VdbWriterTest, OpenVdbReadsALeafOfManyPoints) {
  std::vector<Column> columns = someColumns(70000);
  columns[0].values[0] = 1e9;
  writeVdb(path("dense.vdb"), columns);
  const auto grid = load<vp::PointDataGrid>("dense.vdb", "points");
  ASSERT_NE(grid, nullptr);
  EXPECT_EQ(grid->tree().leafCount(), 2u);
  const auto leaf = grid->tree().cbeginLeaf();
  ASSERT_EQ(leaf->pointCount(), 69999u);
  vp::AttributeHandle<int32_t> id(leaf->constAttributeArray("id"));
  vp::AttributeHandle<double> wide(leaf->constAttributeArray("wide"));
  for (vdb::Index i = 0; i < id.size(); ++i) {
    ASSERT_EQ(wide.get(i), columns[14].values[std::size_t(id.get(i))]);
  }
  EXPECT_EQ(readTable(path("dense.vdb")).size(), 70000u);
}

TEST_F(VdbWriterTest, OpenVdbReadsOurVolumesInTheSourcesPlace) {
  auto fog = vdb::tools::createLevelSetSphere<vdb::FloatGrid>(3.0f, vdb::Vec3f(1, 2, 3), 0.25f);
  vdb::tools::sdfToFogVolume(*fog);
  fog->setName("density");
  fog->insertMeta("shader", vdb::StringMetadata("smoke"));
  fog->transform().postRotate(0.3, vdb::math::X_AXIS);
  const std::string source = save({fog}, kCompressions[3]);
  const Table table = readTable(source);
  const Result<std::unique_ptr<RowReader>> like = openVdb(source, {});
  ASSERT_TRUE(like.ok());

  using enum ValueType;
  std::vector<Column> columns;
  for (const char* name : {"x", "y", "z", "density"}) {
    columns.push_back(column(name, kFloat32, table[name]));
  }
  for (const char* name : {"voxel_i", "voxel_j", "voxel_k"}) {
    columns.push_back(column(name, kInt32, table[name]));
  }
  for (const char* name : {"irradiance_r", "irradiance_g", "irradiance_b"}) {
    columns.push_back(column(name, kFloat32, table[name[11] == 'r' ? "x" : "z"]));
  }
  columns.push_back(column("cut size", kInt32, table["voxel_i"]));
  for (Column& one : columns) std::reverse(one.values.begin(), one.values.end());
  writeVdb(path("result.vdb"), columns, like->get());

  const auto density = load<vdb::FloatGrid>("result.vdb", "density");
  const auto irradiance = load<vdb::Vec3SGrid>("result.vdb", "irradiance");
  const auto cut = load<vdb::Int32Grid>("result.vdb", "cut_size");
  ASSERT_TRUE(density && irradiance && cut);
  EXPECT_EQ(density->getGridClass(), vdb::GRID_FOG_VOLUME);
  EXPECT_EQ(irradiance->transform(), fog->transform());
  EXPECT_EQ(irradiance->metaValue<std::string>("shader"), "smoke");
  EXPECT_EQ(irradiance->background(), vdb::Vec3f(0));
  EXPECT_EQ(density->activeVoxelCount(), fog->activeVoxelCount());
  for (auto voxel = fog->cbeginValueOn(); voxel; ++voxel) {
    if (!voxel.isVoxelValue()) continue;
    const vdb::Coord at = voxel.getCoord();
    ASSERT_EQ(density->tree().getValue(at), *voxel);
    ASSERT_TRUE(irradiance->tree().isValueOn(at));
    ASSERT_FLOAT_EQ(irradiance->tree().getValue(at)[0], float(fog->indexToWorld(at)[0]));
    ASSERT_EQ(cut->tree().getValue(at), at[0]);
  }
  expectVolume(readTable(path("result.vdb")), *density, {"density"}, kScalar);
}

TEST_F(VdbWriterTest, OpenVdbReadsOurEmptyCloud) {
  using enum ValueType;
  writeVdb(path("empty.vdb"),
           {column("x", kFloat32, {}), column("y", kFloat32, {}), column("z", kFloat32, {})});
  const auto grid = load<vp::PointDataGrid>("empty.vdb", "points");
  ASSERT_NE(grid, nullptr);
  EXPECT_EQ(vp::pointCount(grid->tree()), 0u);
  EXPECT_EQ(readTable(path("empty.vdb")).element.count, 0u);
}

}  // namespace
}  // namespace surfeit
