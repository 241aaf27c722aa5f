// surfeit/openvdb.h: a host's grids in memory, to a scene and back.
#include <gtest/gtest.h>
#include <openvdb/points/PointConversion.h>

#include <cmath>
#include <vector>

#include "io/test_directory.h"
#include "surfeit/openvdb.h"

namespace surfeit {
namespace {

namespace vdb = openvdb;

constexpr int kEdge = 40;

// A ceiling of edge 1, one unit above the origin, that faces down and sends light: as points.
vdb::points::PointDataGrid::Ptr ceiling(const vdb::Vec3d& shift = vdb::Vec3d(0)) {
  std::vector<vdb::Vec3f> positions, normals, radiosities;
  std::vector<float> radii, areas;
  for (int i = 0; i < kEdge * kEdge; ++i) {
    positions.emplace_back((float(i % kEdge) + .5f) / kEdge - .5f, 1.f,
                           (float(i / kEdge) + .5f) / kEdge - .5f);
    normals.emplace_back(0.f, -1.f, 0.f);
    radiosities.emplace_back(1.f, .5f, .25f);
    radii.push_back(.018f);
    areas.push_back(1.f / (kEdge * kEdge));
  }
  const vdb::math::Transform::Ptr transform = vdb::math::Transform::createLinearTransform(.1);
  const vdb::points::PointAttributeVector<vdb::Vec3f> wrapped(positions);
  const auto index_grid =
      vdb::tools::createPointIndexGrid<vdb::tools::PointIndexGrid>(wrapped, *transform);
  auto grid = vdb::points::createPointDataGrid<vdb::points::NullCodec, vdb::points::PointDataGrid>(
      *index_grid, wrapped, *transform);
  const auto add = [&](const char* name, auto& values) {
    using Value = typename std::decay_t<decltype(values)>::value_type;
    vdb::points::appendAttribute<Value>(grid->tree(), name);
    const vdb::points::PointAttributeVector<Value> wrapper(values);
    vdb::points::populateAttribute(grid->tree(), index_grid->tree(), name, wrapper);
  };
  add("N", normals);
  add("radiosity", radiosities);
  add("pscale", radii);
  add("area", areas);
  grid->transform().postTranslate(shift);
  return grid;
}

class OpenVdbEngineTest : public DirectoryTest {
 protected:
  void SetUp() override {
    DirectoryTest::SetUp();
    vdb::initialize();
  }
};

TEST_F(OpenVdbEngineTest, PointsBecomeAScene) {
  for (const vdb::Vec3d& shift : {vdb::Vec3d(0), vdb::Vec3d(5e5, -4e6, 100)}) {
    const auto grid = ceiling(shift);
    VdbPointSurfels surfels(*grid);
    ASSERT_TRUE(surfels.check().ok());
    EXPECT_EQ(surfels.count(), std::uint64_t{kEdge * kEdge});
    EXPECT_EQ(surfels.receivers().size(), surfels.count());
    Progress progress;
    IndexOptions options;
    options.memory_bytes = 64 << 20;
    ASSERT_TRUE(indexSurfels(surfels, path("points.sft"), options, progress).ok());

    EngineOptions engine_options;
    engine_options.memory_bytes = 64 << 20;
    Result<Engine> engine = Engine::create(engine_options);
    ASSERT_TRUE(engine.ok());
    const Result<Scene> scene = engine->open(path("points.sft"));
    ASSERT_TRUE(scene.ok());
    GatherSettings settings;
    settings.mode = GatherMode::kBleeding;
    Result<Gatherer> gatherer = engine->gatherer(*scene, settings);
    ASSERT_TRUE(gatherer.ok());
    Receiver receiver;
    receiver.position = {shift.x(), shift.y(), shift.z()};
    receiver.normal = {0, 1, 0};
    GatherResult result;
    ASSERT_TRUE(gatherer->gather(&receiver, 1, &result).ok());
    EXPECT_NEAR(result.occlusion, .239f, .01f);  // the form factor of a square
    EXPECT_NEAR(result.irradiance.y, .5f * .239f, .01f);
  }
}

TEST_F(OpenVdbEngineTest, VoxelsGetResults) {
  const auto grid = ceiling();
  VdbPointSurfels surfels(*grid);
  Progress progress;
  IndexOptions options;
  options.memory_bytes = 64 << 20;
  ASSERT_TRUE(indexSurfels(surfels, path("points.sft"), options, progress).ok());
  EngineOptions engine_options;
  engine_options.memory_bytes = 64 << 20;
  Result<Engine> engine = Engine::create(engine_options);
  const Result<Scene> scene = engine->open(path("points.sft"));
  GatherSettings settings;
  settings.mode = GatherMode::kBleeding;
  settings.outputs = kOutputOcclusion | kOutputFluence;
  Result<Gatherer> gatherer = engine->gatherer(*scene, settings);
  ASSERT_TRUE(gatherer.ok());

  vdb::FloatGrid where;
  where.setTransform(vdb::math::Transform::createLinearTransform(.125));
  where.fill(vdb::CoordBBox(vdb::Coord(-8, -8, -8), vdb::Coord(7, 7, 7)), 1.f);  // also as tiles
  VdbResults results;
  results.occlusion = vdb::FloatGrid::create();
  results.fluence = vdb::Vec3SGrid::create();
  ASSERT_TRUE(gatherAtVoxels(*gatherer, where, results).ok());
  EXPECT_EQ(results.occlusion->activeVoxelCount(), 16u * 16 * 16);
  EXPECT_EQ(results.occlusion->transform(), where.transform());

  // As a receiver there, alone
  const vdb::Coord voxel(2, -3, 1);
  const vdb::Vec3d place = where.indexToWorld(voxel);
  Receiver receiver;
  receiver.position = {place.x(), place.y(), place.z()};
  GatherResult alone;
  ASSERT_TRUE(gatherer->gather(&receiver, 1, &alone).ok());
  EXPECT_GT(alone.occlusion, .02f);
  EXPECT_NEAR(results.occlusion->tree().getValue(voxel), alone.occlusion, .004f);
  EXPECT_NEAR(results.fluence->tree().getValue(voxel).x(), alone.fluence.x, .05f * alone.fluence.x);
}

TEST_F(OpenVdbEngineTest, WhatIsNoCloudIsRefused) {
  vdb::points::PointDataGrid empty;
  EXPECT_EQ(VdbPointSurfels(empty).check().code(), StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace surfeit
