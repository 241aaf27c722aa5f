// OpenVDB's own library writes what we read, and reads what we write.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <openvdb/io/File.h>
#include <openvdb/openvdb.h>
#include <openvdb/points/PointConversion.h>
#include <openvdb/points/PointCount.h>
#include <openvdb/points/PointDataGrid.h>
#include <openvdb/points/PointGroup.h>
#include <openvdb/tools/LevelSetSphere.h>
#include <openvdb/tools/LevelSetUtil.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "io/formats/vdb_reader.h"
#include "io/formats/vdb_writer.h"
#include "io/test_directory.h"

namespace surfeit {
namespace {

namespace vdb = openvdb;
namespace vp = openvdb::points;

// All rows of a file, property by property.
struct Table {
  PlyElement element;
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

Table readTable(const std::string& path, std::size_t batch = 1000,
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
      for (const PlyProperty& property : table.element.properties) {
        table.columns[property.name].push_back(
            plyValue(rows->data() + at + property.offset, property.type));
      }
    }
  }
  EXPECT_EQ(table.size(), table.element.count);
  return table;
}

class VdbOpenVdb : public DirectoryTest {
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

constexpr std::uint32_t kCompressions[] = {
    vdb::io::COMPRESS_NONE, vdb::io::COMPRESS_ZIP, vdb::io::COMPRESS_ACTIVE_MASK,
    vdb::io::COMPRESS_BLOSC | vdb::io::COMPRESS_ACTIVE_MASK, vdb::io::COMPRESS_BLOSC};

std::vector<vdb::Vec3f> somePoints(std::size_t count) {
  std::mt19937 random(7);
  std::uniform_real_distribution<float> uniform(-3, 3);
  std::vector<vdb::Vec3f> points;
  for (std::size_t i = 0; i < count; ++i) {
    const float x = uniform(random), y = uniform(random), z = uniform(random);
    points.emplace_back(x, y, z * 0.1f);
  }
  return points;
}

template <typename Codec>
vp::PointDataGrid::Ptr pointGrid(const std::vector<vdb::Vec3f>& points, double voxel_size) {
  const auto transform = vdb::math::Transform::createLinearTransform(voxel_size);
  transform->postTranslate(vdb::Vec3d(0.3, -0.2, 10));
  auto grid = vp::createPointDataGrid<Codec, vp::PointDataGrid>(points, *transform);
  grid->setName("cloud");
  return grid;
}

std::vector<double> componentsOf(double v) { return {v}; }
template <typename T>
std::vector<double> componentsOf(const vdb::math::Vec3<T>& v) {
  return {double(v[0]), double(v[1]), double(v[2])};
}
template <typename T>
std::vector<double> componentsOf(const vdb::math::Quat<T>& v) {
  return {double(v[0]), double(v[1]), double(v[2]), double(v[3])};
}

// Adds an attribute, fills it, and returns what it decodes to, component by component.
template <typename T, typename Codec, typename Value>
std::vector<std::vector<double>> addAttribute(vp::PointDataGrid& grid, const std::string& name,
                                              Value value, vdb::Index stride = 1) {
  using Array = vp::TypedAttributeArray<T, Codec>;
  if (!Array::isRegistered()) Array::registerType();
  vp::appendAttribute(grid.tree(), name, Array::attributeType(), stride);
  std::vector<std::vector<double>> expected;
  std::size_t n = 0;
  for (auto leaf = grid.tree().beginLeaf(); leaf; ++leaf) {
    vp::AttributeWriteHandle<T, Codec> handle(leaf->attributeArray(name));
    for (vdb::Index i = 0; i < handle.size(); ++i) {
      std::vector<double> all;
      for (vdb::Index s = 0; s < stride; ++s) {
        handle.set(i, s, value(n++));
        for (const double v : componentsOf(handle.get(i, s))) all.push_back(v);
      }
      expected.resize(all.size());
      for (std::size_t c = 0; c < all.size(); ++c) expected[c].push_back(all[c]);
    }
  }
  return expected;
}

void expectColumn(const Table& table, const std::string& name, const std::vector<double>& expected,
                  double tolerance = 0) {
  const std::vector<double>& found = table[name];
  ASSERT_EQ(found.size(), expected.size()) << name;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    ASSERT_NEAR(found[i], expected[i], tolerance) << name << " " << i;
  }
}

std::vector<vdb::Vec3d> positionsOf(const vp::PointDataGrid& grid) {
  std::vector<vdb::Vec3d> positions;
  for (auto leaf = grid.tree().cbeginLeaf(); leaf; ++leaf) {
    vp::AttributeHandle<vdb::Vec3f> handle(leaf->constAttributeArray("P"));
    for (auto index = leaf->beginIndexAll(); index; ++index) {
      const vdb::Vec3d place = handle.get(*index) + index.getCoord().asVec3d();
      positions.push_back(grid.transform().indexToWorld(place));
    }
  }
  return positions;
}

void expectPositions(const Table& table, const std::vector<vdb::Vec3d>& expected,
                     double tolerance) {
  const char* const names[] = {"x", "y", "z"};
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> column;
    for (const vdb::Vec3d& place : expected) column.push_back(place[axis]);
    expectColumn(table, names[axis], column, tolerance);
  }
}

