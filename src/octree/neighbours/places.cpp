#include "octree/neighbours/places.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <optional>
#include <utility>

#include "octree/neighbours/leaf_visit.h"

namespace surfeit {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

float distanceSq(const glm::vec3& d) { return glm::dot(d, d); }

}  // namespace

bool isBefore(const Neighbour& a, const Neighbour& b) {
  const float da = distanceSq(a.offset), db = distanceSq(b.offset);
  if (da != db) return da < db;
  if (a.offset.x != b.offset.x) return a.offset.x < b.offset.x;
  if (a.offset.y != b.offset.y) return a.offset.y < b.offset.y;
  return a.offset.z < b.offset.z;
}

void dropFarthest(NearestPlaces& found) {
  std::vector<Neighbour>& neighbours = found.neighbours;
  found.reach = kInfinity;
  if (neighbours.empty()) return;
  const float farthest_sq = distanceSq(neighbours.back().offset);
  found.reach = std::sqrt(farthest_sq);
  auto end = neighbours.end();
  while (end != neighbours.begin() && distanceSq(end[-1].offset) >= farthest_sq) --end;
  if (end != neighbours.begin()) neighbours.erase(end, neighbours.end());
}

namespace {

// Calls visit(surfel, id), depth first and the nearest child first: distanceTo(bounds) tells, and
// what isBeyond(distance) is left out.
template <typename DistanceTo, typename IsBeyond, typename Visit>
Status visitNearestFirst(const NodeRange& range, PagedOctree::Reader& reader,
                         const DistanceTo& distanceTo, const IsBeyond& isBeyond,
                         const Visit& visit) {
  SURFEIT_ASSIGN_OR_RETURN(const std::span<const Node> nodes, reader.nodes(range));
  std::array<NodeLink, 8> links;
  std::array<std::pair<float, std::size_t>, 8> candidates;
  std::size_t count = 0;
  for (const Node& node : nodes) {
    const float distance = distanceTo(boundsOf(node));
    if (isBeyond(distance)) continue;
    links[count] = NodeLink(node);
    std::size_t place = count++;
    for (; place > 0 && candidates[place - 1].first > distance; --place) {
      candidates[place] = candidates[place - 1];
    }
    candidates[place] = {distance, count - 1};
  }
  for (const auto& [distance, i] : std::span(candidates).first(count)) {
    if (isBeyond(distance)) break;
    const NodeLink& link = links[i];
    if (link.isLeaf()) {
      SURFEIT_RETURN_IF_ERROR(LeafVisit(link.leaf, reader, distanceTo, isBeyond, visit).run());
    } else {
      SURFEIT_RETURN_IF_ERROR(
          visitNearestFirst(link.children, reader, distanceTo, isBeyond, visit));
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
        [&](const PlaceBounds& bounds) {
          return std::max(0.f, glm::length(bounds.centre - position_) - bounds.radius);
        },
        // Positions count, not disks; a slack of one part in a million covers rounding
        [&](float distance) { return distance * distance > limit_sq_ * 1.000001f; },
        [&](const Surfel& surfel, std::uint64_t id) { add(surfel, id); }));
    if (found_.neighbours.size() < most_) {
      found_.reach = kInfinity;  // these are all
    } else {
      dropFarthest(found_);
    }
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
  using MayHold = std::function<bool(const PlaceBounds&)>;
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
        [&](PlaceBounds bounds) {
          bounds.centre -= position_;
          bounds.radius *= 1.000001f;
          return mayHold_(bounds) ? glm::length(bounds.centre) - bounds.radius : kInfinity;
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

Result<std::optional<Neighbour>> findPlace(const glm::vec3& position, float most_distance,
                                           PagedOctree::Reader& reader,
                                           const std::function<bool(const PlaceBounds&)>& mayHold,
                                           const std::function<bool(const Neighbour&)>& isWanted) {
  WantedSearch search(position, most_distance, reader, mayHold, isWanted);
  SURFEIT_RETURN_IF_ERROR(search.run());
  return search.found();
}

}  // namespace surfeit
