// Radius and area from the neighbourhood, for clouds that bring neither (docs/format.md, "Rules for
// what is missing"): the area is that of the surfel's cell among its neighbours.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "core/spherical_harmonics.h"
#include "octree/paged_octree.h"
#include "octree/places.h"
#include "octree/sorted_surfels.h"
#include "octree/surface_cell.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

// Marks surfels whose radius and area are to be found; never in a finished file.
inline constexpr std::uint32_t kSurfelNeedsSize = 1u << 7;
// Radius and area of such a surfel meanwhile: positive, because pages hold nothing else.
inline constexpr float kPlaceholderSize = 1e-30f;
// Surfels with a coverage keep their radius and have the coverage times the placeholder as area:
// what is found is the area.

// The surfels of a scene in curve order, with sizes filled in. The neighbour search goes through
// the scene's own caches, so memory stays within their budget. `overlap`: disk area over surfel
// area.
class SizedSurfelStream : public SortedSurfelStream {
 public:
  SizedSurfelStream(PagedOctree& octree, float overlap, int threads);
  ~SizedSurfelStream() override;

  // Samples the cloud for the limit below. Call once, before next().
  Status prepare();
  // No radius off a surface becomes larger: strays far from everything would cover the scene.
  float largestRadius() const { return largest_radius_; }

  Result<std::shared_ptr<const SortedBatch>> next() override;

 private:
  // A reader and what it found last: surfels at one position follow each other, and a search
  // among a million of them should happen once.
  struct Searcher {
    std::unique_ptr<PagedOctree::Reader> reader;
    PlaceIndex places;
    SurfaceCells cells;
    NearestPlaces found;
    bool has_last = false;
    glm::vec3 last_position{0};
    float last_area = 0;
    float largest_loose_area = std::numeric_limits<float>::infinity();

    // Sizes all surfels that need it, which lie close to each other.
    using Sizing = std::function<void(Surfel& surfel, float area)>;
    Status serve(std::span<Surfel> surfels, const Sizing& sizing);
    // The area of a place, shared among the surfels there; 0: unknown.
    Result<float> areaAt(const Surfel& surfel);
  };

  float coveringArea(float coverage, float radius, float local_area) const;
  Status readPages(std::uint32_t end_page);
  void applyArea(Surfel& surfel, float area) const;
  Status fillSizes(Searcher& searcher, std::span<Surfel> surfels) const;

  PagedOctree& octree_;
  float overlap_;
  std::vector<Searcher> searchers_;
  float largest_radius_ = 0;
  std::uint32_t next_page_ = 0;
  std::vector<Surfel> surfels_;  // of the pages being sized
};

// Area of a surfel whose disk has this radius. Never zero, even where the square is.
inline float areaOfDisk(float radius, float overlap) {
  return std::max(kPi * radius * radius / overlap, std::numeric_limits<float>::min());
}

}  // namespace surfeit
