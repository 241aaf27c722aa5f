// OpenVDB grids in memory, for programs that link OpenVDB themselves (10.0 or later): surfels and
// receivers from point grids, receivers at voxels, results in grids. Header only; the library does
// not need OpenVDB.
#pragma once

#include <openvdb/openvdb.h>
#include <openvdb/points/PointAttribute.h>
#include <openvdb/points/PointCount.h>
#include <openvdb/points/PointDataGrid.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "surfeit/engine.h"
#include "surfeit/surfel_source.h"

namespace surfeit {

// Names of point attributes. Attributes that a grid does not have are left out. Vectors are
// openvdb::Vec3f, all others floats.
struct VdbPointNames {
  std::string normal = "N", radius = "pscale", area = "area";
  std::string radiosity = "radiosity", albedo = "Cd";
};

// The points of a grid as surfels in memory, 64 bytes each, for indexSurfels. check() refuses
// frustum transforms.
class VdbPointSurfels : public SurfelProvider {
 public:
  explicit VdbPointSurfels(const openvdb::points::PointDataGrid& grid,
                           const VdbPointNames& names = {}) {
    namespace points = openvdb::points;
    is_linear_ = grid.transform().isLinear();
    const auto first = grid.tree().cbeginLeaf();
    if (!is_linear_ || !first) return;
    const points::AttributeSet& set = first->attributeSet();
    const auto has = [&](const std::string& name) {
      return set.find(name) != points::AttributeSet::INVALID_POS;
    };
    channels_.normal = has(names.normal);
    channels_.radius = has(names.radius);
    channels_.area = has(names.area);
    channels_.radiosity = has(names.radiosity);
    channels_.albedo = has(names.albedo);
    surfels_.reserve(std::size_t(points::pointCount(grid.tree())));
    for (auto leaf = first; leaf; ++leaf) addLeaf(grid, *leaf, names);
  }

  // kInvalidArgument for a grid without points, or whose transform is not affine.
  Status check() const {
    if (!is_linear_) {
      return Status::invalidArgument("a grid of points in a frustum, expected an affine transform");
    }
    if (surfels_.empty()) return Status::invalidArgument("a grid without points");
    return {};
  }

  std::uint64_t count() const override { return surfels_.size(); }
  CloudChannels channels() const override { return channels_; }
  glm::dvec3 origin() const override { return origin_; }
  Status read(std::uint64_t first, std::size_t count, Surfel* surfels) override {
    SURFEIT_RETURN_IF_ERROR(check());
    std::copy_n(surfels_.begin() + std::ptrdiff_t(first), count, surfels);
    return {};
  }

  // The positions and normals of the surfels, as receivers.
  std::vector<Receiver> receivers() const {
    std::vector<Receiver> receivers;
    receivers.reserve(surfels_.size());
    for (const Surfel& surfel : surfels_) {
      receivers.push_back({origin_ + glm::dvec3(surfel.position), surfel.normal, glm::vec3(0)});
    }
    return receivers;
  }

 private:
  using Leaf = openvdb::points::PointDataTree::LeafNodeType;

  // A handle of an attribute of the leaf, where it exists.
  template <typename Value>
  static std::unique_ptr<openvdb::points::AttributeHandle<Value>> handleOf(const Leaf& leaf,
                                                                           const std::string& name,
                                                                           bool exists) {
    using Handle = openvdb::points::AttributeHandle<Value>;
    return exists ? std::make_unique<Handle>(leaf.constAttributeArray(name)) : nullptr;
  }
  static glm::vec3 toGlm(const openvdb::Vec3f& v) { return {v.x(), v.y(), v.z()}; }

