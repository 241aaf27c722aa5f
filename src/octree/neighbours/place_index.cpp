#include "octree/neighbours/place_index.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <utility>
#include <vector>

#include "core/spherical_harmonics.h"
#include "octree/neighbours/leaf_visit.h"
#include "octree/neighbours/nearest_kernel.h"

namespace surfeit {
namespace {

// Places that are copied, and surfels that they serve at most.
constexpr std::size_t kMostPlaces = 24576, kServedSurfels = 8192, kFewSurfels = 64;
// How far from the surfels places are copied: so many times their spacing, if they are a sheet.
constexpr float kMarginSpacings = 4;
// Surfels in a box. Many small boxes hold a run of the curve better than one that holds all.
constexpr std::size_t kBoxed = 64;
// Places of a run with bounds.
constexpr std::size_t kRun = 16;
// What is looked at for the nearest, over the squared distance of the last one's farthest; and as
// often as these are too few, over that. Any will do.
constexpr float kRoom = 1.5f, kMoreRoom = 2.5f;
// A group with more places around it is searched in two halves: it lies apart on the curve.
constexpr std::size_t kMostCandidates = 1024;
// More are cut to those that are asked for before they are sorted.
constexpr std::size_t kSortedAtOnce = 96;

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr float kNoPlace = std::numeric_limits<float>::quiet_NaN();

struct Place {
  glm::vec3 position{0};
  glm::vec3 normal{0};      // of the first surfel there
  std::uint32_t count = 0;  // surfels
  std::uint64_t id = 0;     // of the first one
};

float more(float squared, float most) {
  return squared > 0 ? std::min(kMoreRoom * squared, most) : most;
}

void clear(PlaceColumns& columns) {
  for (std::vector<float>* const column : {&columns.x, &columns.y, &columns.z}) column->clear();
}
void add(PlaceColumns& columns, const glm::vec3& p) {
  columns.x.push_back(p.x), columns.y.push_back(p.y), columns.z.push_back(p.z);
}
void pad(PlaceColumns& columns) {
  for (std::size_t i = 0; i < PlaceColumns::kPadding; ++i) add(columns, glm::vec3(kNoPlace));
}

}  // namespace

struct PlaceIndex::State {
  using Group = std::span<const std::size_t>;

  const NearestKernel& kernel = fastestNearestKernel();
  // Around those that are served. All places within the margin are here, and some others.
  BoxColumns boxes;
  float margin = 0;
  std::vector<Place> places;  // along the curve
  PlaceColumns columns;       // their positions
  BoxColumns runs;
  // How far the nearest of the last group and of the last place in it lay: where to look first.
  float group_reach_sq = 0, place_reach_sq = 0;

  // Scratch
  std::array<NearestPlaces, kGroup> nearest;
  std::vector<std::uint32_t> near_runs, candidates, within, order;
  PlaceColumns candidate_columns;
  std::vector<float> distances_sq, kth;
  std::vector<std::int32_t> ranks;

  Status serve(Group wanted, std::span<const Surfel> surfels, std::size_t count,
               PagedOctree::Reader& reader, const Visit& visit);
  Status visitGroup(Group group, std::span<const Surfel> surfels, std::size_t count,
                    PagedOctree::Reader& reader, const Visit& visit);

  float boxWanted(Group wanted, std::span<const Surfel> surfels);
  Result<bool> read(PagedOctree::Reader& reader);
  Result<bool> addRange(const NodeRange& range, PagedOctree::Reader& reader);
  void take(const Surfel& surfel, std::uint64_t id);
  void sortPlaces();
  void boundRuns();

