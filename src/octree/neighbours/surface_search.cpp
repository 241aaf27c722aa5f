#include "octree/neighbours/surface_search.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <glm/geometric.hpp>
#include <iterator>
#include <optional>
#include <vector>

#include "core/spherical_harmonics.h"
#include "core/worker_threads.h"
#include "octree/neighbours/surface_fits.h"

namespace surfeit {
namespace {

// Neighbours looked at first, and while cells are open: of random places all but one of a thousand
// cells are settled by 24; scan lines twenty times as far apart as their points take 96.
constexpr std::size_t kNeighbours = 24, kMoreNeighbours[] = {48, 96};
// Farther places that cut a cell: each is the nearest that does, so few suffice.
constexpr int kMostFarther = 32;
// Strays: radii of open cells are limited to this many times the distance of the neighbours from
// each other.
constexpr float kOpenLimit = 4;
// Of the distance to a place: where others are nearer to it than this, places are denser there.
constexpr float kAsSparse = 0.25f;

glm::vec3 normalOf(const Surfel& surfel) {
  return surfel.isSphere() ? glm::vec3(0) : surfel.normal;
}

}  // namespace

SurfaceSearch::SurfaceSearch(PagedOctree& octree)
    : reader_(std::make_unique<PagedOctree::Reader>(octree)),
      widest_(float(octree.file().header().cube.size)) {}

std::size_t SurfaceSearch::memoryBytes() {
  return PlaceIndex::memoryBytes() + 2 * sizeof(SurfaceFitLanes);
}

Status SurfaceSearch::find(std::span<const Surfel> places, const Wants& wants, const Take& take,
                           const Progress& progress) {
  // Surfels at one position follow each other, and a search among a million of them should happen
  // once. Noted now, for take() may change places
  std::vector<bool> is_like_last(places.size());
  for (std::size_t i = 1; i < places.size(); ++i) {
    const Surfel &place = places[i], &last = places[i - 1];
    is_like_last[i] = place.position == last.position && place.isSphere() == last.isSphere() &&
                      wants(i) == wants(i - 1);
  }
  const auto takeAlike = [&](std::size_t i, const SurfaceAt& surface) {
    do take(i, surface);
    while (++i < places.size() && is_like_last[i]);
  };
  open_.clear();
  const Status status = index_.serve(
      places, [&](std::size_t i) { return wants(i) != SurfaceNeeds() && !is_like_last[i]; },
      kNeighbours, *reader_,
      [&](std::span<const std::size_t> group, std::span<NearestPlaces> found) -> Status {
        if (progress.isCancelled()) return Status::interrupted();
        fit(group, found, places, wants);
        for (std::size_t lane = 0; lane < group.size(); ++lane) {
          const std::size_t i = group[lane];
          SURFEIT_RETURN_IF_ERROR(
              findAt({i, places[i].position, wants(i)}, lane, found[lane], takeAlike));
        }
        return {};
      });
  return status.ok() ? findOpen(takeAlike) : status;
}

void SurfaceSearch::fit(std::span<const std::size_t> group, std::span<const NearestPlaces> found,
                        std::span<const Surfel> places, const Wants& wants) {
  SurfaceNeeds any;
  for (std::size_t lane = 0; lane < group.size(); ++lane) {
    const Surfel& place = places[group[lane]];
    const NearestPlaces& nearest = found[lane];
    // The first of those at one position tells for all
    const bool is_first_known = !place.isSphere() && nearest.own_normal != glm::vec3(0);
    group_[lane] = {nearest.neighbours, nearest.reach,
                    is_first_known ? nearest.own_normal : normalOf(place)};
    const SurfaceNeeds needs = wants(group[lane]);
    any.size |= needs.size, any.normal |= needs.normal;
  }
  cells_.fit(std::span(group_).first(group.size()), any.normal);
  if (any.size) cells_.measure();
}

// At a place of the group, with its nearest. A cell that more neighbours may cut waits for others.
Status SurfaceSearch::findAt(const Spot& spot, std::size_t lane, const NearestPlaces& nearest,
                             const Take& take) {
  const SurfacePlane plane = cells_.planeOf(lane);
  SurfaceAt surface;
  surface.normal = plane.normal;
  surface.confidence = plane.confidence;
  surface.thickness = plane.thickness;
  surface.own_normal = nearest.own_normal;
  if (!spot.needs.size && !plane.is_line) {
    take(spot.index, surface);
    return {};
  }
  if (spot.needs.size) surface.height = cells_.heightOf(lane);
  const OpenPlace place{spot, group_[lane].normal, surface, plane.is_line, nearest.coincident};
  const SurfaceCell cell = cells_.cellOf(lane);
  if (cell.is_settled || std::isinf(nearest.reach)) {
    return finish(place, cell, nearest.reach, cells_, take);
  }
  open_.push_back(place);
  return open_.size() == PlaceIndex::kGroup ? findOpen(take) : Status();
}

// With more neighbours, and still more, at the places with open cells.
Status SurfaceSearch::findOpen(const Take& take) {
  for (const std::size_t count : kMoreNeighbours) {
    bool with_normals = false;
    for (std::size_t lane = 0; lane < open_.size(); ++lane) {
      const OpenPlace& place = open_[lane];
      NearestPlaces& found = wider_[lane];
      SURFEIT_RETURN_IF_ERROR(index_.find(place.spot.position, count, *reader_, found));
      wider_group_[lane] = {found.neighbours, found.reach, place.normal};
      with_normals |= place.is_line && place.spot.needs.normal;
    }
    wider_cells_.fit(std::span(wider_group_).first(open_.size()), with_normals);
    std::size_t left = 0;
    for (std::size_t lane = 0; lane < open_.size(); ++lane) {
      OpenPlace place = open_[lane];
      const SurfaceCell cell = wider_cells_.cellOf(lane);
      const float reach = wider_[lane].reach;
      if (!cell.is_settled && !std::isinf(reach) && count != *std::rbegin(kMoreNeighbours)) {
        open_[left++] = place;
        continue;
      }
      // The plane is that of the nearest, unless they lie on a line
      if (place.is_line) {
        const SurfacePlane plane = wider_cells_.planeOf(lane);
        place.surface.normal = plane.normal;
        place.surface.confidence = plane.confidence;
        place.surface.thickness = plane.thickness;
      }
      SURFEIT_RETURN_IF_ERROR(finish(place, cell, reach, wider_cells_, take));
    }
    open_.resize(left);
  }
  return {};
}

// Closes the cell that was made last, if it is open, and hands on what was found.
Status SurfaceSearch::finish(const OpenPlace& place, SurfaceCell cell, float reach,
                             SurfaceCells& cells, const Take& take) {
  // The normal tells the surface that places farther away belong to; without one they may be strays
  const bool has_normal = place.normal != glm::vec3(0);
  const bool is_doubtful = !cell.is_settled && !has_normal;
  if (!cell.is_settled) {
    const bool is_on_row = place.is_line || cells.isOnRow();
    if (is_on_row || cells.isSparse()) {
      SURFEIT_RETURN_IF_ERROR(cutByFarther(place.spot.position, reach, cells));
    }
    cell = cells.closed();
    if (has_normal && (!cell.is_settled || cell.area == 0)) {
      SURFEIT_RETURN_IF_ERROR(findWide(place.spot.position, cells, cell));
    }
    // Along a row places are close to each other, but not across
    if (has_normal && !is_on_row) {
      SURFEIT_ASSIGN_OR_RETURN(const bool are_alike,
                               cutBesideDense(place.spot.position, reach, cells, cell));
      const bool is_lost = !cell.is_settled && cells.isLost();
      if (!are_alike || is_lost || cell.area == 0) cell = cells.cellOfNearest();
    }
  }
  SurfaceAt surface = place.surface;
  const bool is_sheet_known = cell.sheet_thickness >= 0;
  limit(cell, is_doubtful, is_sheet_known ? cell.sheet_thickness : surface.thickness);
  if (is_sheet_known && !cell.is_lone) surface.thickness = cell.sheet_thickness;
  // There is no plane to move in
  const bool has_plane = has_normal || surface.thickness <= kLooseThickness;
  if (!has_plane) cell.middle = cell.long_side = surface.height = glm::vec3(0);
  const float coincident = float(std::max<std::uint64_t>(place.coincident, 1));
  surface.area = cell.area / coincident;
  surface.sharers = cell.sharers * coincident;
  surface.radius = cell.radius;
  surface.middle = cell.middle;
  // Rectangles on each other would cover the area of one
  if (place.coincident <= 1) surface.long_side = cell.long_side;
  take(place.spot.index, surface);
  return {};
}

// What is open may be a stray, far from neighbours that are close to each other or with hardly any;
// and strays may lie all around each other.
void SurfaceSearch::limit(SurfaceCell& cell, bool is_doubtful, float thickness) const {
  float largest = std::numeric_limits<float>::infinity();
  if (!cell.is_settled) largest = kOpenLimit * cell.neighbour_spacing;
  if (is_doubtful || std::isinf(cell.neighbour_spacing)) {
    largest = std::min(largest, largest_sparse_radius_);
  }
  if (thickness > kLooseThickness) largest = std::min(largest, largest_loose_radius_);
  if (cell.radius <= largest) return;
  cell.middle = glm::vec3(0);
  cell.radius = largest;
  cell.area = std::min(cell.area, kPi * largest * largest);
  cell.long_side = glm::vec3(0);  // cut off at both ends
}

// Cuts the open cell by what lies beyond its neighbours: the other rows of a scan, what is sparse
// beside something dense.
Status SurfaceSearch::cutByFarther(const glm::vec3& position, float reach, SurfaceCells& cells) {
  if (std::isinf(reach)) return {};  // there is nothing
  for (int i = 0; i < kMostFarther && cells.isOpen(); ++i) {
    SURFEIT_ASSIGN_OR_RETURN(const std::optional<Neighbour> place,
                             findPlace(
                                 position, cells.reach(), *reader_,
                                 [&](const PlaceBounds& bounds) { return cells.mayCut(bounds); },
                                 [&](const Neighbour& other) { return cells.wouldCut(other); }));
    if (!place || !cells.cut(*place)) break;
  }
  return {};
}

// Of a place beside something much denser all its neighbours may be of that, or of another sheet.
// What is found farther away counts where it is all around.
Status SurfaceSearch::findWide(const glm::vec3& position, SurfaceCells& cells, SurfaceCell& cell) {
  if (!cells.widen(widest_)) return {};
  SURFEIT_RETURN_IF_ERROR(cutFromCorners(position, cells));
  const SurfaceCell wide = cells.closedWide();
  if (wide.is_settled || cell.area == 0) cell = wide;
  return {};
}

// By the nearest place to the farthest corner, until there is none; then as an open cell.
Status SurfaceSearch::cutFromCorners(const glm::vec3& position, SurfaceCells& cells) {
  for (int i = 0; i < kMostFarther; ++i) {
    const glm::vec3 corner = cells.farthestCorner();
    SURFEIT_ASSIGN_OR_RETURN(
        std::optional<Neighbour> place,
        findPlace(
            position + corner, glm::length(corner), *reader_,
            [&](PlaceBounds bounds) {
              bounds.centre += corner;
              return cells.mayCut(bounds);
            },
            [&](const Neighbour& other) {
              return cells.wouldCut({other.offset + corner, other.normal, other.id});
            }));
    if (!place) break;
    place->offset += corner;
    if (!cells.cut(*place)) break;
  }
  return cutByFarther(position, 0, cells);
}

// Whether the sheet of a place far away is dense there: three others lie closer to it than a part
// of its distance. Three, since scans come in pairs.
Result<bool> SurfaceSearch::isDenseAt(const glm::vec3& position, const Neighbour& place,
                                      const SurfaceCells& cells) {
  const float reach = kAsSparse * glm::length(place.offset);
  std::array<std::uint64_t, 3> found{};
  for (std::size_t i = 0; i < found.size(); ++i) {
    SURFEIT_ASSIGN_OR_RETURN(
        const std::optional<Neighbour> other,
        findPlace(
            position + place.offset, reach, *reader_,
            [&](const PlaceBounds& bounds) {
              return glm::length(bounds.centre) < reach + bounds.radius;
            },
            [&](const Neighbour& one) {
              const bool is_new = std::find(found.begin(), found.begin() + std::ptrdiff_t(i),
                                            one.id) == found.begin() + std::ptrdiff_t(i);
              return is_new &&
                     cells.isBeside(place, {one.offset + place.offset, one.normal, one.id});
            }));
    if (!other) return false;
    found[i] = other->id;
  }
  return true;
}

// What is dense says nothing about what lies between it and the place, but that the cell ends
// there. Whether places that cut the cell from far away are on its sheet: two of them, or a third,
// are about as far from others there as from the place.
Result<bool> SurfaceSearch::cutBesideDense(const glm::vec3& position, float reach,
                                           SurfaceCells& cells, SurfaceCell& cell) {
  const std::span<const Neighbour> cutters = cells.cutters();
  float farthest = 0;
  for (const Neighbour& cutter : cutters) {
    farthest = std::max(farthest, glm::length(cutter.offset));
  }
  if (farthest <= reach) return true;
  std::size_t sparse = 0;
  float nearest_sparse = 0;
  dense_.clear();
  for (const Neighbour& cutter : cutters) {
    const float distance = glm::length(cutter.offset);
    SURFEIT_ASSIGN_OR_RETURN(const bool is_dense, isDenseAt(position, cutter, cells));
    if (is_dense) {
      dense_.push_back(cutter);
    } else if (distance > kAsSparse * farthest) {
      nearest_sparse = sparse++ == 0 ? distance : std::min(nearest_sparse, distance);
    }
  }
  if (dense_.empty()) return true;
  const std::size_t ends = cells.endAt(dense_);
  if (sparse < 2 && 2 * sparse < ends) return false;
  SURFEIT_RETURN_IF_ERROR(cutFromCorners(position, cells));
  cell = cells.closed();
  if (!cell.is_settled) cell.neighbour_spacing = std::max(cell.neighbour_spacing, nearest_sparse);
  return true;
}

Status findOnThreads(std::span<SurfaceSearch> searches, std::span<const Surfel> places,
                     const SurfaceSearch::Wants& wants, const SurfaceSearch::Take& take,
                     const Progress& progress) {
  std::atomic<std::size_t> next{0};
  FirstFailure failure;
  // Threads for a batch, which takes them tens of milliseconds
  return runOnThreads(int(searches.size()), failure, "find neighbours", [&] {
    const std::size_t t = next++;
    const std::size_t begin = places.size() * t / searches.size();
    const std::size_t end = places.size() * (t + 1) / searches.size();
    return searches[t].find(
        places.subspan(begin, end - begin), [&](std::size_t i) { return wants(begin + i); },
        [&](std::size_t i, const SurfaceAt& surface) { take(begin + i, surface); }, progress);
  });
}

}  // namespace surfeit