  void addLeaf(const openvdb::points::PointDataGrid& grid, const Leaf& leaf,
               const VdbPointNames& names) {
    const openvdb::points::AttributeHandle<openvdb::Vec3f> positions(leaf.constAttributeArray("P"));
    const auto normals = handleOf<openvdb::Vec3f>(leaf, names.normal, channels_.normal);
    const auto radiosities = handleOf<openvdb::Vec3f>(leaf, names.radiosity, channels_.radiosity);
    const auto albedos = handleOf<openvdb::Vec3f>(leaf, names.albedo, channels_.albedo);
    const auto radii = handleOf<float>(leaf, names.radius, channels_.radius);
    const auto areas = handleOf<float>(leaf, names.area, channels_.area);
    for (auto index = leaf.beginIndexOn(); index; ++index) {
      const openvdb::Vec3d voxel = index.getCoord().asVec3d();
      const openvdb::Vec3d world = grid.indexToWorld(voxel + openvdb::Vec3d(positions.get(*index)));
      const glm::dvec3 place(world.x(), world.y(), world.z());
      if (surfels_.empty()) origin_ = place;
      Surfel& surfel = surfels_.emplace_back();
      surfel.position = glm::vec3(place - origin_);
      if (normals) surfel.normal = toGlm(normals->get(*index));
      if (radiosities) surfel.radiosity = toGlm(radiosities->get(*index));
      if (albedos) surfel.albedo = toGlm(albedos->get(*index));
      if (radii) surfel.radius = radii->get(*index);
      if (areas) surfel.area = areas->get(*index);
    }
  }

  bool is_linear_ = true;
  CloudChannels channels_;
  glm::dvec3 origin_{0};
  std::vector<Surfel> surfels_;
};

// Grids that receive results; null grids are left out. They take over the topology and the
// transform of the grid whose voxels are gathered at.
struct VdbResults {
  openvdb::FloatGrid::Ptr occlusion;
  openvdb::Vec3SGrid::Ptr irradiance, fluence;
};

// Gathers over the whole sphere at the middle of every active voxel of `where`, leaf by leaf, so
// that neighbours follow each other. The settings of the gatherer must include the outputs of
// `results`. Holds the receivers and results of 4,096 voxels at a time. Errors: as
// Gatherer::gather.
template <typename GridT>
Status gatherAtVoxels(Gatherer& gatherer, const GridT& where, const VdbResults& results,
                      const Progress* progress = nullptr) {
  const auto prepare = [&](auto& grid) {
    using Tree = typename std::decay_t<decltype(*grid)>::TreeType;
    grid->setTree(
        std::make_shared<Tree>(where.tree(), typename Tree::ValueType(0), openvdb::TopologyCopy()));
    grid->setTransform(where.transform().copy());
  };
  if (results.occlusion) prepare(results.occlusion);
  if (results.irradiance) prepare(results.irradiance);
  if (results.fluence) prepare(results.fluence);

  constexpr std::size_t kRun = 4096;
  std::vector<openvdb::Coord> voxels;
  std::vector<Receiver> receivers;
  std::vector<GatherResult> found(kRun);
  const auto flush = [&]() -> Status {
    SURFEIT_RETURN_IF_ERROR(
        gatherer.gather(receivers.data(), receivers.size(), found.data(), progress));
    for (std::size_t i = 0; i < voxels.size(); ++i) {
      const auto put = [&](const auto& grid, const glm::vec3& value) {
        if (grid) grid->tree().setValueOn(voxels[i], openvdb::Vec3s(value.x, value.y, value.z));
      };
      if (results.occlusion) results.occlusion->tree().setValueOn(voxels[i], found[i].occlusion);
      put(results.irradiance, found[i].irradiance);
      put(results.fluence, found[i].fluence);
    }
    voxels.clear();
    receivers.clear();
    return {};
  };
  const auto add = [&](const openvdb::Coord& voxel) -> Status {
    const openvdb::Vec3d world = where.indexToWorld(voxel);
    Receiver receiver;
    receiver.position = {world.x(), world.y(), world.z()};
    receivers.push_back(receiver);
    voxels.push_back(voxel);
    return receivers.size() == kRun ? flush() : Status();
  };
  for (auto value = where.cbeginValueOn(); value; ++value) {
    const openvdb::CoordBBox box = value.getBoundingBox();  // all voxels of a tile
    for (auto voxel = box.begin(); voxel != box.end(); ++voxel)
      SURFEIT_RETURN_IF_ERROR(add(*voxel));
  }
  return receivers.empty() ? Status() : flush();
}

}  // namespace surfeit