  void findGroup(std::span<const glm::vec3> positions, std::size_t count,
                 std::span<NearestPlaces> found, std::span<bool> is_found);
  void gather(const Bounds3& around, float reach_sq);
  bool findAmongCandidates(const glm::vec3& position, std::size_t count, float reach_sq);
  void sortWithin(std::size_t count);
  void collect(const glm::vec3& position, std::size_t count, NearestPlaces& found);
};

// Takes a copy of what lies within the margin. False, and then empty, when that is too much.
Result<bool> PlaceIndex::State::read(PagedOctree::Reader& reader) {
  places.clear();
  clear(columns);
  SURFEIT_ASSIGN_OR_RETURN(const bool fits, addRange(kRootRange, reader));
  if (!fits) places.clear();
  sortPlaces();
  for (const Place& place : places) add(columns, place.position);
  pad(columns);
  boundRuns();
  return fits;
}

Result<bool> PlaceIndex::State::addRange(const NodeRange& range, PagedOctree::Reader& reader) {
  SURFEIT_ASSIGN_OR_RETURN(const std::span<const Node> nodes, reader.nodes(range));
  const auto distanceTo = [&](const PlaceBounds& bounds) {
    const float reach = (margin + bounds.radius) * 1.00001f, *at = &bounds.centre.x;
    return kernel.isAnyBoxWithin(boxes, at, at, reach * reach) ? 0.f : 1.f;
  };
  const auto isBeyond = [&](float distance) { return distance > 0 || places.size() > kMostPlaces; };
  // Small leaves are taken whole
  bool is_large = false;
  const auto visit = [&](const Surfel& surfel, std::uint64_t id) {
    if (!is_large || distanceTo({surfel.position, 0}) == 0) take(surfel, id);
  };
  std::array<NodeLink, 8> links;
  std::size_t near = 0;
  for (const Node& node : nodes) {
    if (!isBeyond(distanceTo(boundsOf(node)))) links[near++] = NodeLink(node);
  }
  for (const NodeLink& link : std::span(links).first(near)) {
    bool fits = true;
    if (link.isLeaf()) {
      is_large = link.leaf.count > kBoxed;
      SURFEIT_RETURN_IF_ERROR(LeafVisit(link.leaf, reader, distanceTo, isBeyond, visit).run());
      fits = places.size() <= kMostPlaces;
    } else {
      SURFEIT_ASSIGN_OR_RETURN(fits, addRange(link.children, reader));
    }
    if (!fits) return false;
  }
  return true;
}

// Surfels at one position follow each other on the curve.
void PlaceIndex::State::take(const Surfel& surfel, std::uint64_t id) {
  if (!places.empty() && places.back().position == surfel.position) {
    Place& place = places.back();
    ++place.count;
    if (id < place.id) place.id = id, place.normal = normalOf(surfel);
    return;
  }
  Place& place = places.emplace_back();
  place.position = surfel.position;
  place.normal = normalOf(surfel);
  place.count = 1;
  place.id = id;
}

void PlaceIndex::State::sortPlaces() {
  const auto isLess = [](const Place& a, const Place& b) { return a.id < b.id; };
  if (std::is_sorted(places.begin(), places.end(), isLess)) return;
  std::sort(places.begin(), places.end(), isLess);
  std::size_t kept = 0;
  for (std::size_t i = 0; i < places.size(); ++i) {
    if (kept > 0 && places[kept - 1].position == places[i].position) {
      places[kept - 1].count += places[i].count;
    } else {
      places[kept++] = places[i];
    }
  }
  places.resize(kept);
}

void PlaceIndex::State::boundRuns() {
  clear(runs.low), clear(runs.high);
  for (std::size_t begin = 0; begin < places.size(); begin += kRun) {
    Bounds3 bounds;
    const std::size_t count = std::min(kRun, places.size() - begin);
    for (const Place& place : std::span(places).subspan(begin, count)) bounds.add(place.position);
    add(runs.low, bounds.min), add(runs.high, bounds.max);
  }
  pad(runs.low), pad(runs.high);
}

// The places of the runs that have some within `reach_sq` of the box around a group.
void PlaceIndex::State::gather(const Bounds3& around, float reach_sq) {
  near_runs.resize(runs.low.x.size());
  const std::size_t near =
      kernel.boxesWithin(runs, &around.min.x, &around.max.x, reach_sq, near_runs.data());
  candidates.clear(), clear(candidate_columns);
  for (const std::size_t run : std::span(near_runs).first(near)) {
    const std::size_t begin = run * kRun, end = std::min(begin + kRun, places.size());
    for (std::size_t i = begin; i < end; ++i) candidates.push_back(std::uint32_t(i));
    const auto append = [&](const std::vector<float>& from, std::vector<float>& to) {
      to.insert(to.end(), from.begin() + std::ptrdiff_t(begin), from.begin() + std::ptrdiff_t(end));
    };
    append(columns.x, candidate_columns.x);
    append(columns.y, candidate_columns.y);
    append(columns.z, candidate_columns.z);
  }
  pad(candidate_columns);
}

// Leaves `count` candidates or more in `within`, all of a distance or none, where there are as many
// within `reach_sq`.
bool PlaceIndex::State::findAmongCandidates(const glm::vec3& position, std::size_t count,
                                            float reach_sq) {
  const std::size_t room = candidate_columns.x.size();
  within.resize(room), distances_sq.resize(room);
  for (float most_sq = std::min(kRoom * place_reach_sq, reach_sq);;
       most_sq = more(most_sq, reach_sq)) {
    const std::size_t near = kernel.placesWithin(candidate_columns, &position.x, most_sq,
                                                 within.data(), distances_sq.data());
    if (near >= count) {
      within.resize(near), distances_sq.resize(near);
      return true;
    }
    if (most_sq >= reach_sq) return false;
  }
}

// Puts the nearest of those within into `order`: `count`, and others as far away as the last.
void PlaceIndex::State::sortWithin(std::size_t count) {
  if (within.size() > kSortedAtOnce) {
    kth = distances_sq;
    const auto last = kth.begin() + std::ptrdiff_t(count - 1);
    std::nth_element(kth.begin(), last, kth.end());
    std::size_t kept = 0;
    for (std::size_t i = 0; i < within.size(); ++i) {
      if (distances_sq[i] > *last) continue;
      within[kept] = within[i], distances_sq[kept] = distances_sq[i];
      ++kept;
    }
    within.resize(kept), distances_sq.resize(kept);
  }
  constexpr std::uint32_t kFree = std::numeric_limits<std::uint32_t>::max();
  const std::size_t size = within.size();
  distances_sq.resize(size + PlaceColumns::kPadding);
  ranks.resize(size + PlaceColumns::kPadding);
  kernel.rank(distances_sq.data(), size, ranks.data());
  order.assign(size, kFree);
  for (std::size_t i = 0; i < size; ++i) {
    std::size_t at = std::size_t(ranks[i]);
    while (order[at] != kFree) ++at;  // others are as far away
    order[at] = std::uint32_t(i);
  }
  std::size_t end = count;
  while (end < size && distances_sq[order[end]] == distances_sq[order[count - 1]]) ++end;
  order.resize(end);
  place_reach_sq = distances_sq[order.back()];
}

// What findPlaces would find.
void PlaceIndex::State::collect(const glm::vec3& position, std::size_t count,
                                NearestPlaces& found) {
  std::vector<Neighbour>& neighbours = found.neighbours;
  found.coincident = 0, found.own_normal = glm::vec3(0);
  neighbours.resize(order.size());
  std::size_t size = 0;
  float last_sq = -1;
  for (const std::uint32_t i : order) {
    const Place& place = places[candidates[within[i]]];
    if (place.position == position) {
      found.coincident = place.count;
      found.own_normal = place.normal;
      continue;
    }
    // By parts: a whole one on the stack would be read before it is written
    Neighbour& neighbour = neighbours[size];
    neighbour.offset = place.position - position;
    neighbour.normal = place.normal;
    neighbour.id = place.id;
    if (distances_sq[i] == last_sq) {
      for (std::size_t at = size; at > 0 && isBefore(neighbours[at], neighbours[at - 1]); --at) {
        std::swap(neighbours[at], neighbours[at - 1]);
      }
    }
    last_sq = distances_sq[i];
    ++size;
  }
  neighbours.resize(std::min(size, count));
  dropFarthest(found);
}

// The nearest of a group of places, of those that have them within the margin.
void PlaceIndex::State::findGroup(std::span<const glm::vec3> positions, std::size_t count,
                                  std::span<NearestPlaces> found, std::span<bool> is_found) {
  std::fill(is_found.begin(), is_found.end(), false);
  if (places.size() <= count) return;
  Bounds3 around;
  for (const glm::vec3& position : positions) around.add(position);
  const float room_sq = margin * margin;  // farther away some may not be here
  float farthest_sq = 0;
  std::size_t left = positions.size();
  for (float reach_sq = std::min(group_reach_sq, room_sq); left > 0;
       reach_sq = more(reach_sq, room_sq)) {
    gather(around, reach_sq);
    if (candidates.size() > kMostCandidates && positions.size() > 1) {
      const std::size_t half = positions.size() / 2;
      findGroup(positions.first(half), count, found.first(half), is_found.first(half));
      return findGroup(positions.subspan(half), count, found.subspan(half), is_found.subspan(half));
    }
    for (std::size_t i = 0; i < positions.size(); ++i) {
      // A place of the octree is its own nearest
      if (is_found[i] || !findAmongCandidates(positions[i], count + 1, reach_sq)) continue;
      sortWithin(count + 1);
      collect(positions[i], count, found[i]);
      farthest_sq = std::max(farthest_sq, place_reach_sq);
      is_found[i] = true;
      --left;
    }
    if (reach_sq >= room_sq) break;
  }
  if (farthest_sq > 0) group_reach_sq = 1.1f * farthest_sq;
}

// Boxes around runs of what is wanted; returns the usual spacing there.
float PlaceIndex::State::boxWanted(Group wanted, std::span<const Surfel> surfels) {
  std::vector<float> spacings;
  clear(boxes.low), clear(boxes.high);
  for (std::size_t begin = 0; begin < wanted.size(); begin += kBoxed) {
    const Group run = wanted.subspan(begin, std::min(kBoxed, wanted.size() - begin));
    Bounds3 bounds;
    for (const std::size_t i : run) bounds.add(surfels[i].position);
    add(boxes.low, bounds.min), add(boxes.high, bounds.max);
    spacings.push_back(glm::length(bounds.extent()) / std::sqrt(float(run.size())));
  }
  pad(boxes.low), pad(boxes.high);
  const auto median = spacings.begin() + std::ptrdiff_t(spacings.size() / 2);
  std::nth_element(spacings.begin(), median, spacings.end());
  return *median;
}

// With a margin as wide as the room for places allows. Surfels that there is no room for are served
// in two halves.
Status PlaceIndex::State::serve(Group wanted, std::span<const Surfel> surfels, std::size_t count,
                                PagedOctree::Reader& reader, const Visit& visit) {
  const float spacing = boxWanted(wanted, surfels);
  margin = kMarginSpacings * spacing;
  SURFEIT_ASSIGN_OR_RETURN(bool fits, read(reader));
  while (!fits && margin > spacing) {
    margin *= 0.5f;
    SURFEIT_ASSIGN_OR_RETURN(fits, read(reader));
  }
  if (!fits && wanted.size() > kFewSurfels) {
    const std::size_t half = wanted.size() / 2;
    SURFEIT_RETURN_IF_ERROR(serve(wanted.first(half), surfels, count, reader, visit));
    return serve(wanted.subspan(half), surfels, count, reader, visit);
  }
  group_reach_sq = place_reach_sq = float(count) * spacing * spacing / kPi;
  for (std::size_t begin = 0; begin < wanted.size(); begin += kGroup) {
    const Group group = wanted.subspan(begin, std::min(kGroup, wanted.size() - begin));
    SURFEIT_RETURN_IF_ERROR(visitGroup(group, surfels, count, reader, visit));
  }
  return {};
}

Status PlaceIndex::State::visitGroup(Group group, std::span<const Surfel> surfels,
                                     std::size_t count, PagedOctree::Reader& reader,
                                     const Visit& visit) {
  std::array<glm::vec3, kGroup> positions;
  std::array<bool, kGroup> is_found;
  const std::size_t size = group.size();
  for (std::size_t i = 0; i < size; ++i) positions[i] = surfels[group[i]].position;
  findGroup(std::span(positions).first(size), count, std::span(nearest).first(size),
            std::span(is_found).first(size));
  for (std::size_t i = 0; i < size; ++i) {
    if (is_found[i]) continue;
    SURFEIT_RETURN_IF_ERROR(findPlaces(positions[i], count, reader, nearest[i]));
  }
  return visit(group, std::span(nearest).first(size));
}

PlaceIndex::PlaceIndex() : state_(std::make_unique<State>()) {}
PlaceIndex::PlaceIndex(PlaceIndex&&) noexcept = default;
PlaceIndex& PlaceIndex::operator=(PlaceIndex&&) noexcept = default;
PlaceIndex::~PlaceIndex() = default;

Status PlaceIndex::serve(std::span<const Surfel> places, const Wants& wants, std::size_t count,
                         PagedOctree::Reader& reader, const Visit& visit) {
  std::vector<std::size_t> wanted;
  for (std::size_t i = 0; i < places.size(); ++i) {
    if (wants(i)) wanted.push_back(i);
    if (wanted.size() < kServedSurfels && i + 1 < places.size()) continue;
    if (wanted.empty()) continue;
    SURFEIT_RETURN_IF_ERROR(state_->serve(wanted, places, count, reader, visit));
    wanted.clear();
  }
  return {};
}

Status PlaceIndex::find(const glm::vec3& position, std::size_t count, PagedOctree::Reader& reader,
                        NearestPlaces& found) {
  const State& state = *state_;
  bool is_found = state.kernel.isAnyBoxWithin(state.boxes, &position.x, &position.x, 0);
  if (is_found) state_->findGroup({&position, 1}, count, {&found, 1}, {&is_found, 1});
  return is_found ? Status() : findPlaces(position, count, reader, found);
}

std::size_t PlaceIndex::memoryBytes() {
  // Places and their columns twice, runs, what is near and its order: all of it may have grown to
  // twice that
  constexpr std::size_t kPlaceBytes = sizeof(Place) + 6 * sizeof(float) + 6 * sizeof(float);
  return 2 * kMostPlaces * kPlaceBytes + kServedSurfels * sizeof(std::size_t);
}

}  // namespace surfeit
