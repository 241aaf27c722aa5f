#include "octree/neighbours/places.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <nanoflann.hpp>
#include <optional>

namespace surfeit {
namespace {

// Places in the box of a PlaceIndex, and surfels that it serves at most.
constexpr std::size_t kMostPlaces = 16384, kServedSurfels = 4096, kFewSurfels = 64;
// How far the box goes beyond the surfels: so many times their spacing, if they are a sheet.
constexpr float kMarginSpacings = 6;

constexpr float kInfinity = std::numeric_limits<float>::infinity();

struct Place {
  glm::vec3 position{0};
  glm::vec3 normal{0};  // of the first surfel there
  std::uint32_t count = 0;
  std::uint64_t id = 0;  // of that one
};

// What nanoflann searches.
struct Points {
  std::vector<Place> places;

  std::size_t kdtree_get_point_count() const { return places.size(); }
  float kdtree_get_pt(std::size_t i, std::size_t axis) const {
    return places[i].position[int(axis)];
  }
  template <typename Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};
using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, Points>,
                                                 Points, 3, std::uint32_t>;
constexpr std::size_t kTreeLeaf = 16;

glm::vec3 normalOf(const Surfel& surfel) {
  return surfel.isSphere() ? glm::vec3(0) : surfel.normal;
}

// Calls visit(surfel, id) for all of a leaf.
template <typename Visit>
Status visitLeaf(const Node& leaf, const SceneFile& file, PagedOctree::Reader& reader,
                 const Visit& visit) {
  std::uint32_t page = leaf.page, first = leaf.first;
  for (std::uint64_t left = leaf.surfel_count; left > 0; ++page, first = 0) {
    SURFEIT_ASSIGN_OR_RETURN(const std::span<const Surfel> run, reader.surfels(page, first, left));
    for (std::size_t i = 0; i < run.size(); ++i) {
      visit(run[i], surfelId(file, page, first + std::uint32_t(i)));
    }
    left -= run.size();
  }
  return {};
}

// Calls visit(surfel, id) for the surfels of a leaf: of a large one for those of the runs alone of
// which not isBeyond(distanceTo(position, radius)), the nearest first.
template <typename DistanceTo, typename IsBeyond, typename Visit>
class LeafVisit {
 public:
  LeafVisit(const Node& leaf, PagedOctree::Reader& reader, const DistanceTo& distanceTo,
            const IsBeyond& isBeyond, const Visit& visit)
      : leaf_(leaf), reader_(reader), distanceTo_(distanceTo), isBeyond_(isBeyond), visit_(visit) {}