template <typename Codec>
class VdbPositionCodec : public VdbOpenVdb {};
using PositionCodecs = testing::Types<vp::NullCodec, vp::TruncateCodec, vp::FixedPointCodec<false>,
                                      vp::FixedPointCodec<true>>;
TYPED_TEST_SUITE(VdbPositionCodec, PositionCodecs);

TYPED_TEST(VdbPositionCodec, PositionsAreThoseOfOpenVdbForEveryCompression) {
  const auto grid = pointGrid<TypeParam>(somePoints(5000), 0.25);
  for (const std::uint32_t compression : kCompressions) {
    const std::string file = this->save({grid}, compression);
    for (const std::size_t batch : {std::size_t{7}, std::size_t{100000}}) {
      expectPositions(readTable(file, batch), positionsOf(*grid), 2e-6);
    }
  }
}

TEST_F(VdbOpenVdb, AttributesOfEveryTypeAndCodecAreRead) {
  const auto grid = pointGrid<vp::FixedPointCodec<false>>(somePoints(20000), 0.1);
  using Columns = std::vector<std::vector<double>>;
  std::map<std::string, Columns> scalars, vectors;
  const auto real = [](std::size_t n) { return float(std::sin(double(n)) * 0.5); };
  const auto unit = [](std::size_t n) { return float(0.5 + 0.5 * std::sin(double(n))); };
  const auto whole = [](std::size_t n) { return int(n % 251) - 125; };
  const auto vector = [](std::size_t n) {
    const double angle = double(n) * 0.1;
    return vdb::Vec3f(float(0.4 * std::sin(angle)), float(0.4 * std::cos(angle)), -0.3f);
  };
  const auto direction = [](std::size_t n) {
    const double a = double(n) * 0.7, b = double(n) * 0.13;
    return vdb::Vec3f(float(std::sin(a) * std::cos(b)), float(std::sin(a) * std::sin(b)),
                      float(std::cos(a)));
  };
  scalars["pscale"] = addAttribute<float, vp::NullCodec>(*grid, "pscale", real);
  scalars["half"] = addAttribute<float, vp::TruncateCodec>(*grid, "half", real);
  scalars["fx8"] = addAttribute<float, vp::FixedPointCodec<true>>(*grid, "fx8", real);
  scalars["fx16"] = addAttribute<float, vp::FixedPointCodec<false>>(*grid, "fx16", real);
  scalars["ufx8"] =
      addAttribute<float, vp::FixedPointCodec<true, vp::UnitRange>>(*grid, "ufx8", unit);
  scalars["ufx16"] =
      addAttribute<float, vp::FixedPointCodec<false, vp::UnitRange>>(*grid, "ufx16", unit);
  scalars["wide"] = addAttribute<double, vp::NullCodec>(*grid, "wide", real);
  scalars["i8"] = addAttribute<int8_t, vp::NullCodec>(*grid, "i8", whole);
  scalars["i16"] = addAttribute<int16_t, vp::NullCodec>(*grid, "i16", whole);
  scalars["id"] = addAttribute<int32_t, vp::NullCodec>(*grid, "id", whole);
  scalars["i64"] = addAttribute<int64_t, vp::NullCodec>(
      *grid, "i64", [](std::size_t n) { return int64_t(n) << 20; });
  scalars["flag"] =
      addAttribute<bool, vp::NullCodec>(*grid, "flag", [](std::size_t n) { return n % 3 == 0; });
  vectors["N"] = addAttribute<vdb::Vec3f, vp::UnitVecCodec>(*grid, "N", direction);
  vectors["v"] = addAttribute<vdb::Vec3f, vp::NullCodec>(*grid, "v", vector);
  vectors["Cd"] = addAttribute<vdb::Vec3f, vp::TruncateCodec>(*grid, "Cd", vector);
  vectors["vfx8"] = addAttribute<vdb::Vec3f, vp::FixedPointCodec<true>>(*grid, "vfx8", vector);
  vectors["vfx16"] = addAttribute<vdb::Vec3f, vp::FixedPointCodec<false>>(*grid, "vfx16", vector);
  vectors["vd"] = addAttribute<vdb::Vec3d, vp::NullCodec>(*grid, "vd", vector);
  vectors["vi"] = addAttribute<vdb::Vec3i, vp::NullCodec>(
      *grid, "vi", [&](std::size_t n) { return vdb::Vec3i(whole(n), 2, 3); });
  const Columns quaternions = addAttribute<vdb::math::Quat<float>, vp::NullCodec>(
      *grid, "orient", [&](std::size_t n) { return vdb::math::Quat<float>(real(n), 1, 2, 3); });
  const Columns strided = addAttribute<float, vp::NullCodec>(*grid, "weights", real, 2);
  vp::appendGroup(grid->tree(), "chosen");
  vp::appendAttribute<vdb::Name>(grid->tree(), "label");
  vp::appendAttribute<float>(grid->tree(), "constant", 0.75f);  // uniform arrays

  for (const std::uint32_t compression : kCompressions) {
    const Table table = readTable(save({grid}, compression), 777);
    for (const auto& [name, columns] : scalars) {
      expectColumn(table, name == "pscale" ? "radius" : name, columns[0], 1e-6);
    }
    const std::vector<std::string> triples[] = {{"nx", "ny", "nz"}, {"red", "green", "blue"}};
    for (const auto& [name, columns] : vectors) {
      for (std::size_t c = 0; c < 3; ++c) {
        std::string property = name + "_" + "xyz"[c];
        if (name == "N") property = triples[0][c];
        if (name == "Cd") property = triples[1][c];
        if (name == "v") property = std::string("velocity_") + "xyz"[c];
        expectColumn(table, property, columns[c], 1e-6);
      }
    }
    for (std::size_t c = 0; c < 4; ++c) {
      expectColumn(table, "orient_" + std::to_string(c), quaternions[c]);
    }
    for (std::size_t c = 0; c < 2; ++c) {
      expectColumn(table, "weights_" + std::to_string(c), strided[c]);
    }
    expectColumn(table, "constant", std::vector<double>(20000, 0.75));
    EXPECT_THAT(table.notes, testing::Contains(testing::HasSubstr("label")));
    EXPECT_THAT(table.notes, testing::Contains(testing::HasSubstr("i64")));
    EXPECT_EQ(table.element.find("i16")->type, PlyType::kInt16);
    EXPECT_EQ(table.element.find("wide")->type, PlyType::kFloat64);
  }
}

