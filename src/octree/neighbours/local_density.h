// Radius, area and normal from the neighbourhood, for clouds that lack them (docs/format.md, "Rules
// for what is missing"): the area is that of the surfel's cell among its neighbours.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "core/curve_key.h"
#include "core/spherical_harmonics.h"
#include "octree/build/sorted_surfels.h"
#include "octree/neighbours/given_areas.h"
#include "octree/neighbours/normal_rule.h"
#include "octree/neighbours/surface_search.h"
#include "octree/page/surfel_marks.h"
#include "octree/read/paged_octree.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

// The surfels of a scene in curve order, with sizes filled in, and with `normals` the normals of
// those without. Disks that had no radius stand in the middle of their cells, as far as that is in
// their leaf of the octree. The neighbour search goes through the scene's own caches,
// so memory stays within their budget. `overlap`: disk area over surfel area.
class SizedSurfelStream : public SortedSurfelStream {
 public:
  SizedSurfelStream(PagedOctree& octree, float overlap, std::optional<NormalRule> normals,
                    int threads, const Progress& progress);
  ~SizedSurfelStream() override;

  // What searches of so many threads take, besides the octree's own readers.
  static std::size_t searcherBytes(int threads);

  // Samples the cloud for the limit below. Call once, before next().
  Status prepare();
  // Only the surfels of some pages are handed out, `end` not included; the limit below is that of
  // all. Before next().
  void setPages(std::uint32_t begin, std::uint32_t end) { next_page_ = begin, end_page_ = end; }
  // Nothing is moved to the middle of its cell: places are looked up afterwards. Before next().
  void keepPlaces() { keeps_places_ = true; }
  // No radius off a surface becomes larger: strays far from everything would cover the scene.
  float largestRadius() const { return largest_radius_; }

  // So far.
  std::uint64_t normalsFound() const { return normals_found_; }
  std::uint64_t thinSurfels() const { return thin_surfels_; }
  std::uint64_t scatteredSurfels() const { return scattered_surfels_; }

  Result<std::shared_ptr<const SortedBatch>> next() override;

 private:
  float coveringArea(float coverage, float radius, float local_area) const;
  Status readPages(std::uint32_t end_page);
  Result<std::optional<CurveKey>> keyBeside(std::uint32_t page, bool is_first) const;
  Status findLeaves();
  void moveToMiddle(std::size_t i, const glm::vec3& middle);
  void moveToSurface(std::size_t i, const glm::vec3& height);
  void take(std::size_t i, const SurfaceAt& surface);
  void shapeGiven();
  bool needsNormal(const Surfel& surfel) const { return normals_ && surfel.isSphere(); }
  void applySize(Surfel& surfel, const SurfaceAt& surface) const;
  void applyNormal(Surfel& surfel, const SurfaceAt& surface);

  PagedOctree& octree_;
  float overlap_;
  std::optional<NormalRule> normals_;
  const Progress& progress_;
  std::vector<SurfaceSearch> searchers_;
  float largest_radius_ = 0;
  bool keeps_places_ = false;
  std::uint32_t next_page_ = 0, end_page_ = 0;
  // Of the pages being sized, and where each of them begins
  std::vector<Surfel> surfels_;
  std::vector<std::size_t> page_begins_;
  std::vector<CurveKey> keys_;
  std::vector<std::uint8_t> leaf_levels_;
  std::vector<SurfaceAt> area_cells_;  // empty where no surfel has an area alone
  std::vector<Ticket> ticket_scratch_;
  std::atomic<std::uint64_t> normals_found_ = 0, thin_surfels_ = 0,
                             scattered_surfels_ = 0;
};

// The rules that need no neighbourhood; marks surfels that do.
void applySizeRules(Surfel& surfel, float overlap);

// Area of a surfel whose disk has this radius. Never zero, even where the square is.
inline float areaOfDisk(float radius, float overlap) {
  return std::max(kPi * radius * radius / overlap, std::numeric_limits<float>::min());
}

}  // namespace surfeit