  Status run() {
    if (leaf_.surfel_count <= reader_.file().header().surfel_group_capacity) {
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
      candidates[i] = {distanceTo_(sphere.position, sphere.radius), begin + i};
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

  const Node& leaf_;
  PagedOctree::Reader& reader_;
  const DistanceTo& distanceTo_;
  const IsBeyond& isBeyond_;
  const Visit& visit_;
  std::shared_ptr<const LeafRuns> runs_;
};

float distanceSq(const glm::vec3& d) { return glm::dot(d, d); }

bool isBefore(const Neighbour& a, const Neighbour& b) {
  const float da = distanceSq(a.offset), db = distanceSq(b.offset);
  if (da != db) return da < db;
  if (a.offset.x != b.offset.x) return a.offset.x < b.offset.x;
  if (a.offset.y != b.offset.y) return a.offset.y < b.offset.y;
  return a.offset.z < b.offset.z;
}

// Drops the farthest of those in order, since others as far away may not be among them: what is
// found must not depend on how it was. Where all are as far, all stay.
void finish(NearestPlaces& found, bool are_all) {
  std::vector<Neighbour>& neighbours = found.neighbours;
  found.reach = kInfinity;
  if (are_all || neighbours.empty()) return;
  const float farthest_sq = distanceSq(neighbours.back().offset);
  found.reach = std::sqrt(farthest_sq);
  auto end = neighbours.end();
  while (end != neighbours.begin() && distanceSq(end[-1].offset) >= farthest_sq) --end;
  if (end != neighbours.begin()) neighbours.erase(end, neighbours.end());
}

// Finds equal positions by a hash.
class PlaceSet {
 public:
  void clear() {
    slots_.clear();
    places_ = nullptr;
  }
  void begin(std::vector<Place>& places) {
    places_ = &places;
    slots_.assign(1024, kFree);
  }

  void add(const Surfel& surfel, std::uint64_t id) {
    if (2 * (places_->size() + 1) > slots_.size()) grow();
    std::uint32_t& slot = slotOf(surfel.position);
    if (slot == kFree) {
      slot = std::uint32_t(places_->size());
      places_->push_back({surfel.position, normalOf(surfel), 0, id});
    }
    Place& place = (*places_)[slot];
    ++place.count;
    if (id < place.id) place.id = id, place.normal = normalOf(surfel);
  }

 private:
  static constexpr std::uint32_t kFree = ~std::uint32_t{0};

  std::uint32_t& slotOf(const glm::vec3& position) {
    std::uint64_t hash = 0;
    for (int axis = 0; axis < 3; ++axis) {
      // 0 and -0 are one place
      hash = (hash ^ std::bit_cast<std::uint32_t>(position[axis] + 0.f)) * 0x9e3779b97f4a7c15u;
      hash ^= hash >> 32;
    }
    for (std::size_t i = hash & (slots_.size() - 1);; i = (i + 1) & (slots_.size() - 1)) {
      if (slots_[i] == kFree || (*places_)[slots_[i]].position == position) return slots_[i];
    }
  }
  void grow() {
    slots_.assign(2 * slots_.size(), kFree);
    for (std::size_t i = 0; i < places_->size(); ++i) {
      slotOf((*places_)[i].position) = std::uint32_t(i);
    }
  }

  std::vector<Place>* places_ = nullptr;
  std::vector<std::uint32_t> slots_;
};

float distanceToBox(const glm::vec3& position, const Bounds3& box) {
  return glm::length(glm::max(glm::max(box.min - position, position - box.max), glm::vec3(0)));
}

bool isInside(const glm::vec3& position, const Bounds3& box) {
  return distanceToBox(position, box) == 0;
}

}  // namespace

struct PlaceIndex::State {
  Points points;
  PlaceSet set;
  Bounds3 box;
  std::optional<Tree> tree;
  std::vector<std::uint32_t> indices;
  std::vector<float> distances_sq;