TEST_F(VdbOpenVdb, PointsOfManyPagesAndFarFromTheOriginAreRead) {
  std::vector<vdb::Vec3f> points = somePoints(300000);
  auto grid = pointGrid<vp::NullCodec>(points, 0.02);
  grid->transform().postTranslate(vdb::Vec3d(500000, 0, 0));
  const Table table = readTable(save({grid}, kCompressions[3]), 5000);
  EXPECT_EQ(table.element.find("x")->type, PlyType::kFloat64);
  expectPositions(table, positionsOf(*grid), 1e-9);
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

const auto kScalar = [](auto value, std::size_t) { return double(value); };
const auto kVector = [](const auto& value, std::size_t c) { return double(value[int(c)]); };

TEST_F(VdbOpenVdb, LevelSetsAndFogVolumesAreReadForEveryCompression) {
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

TEST_F(VdbOpenVdb, TilesAreExpandedAndValuesOfEveryTypeRead) {
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

TEST_F(VdbOpenVdb, OtherGridsOfTheSameTransformAreValuesOfTheRows) {
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

// What the writer is given: a property and its values.
struct Column {
  PlyProperty property;
  std::vector<double> values;
};

Column column(const std::string& name, PlyType type, std::vector<double> values) {
  PlyProperty property;
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
      const PlyProperty& property = (*writer)->element().properties[c];
      visitPlyType(property.type, [&]<typename T>(std::type_identity<T>) {
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
  using enum PlyType;
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

TEST_F(VdbOpenVdb, OpenVdbReadsOurPointsWithAllAttributes) {
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

TEST_F(VdbOpenVdb, OpenVdbReadsOurVolumesInTheSourcesPlace) {
  auto fog = vdb::tools::createLevelSetSphere<vdb::FloatGrid>(3.0f, vdb::Vec3f(1, 2, 3), 0.25f);
  vdb::tools::sdfToFogVolume(*fog);
  fog->setName("density");
  fog->insertMeta("shader", vdb::StringMetadata("smoke"));
  fog->transform().postRotate(0.3, vdb::math::X_AXIS);
  const std::string source = save({fog}, kCompressions[3]);
  const Table table = readTable(source);
  const Result<std::unique_ptr<RowReader>> like = openVdb(source, {});
  ASSERT_TRUE(like.ok());

  using enum PlyType;
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

TEST_F(VdbOpenVdb, OpenVdbReadsOurEmptyCloud) {
  using enum PlyType;
  writeVdb(path("empty.vdb"),
           {column("x", kFloat32, {}), column("y", kFloat32, {}), column("z", kFloat32, {})});
  const auto grid = load<vp::PointDataGrid>("empty.vdb", "points");
  ASSERT_NE(grid, nullptr);
  EXPECT_EQ(vp::pointCount(grid->tree()), 0u);
  EXPECT_EQ(readTable(path("empty.vdb")).element.count, 0u);
}

}  // namespace
}  // namespace surfeit
