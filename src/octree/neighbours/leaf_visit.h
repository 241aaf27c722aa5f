// The surfels of a leaf, with their numbers: of a large one those alone that are of use.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <span>
#include <utility>

#include "octree/neighbours/places.h"
#include "octree/read/paged_octree.h"
#include "surfeit/status.h"
#include "surfeit/surfel.h"

namespace surfeit {

inline glm::vec3 normalOf(const Surfel& surfel) {
  return surfel.isSphere() ? glm::vec3(0) : surfel.normal;
}

// What a node refers to, without what else it holds: a reader may drop the page of a node.
struct NodeLink {
  NodeRange children;
  LeafRange leaf;

  NodeLink() = default;
  explicit NodeLink(const Node& node) : children(childrenOf(node)), leaf(surfelsOf(node)) {}
  bool isLeaf() const { return children.count == 0; }
};

inline PlaceBounds boundsOf(const Node& node) {
  return {node.position, node.radius, node.normal, node.normal_cosine};
}

// Calls visit(surfel, id) for all of a leaf.
template <typename Visit>
Status visitLeaf(const LeafRange& leaf, const SceneFile& file, PagedOctree::Reader& reader,
                 const Visit& visit) {
  std::uint32_t page = leaf.page, first = leaf.first;
  for (std::uint64_t left = leaf.count; left > 0; ++page, first = 0) {
    SURFEIT_ASSIGN_OR_RETURN(const std::span<const Surfel> run, reader.surfels(page, first, left));
    for (std::size_t i = 0; i < run.size(); ++i) {
      visit(run[i], surfelId(file, page, first + std::uint32_t(i)));
    }
    left -= run.size();
  }
  return {};
}

// Calls visit(surfel, id) for the surfels of a leaf: of a large one for those of the runs alone of
// which not isBeyond(distanceTo(bounds)), the nearest first.
template <typename DistanceTo, typename IsBeyond, typename Visit>
class LeafVisit {
 public:
  LeafVisit(const LeafRange& leaf, PagedOctree::Reader& reader, const DistanceTo& distanceTo,
            const IsBeyond& isBeyond, const Visit& visit)
      : leaf_(leaf), reader_(reader), distanceTo_(distanceTo), isBeyond_(isBeyond), visit_(visit) {}

  Status run() {
    if (leaf_.count <= reader_.file().header().surfel_group_capacity) {
      return visitLeaf(leaf_, reader_.file(), reader_, visit_);
    }
    SURFEIT_ASSIGN_OR_RETURN(runs_, reader_.leafRuns(leaf_));
    return visitSpheres(runs_->levels.size() - 1, 0);
  }

 private:
  // The spheres of a level that lie in one of the level above, from `begin` on.
  Status visitSpheres(std::size_t level, std::size_t begin) {
    const std::vector<LeafRuns::Sphere>& spheres = runs_->levels[level];
    const std::size_t count = std::min(LeafRuns::kFanOut, spheres.size() - begin);
    std::array<std::pair<float, std::size_t>, LeafRuns::kFanOut> candidates;
    for (std::size_t i = 0; i < count; ++i) {
      const LeafRuns::Sphere& sphere = spheres[begin + i];
      candidates[i] = {distanceTo_(PlaceBounds{sphere.position, sphere.radius}), begin + i};
    }
    const auto order = std::span(candidates).first(count);
    std::sort(order.begin(), order.end());
    for (const auto& [distance, sphere] : order) {
      if (isBeyond_(distance)) break;
      SURFEIT_RETURN_IF_ERROR(level > 0 ? visitSpheres(level - 1, sphere * LeafRuns::kFanOut)
                                        : visitRun(sphere));
    }
    return {};
  }

  Status visitRun(std::size_t run) {
    const std::uint32_t page = leaf_.page + std::uint32_t(run), first = run == 0 ? leaf_.first : 0;
    SURFEIT_ASSIGN_OR_RETURN(const std::span<const Surfel> surfels,
                             reader_.surfels(page, first, runs_->surfels[run]));
    for (std::size_t i = 0; i < surfels.size(); ++i) {
      visit_(surfels[i], surfelId(reader_.file(), page, first + std::uint32_t(i)));
    }
    return {};
  }

  const LeafRange leaf_;
  PagedOctree::Reader& reader_;
  const DistanceTo& distanceTo_;
  const IsBeyond& isBeyond_;
  const Visit& visit_;
  std::shared_ptr<const LeafRuns> runs_;
};

}  // namespace surfeit