  // False when there are too many.
  Result<bool> addRange(const NodeRange& range, std::size_t most, PagedOctree::Reader& reader) {
    SURFEIT_ASSIGN_OR_RETURN(const std::span<const Node> nodes, reader.nodes(range));
    // The reader may drop their page
    std::array<Node, 8> copies;
    std::copy(nodes.begin(), nodes.end(), copies.begin());
    const auto distanceTo = [&](const glm::vec3& position, float radius) {
      return distanceToBox(position, box) - radius * 1.000001f;
    };
    const auto isBeyond = [&](float distance) {
      return distance > 0 || points.places.size() > most;
    };
    const auto visit = [&](const Surfel& surfel, std::uint64_t id) {
      if (isInside(surfel.position, box)) set.add(surfel, id);
    };
    for (const Node& node : std::span(copies).first(nodes.size())) {
      if (isBeyond(distanceTo(node.position, node.radius))) continue;
      bool fits = true;
      if (node.isLeaf()) {
        SURFEIT_RETURN_IF_ERROR(LeafVisit(node, reader, distanceTo, isBeyond, visit).run());
        fits = points.places.size() <= most;
      } else {
        SURFEIT_ASSIGN_OR_RETURN(fits, addRange(childrenOf(node), most, reader));
      }
      if (!fits) return false;
    }
    return true;
  }
};

PlaceIndex::PlaceIndex() : state_(std::make_unique<State>()) {}
PlaceIndex::PlaceIndex(PlaceIndex&&) noexcept = default;
PlaceIndex& PlaceIndex::operator=(PlaceIndex&&) noexcept = default;
PlaceIndex::~PlaceIndex() = default;

Result<bool> PlaceIndex::read(const Bounds3& box, std::size_t most, PagedOctree::Reader& reader) {
  State& state = *state_;
  state.tree.reset();
  state.points.places.clear();
  state.set.begin(state.points.places);
  state.box = box;
  SURFEIT_ASSIGN_OR_RETURN(const bool fits, state.addRange(kRootRange, most, reader));
  if (!fits) {
    state.points.places.clear();
    return false;
  }
  state.tree.emplace(3, state.points, nanoflann::KDTreeSingleIndexAdaptorParams(kTreeLeaf));
  return true;
}

bool PlaceIndex::find(const glm::vec3& position, std::size_t count, NearestPlaces& found) {
  State& state = *state_;
  found = {std::move(found.neighbours)};
  found.neighbours.clear();
  if (!state.tree || !isInside(position, state.box)) return false;
  state.indices.resize(count + 1);
  state.distances_sq.resize(count + 1);
  const std::size_t size = state.tree->knnSearch(&position.x, count + 1, state.indices.data(),
                                                 state.distances_sq.data());
  for (std::size_t i = 0; i < size; ++i) {
    const Place& place = state.points.places[state.indices[i]];
    if (place.position == position) {
      found.coincident = place.count;
      found.own_normal = place.normal;
    } else {
      found.neighbours.push_back({place.position - position, place.normal, place.id});
    }
  }
  // The tree gives them by distance, but those as far away in any order
  std::vector<Neighbour>& neighbours = found.neighbours;
  for (std::size_t i = 1; i < neighbours.size(); ++i) {
    const Neighbour other = neighbours[i];
    std::size_t at = i;
    for (; at > 0 && isBefore(other, neighbours[at - 1]); --at) neighbours[at] = neighbours[at - 1];
    neighbours[at] = other;
  }
  finish(found, false);
  // Nothing outside may be nearer
  const glm::vec3 room = glm::min(position - state.box.min, state.box.max - position);
  return size == count + 1 && found.reach <= std::min({room.x, room.y, room.z});
}

Status PlaceIndex::serve(std::span<const Surfel> places, PagedOctree::Reader& reader,
                         const Visit& visit) {
  for (std::size_t begin = 0; begin < places.size(); begin += kServedSurfels) {
    const std::size_t count = std::min(kServedSurfels, places.size() - begin);
    SURFEIT_RETURN_IF_ERROR(serveFrom(places.subspan(begin, count), begin, reader, visit));
  }
  return {};
}

// The box around the surfels with a margin for their neighbours, as wide as the room for places
// allows. Surfels of which the box has no room are served in two halves.
Status PlaceIndex::serveFrom(std::span<const Surfel> places, std::size_t first,
                             PagedOctree::Reader& reader, const Visit& visit) {
  Bounds3 inner;
  for (const Surfel& surfel : places) inner.add(surfel.position);
  const float spacing = glm::length(inner.extent()) / std::sqrt(float(places.size()));
  bool fits = false;
  for (float margin = kMarginSpacings * spacing; !fits && margin >= spacing; margin *= 0.5f) {
    Bounds3 box = inner;
    box.min -= margin;
    box.max += margin;
    SURFEIT_ASSIGN_OR_RETURN(fits, read(box, kMostPlaces, reader));
  }
  if (!fits && places.size() > kFewSurfels) {
    const std::size_t half = places.size() / 2;
    SURFEIT_RETURN_IF_ERROR(serveFrom(places.first(half), first, reader, visit));
    return serveFrom(places.subspan(half), first + half, reader, visit);
  }
  for (std::size_t i = 0; i < places.size(); ++i) SURFEIT_RETURN_IF_ERROR(visit(first + i));
  return {};
}

std::size_t PlaceIndex::memoryBytes() {
  // Places, slots, indices, and nodes of the tree, all of which may have grown to twice that
  return kMostPlaces * (2 * sizeof(Place) + 4 * sizeof(std::uint32_t) + 2 * sizeof(std::uint32_t) +
                        2 * 64 / (kTreeLeaf / 4));
}

namespace {

// Calls visit(surfel, id), depth first and the nearest child first: distanceTo(position, radius)
// tells, and what isBeyond(distance) is left out. Nodes are copied because the reader may drop
// their page.
template <typename DistanceTo, typename IsBeyond, typename Visit>
Status visitNearestFirst(const NodeRange& range, PagedOctree::Reader& reader,
                         const DistanceTo& distanceTo, const IsBeyond& isBeyond,
                         const Visit& visit) {
  SURFEIT_ASSIGN_OR_RETURN(const std::span<const Node> nodes, reader.nodes(range));
  std::array<std::pair<float, Node>, 8> candidates;
  for (std::size_t i = 0; i < nodes.size(); ++i)
    candidates[i] = {distanceTo(nodes[i].position, nodes[i].radius), nodes[i]};
  const auto order = std::span(candidates).first(nodes.size());
  std::sort(order.begin(), order.end(),
            [](const auto& a, const auto& b) { return a.first < b.first; });
  for (const auto& [distance, node] : order) {
    if (isBeyond(distance)) break;
    if (node.isLeaf()) {
      SURFEIT_RETURN_IF_ERROR(LeafVisit(node, reader, distanceTo, isBeyond, visit).run());
    } else {
      SURFEIT_RETURN_IF_ERROR(
          visitNearestFirst(childrenOf(node), reader, distanceTo, isBeyond, visit));
    }
  }
  return {};
}

// Collects the nearest through the octree.
class PlaceSearch {
 public:
  PlaceSearch(const glm::vec3& position, std::size_t count, PagedOctree::Reader& reader,
              NearestPlaces& found)
      : position_(position), most_(count), reader_(reader), found_(found) {}

