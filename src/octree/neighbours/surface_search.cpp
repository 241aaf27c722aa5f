#include "octree/neighbours/surface_search.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <glm/geometric.hpp>
#include <iterator>
#include <optional>

#include "core/spherical_harmonics.h"
#include "core/worker_threads.h"

namespace surfeit {
namespace {

// Neighbours looked at first, and while cells are open: of random places all but one of a thousand
// cells are settled by 24; scan lines twenty times as far apart as their points take 96.
constexpr std::size_t kNeighbours[] = {24, 48, 96};
// Farther places that cut a cell: each is the nearest that does, so few suffice.
constexpr int kMostFarther = 32;
// Strays: radii of open cells are limited to this many times the distance of the neighbours from
// each other.
constexpr float kOpenLimit = 4;
// Of the neighbours of strays, in spacings; a surface with noise may have as much, which does no
// harm: only radii 8 times the median's are limited.
constexpr float kLooseThickness = 0.4f;

glm::vec3 normalOf(const Surfel& surfel) {
  return (surfel.flags & kSurfelSphere) != 0 ? glm::vec3(0) : surfel.normal;
}

}  // namespace

SurfaceSearch::SurfaceSearch(PagedOctree& octree)
    : reader_(std::make_unique<PagedOctree::Reader>(octree)) {}

std::size_t SurfaceSearch::memoryBytes() { return PlaceIndex::memoryBytes(); }

Status SurfaceSearch::find(std::span<const Surfel> places, const Wants& wants, const Take& take,
                           const Progress& progress) {
  return index_.serve(places, *reader_, [&](std::size_t i) -> Status {
    if (progress.isCancelled()) return Status::interrupted();
    if (!wants(i)) return {};
    SURFEIT_ASSIGN_OR_RETURN(const SurfaceAt surface, at(places[i]));
    take(i, surface);
    return {};
  });
}

Result<SurfaceAt> SurfaceSearch::at(const Surfel& place) {
  const glm::vec3& position = place.position;
  if (has_last_ && position == last_position_) return last_;
  SurfaceCell cell, first;
  for (const std::size_t count : kNeighbours) {
    if (!index_.find(position, count, found_)) {
      SURFEIT_RETURN_IF_ERROR(findPlaces(position, count, *reader_, found_));
    }
    cell = cells_.cellOf(found_.neighbours, found_.reach, normalOf(place));
    if (count == kNeighbours[0]) first = cell;
    if (cell.is_settled || std::isinf(found_.reach)) break;
  }
  const bool is_sparse = !cell.is_settled;
  if (is_sparse) {
    SURFEIT_RETURN_IF_ERROR(cutByFarther(position));
    cell = cells_.closed(found_.neighbours);
  }
  // The plane is that of the nearest, unless they lie on a line
  const SurfaceCell& plane = first.is_line ? cell : first;
  float area = cell.area, radius = cell.radius;
  const auto limit = [&](float largest_radius) {
    radius = std::min(radius, largest_radius);
    area = std::min(area, kPi * largest_radius * largest_radius);
  };
  // What is open may be a stray, far from neighbours that are close to each other; and strays may
  // lie all around each other
  if (!cell.is_settled) limit(kOpenLimit * cell.neighbour_spacing);
  if (is_sparse) limit(largest_sparse_radius_);
  if (plane.thickness > kLooseThickness) limit(largest_loose_radius_);
  area /= float(std::max<std::uint64_t>(found_.coincident, 1));
  last_ = {area, radius, plane.normal, plane.confidence, plane.thickness, found_.own_normal};
  last_position_ = position;
  has_last_ = true;
  return last_;
}

// Cuts the open cell by what lies beyond its neighbours: the other rows of a scan, what is sparse
// beside something dense.
Status SurfaceSearch::cutByFarther(const glm::vec3& position) {
  if (std::isinf(found_.reach)) return {};  // there is nothing
  for (int i = 0; i < kMostFarther && cells_.isOpen(); ++i) {
    SURFEIT_ASSIGN_OR_RETURN(
        const std::optional<Neighbour> place,
        findPlace(
            position, cells_.reach(), *reader_,
            [&](const glm::vec3& centre, float radius) { return cells_.mayCut(centre, radius); },
            [&](const Neighbour& other) { return cells_.wouldCut(other); }));
    if (!place || !cells_.cut(*place)) break;
  }
  return {};
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
