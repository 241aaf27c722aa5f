// OpenVDB's own library writes the points that we read.
#include "cloud/vdb/vdb_points_reader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <openvdb/points/PointConversion.h>
#include <openvdb/points/PointDataGrid.h>
#include <openvdb/points/PointGroup.h>

#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "io/vdb_test_grids.h"

namespace surfeit {
namespace {

namespace vp = openvdb::points;

class VdbPointsReaderTest : public VdbTest {};

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
class VdbPositionCodec : public VdbTest {};
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

TEST_F(VdbPointsReaderTest, AttributesOfEveryTypeAndCodecAreRead) {
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
    EXPECT_EQ(table.element.find("i16")->type, ValueType::kInt16);
    EXPECT_EQ(table.element.find("wide")->type, ValueType::kFloat64);
  }
}

TEST_F(VdbPointsReaderTest, PointsOfManyPagesAndFarFromTheOriginAreRead) {
  std::vector<vdb::Vec3f> points = somePoints(300000);
  auto grid = pointGrid<vp::NullCodec>(points, 0.02);
  grid->transform().postTranslate(vdb::Vec3d(500000, 0, 0));
  const Table table = readTable(save({grid}, kCompressions[3]), 5000);
  EXPECT_EQ(table.element.find("x")->type, ValueType::kFloat64);
  expectPositions(table, positionsOf(*grid), 1e-9);
}

}  // namespace
}  // namespace surfeit