  Status run() {
    SURFEIT_RETURN_IF_ERROR(visitNearestFirst(
        kRootRange, reader_,
        [&](const glm::vec3& position, float radius) {
          return std::max(0.f, glm::length(position - position_) - radius);
        },
        // Positions count, not disks; a slack of one part in a million covers rounding
        [&](float distance) { return distance * distance > limit_sq_ * 1.000001f; },
        [&](const Surfel& surfel, std::uint64_t id) { add(surfel, id); }));
    finish(found_, found_.neighbours.size() < most_);
    return {};
  }

 private:
  void add(const Surfel& surfel, std::uint64_t id) {
    if (surfel.position == position_) {
      ++found_.coincident;
      if (id < own_id_) own_id_ = id, found_.own_normal = normalOf(surfel);
      return;
    }
    const Neighbour other{surfel.position - position_, normalOf(surfel), id};
    if (distanceSq(other.offset) > limit_sq_) return;
    std::vector<Neighbour>& neighbours = found_.neighbours;
    const auto at = std::lower_bound(neighbours.begin(), neighbours.end(), other, isBefore);
    if (at != neighbours.end() && at->offset == other.offset) return;
    neighbours.insert(at, other);
    if (neighbours.size() > most_) neighbours.pop_back();
    if (neighbours.size() == most_) limit_sq_ = distanceSq(neighbours.back().offset);
  }

  const glm::vec3 position_;
  const std::size_t most_;
  PagedOctree::Reader& reader_;
  NearestPlaces& found_;
  float limit_sq_ = kInfinity;
  std::uint64_t own_id_ = std::numeric_limits<std::uint64_t>::max();  // the first at the place
};

}  // namespace

Status findPlaces(const glm::vec3& position, std::size_t count, PagedOctree::Reader& reader,
                  NearestPlaces& found) {
  found = {std::move(found.neighbours)};
  found.neighbours.clear();
  return PlaceSearch(position, count, reader, found).run();
}

namespace {

// Finds the nearest of some.
class WantedSearch {
 public:
  using MayHold = std::function<bool(const glm::vec3&, float)>;
  using IsWanted = std::function<bool(const Neighbour&)>;

  WantedSearch(const glm::vec3& position, float most_distance, PagedOctree::Reader& reader,
               const MayHold& mayHold, const IsWanted& isWanted)
      : position_(position),
        limit_(most_distance),
        reader_(reader),
        mayHold_(mayHold),
        isWanted_(isWanted) {}

  Status run() {
    return visitNearestFirst(
        kRootRange, reader_,
        [&](const glm::vec3& position, float node_radius) {
          const glm::vec3 offset = position - position_;
          const float radius = node_radius * 1.000001f;
          return mayHold_(offset, radius) ? glm::length(offset) - radius : kInfinity;
        },
        [&](float distance) { return distance > limit_; },
        [&](const Surfel& surfel, std::uint64_t id) { consider(surfel, id); });
  }

  const std::optional<Neighbour>& found() const { return found_; }

 private:
  void consider(const Surfel& surfel, std::uint64_t id) {
    const Neighbour other{surfel.position - position_, normalOf(surfel), id};
    const float distance = glm::length(other.offset);
    if (distance == 0 || distance > limit_ || !isWanted_(other)) return;
    if (found_ && !isBefore(other, *found_)) return;
    found_ = other;
    limit_ = distance;
  }

  const glm::vec3 position_;
  float limit_;
  PagedOctree::Reader& reader_;
  const MayHold& mayHold_;
  const IsWanted& isWanted_;
  std::optional<Neighbour> found_;
};

}  // namespace

Result<std::optional<Neighbour>> findPlace(
    const glm::vec3& position, float most_distance, PagedOctree::Reader& reader,
    const std::function<bool(const glm::vec3&, float)>& mayHold,
    const std::function<bool(const Neighbour&)>& isWanted) {
  WantedSearch search(position, most_distance, reader, mayHold, isWanted);
  SURFEIT_RETURN_IF_ERROR(search.run());
  return search.found();
}

}  // namespace surfeit
