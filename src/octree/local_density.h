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

#include "core/spherical_harmonics.h"
#include "octree/normal_rule.h"
#include "octree/paged_octree.h"
#include "octree/sorted_surfels.h"
#include "octree/surface_search.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

// Marks surfels whose radius and area are to be found, and those whose normal may point to either
// side of their surface (orientation.h); never in a finished file.
inline constexpr std::uint32_t kSurfelNeedsSize = 1u << 7, kSurfelNeedsSide = 1u << 6;
// Radius and area of such a surfel meanwhile: positive, because pages hold nothing else.
inline constexpr float kPlaceholderSize = 1e-30f;
// Surfels with a coverage keep their radius and have the coverage times the placeholder as area:
// what is found is the area.

// The surfels of a scene in curve order, with sizes filled in, and with `normals` the normals of
// those without. The neighbour search goes through the scene's own caches, so memory stays within
// their budget. `overlap`: disk area over surfel area.
class SizedSurfelStream : public SortedSurfelStream {
 public:
  SizedSurfelStream(PagedOctree& octree, float overlap, std::optional<NormalRule> normals,
                    int threads);
  ~SizedSurfelStream() override;

  // What searches of so many threads take, besides the octree's own readers.
  static std::size_t searcherBytes(int threads);

  // Samples the cloud for the limit below. Call once, before next().
  Status prepare();
  // No radius off a surface becomes larger: strays far from everything would cover the scene.
  float largestRadius() const { return largest_radius_; }

  // So far.
  std::uint64_t normalsFound() const { return normals_found_; }
  std::uint64_t thinSurfels() const { return thin_surfels_; }

  Result<std::shared_ptr<const SortedBatch>> next() override;

 private:
  float coveringArea(float coverage, float radius, float local_area) const;
  Status readPages(std::uint32_t end_page);
  bool needsNormal(const Surfel& surfel) const { return normals_ && surfel.isSphere(); }
  void applySize(Surfel& surfel, const SurfaceAt& surface) const;
  void applyNormal(Surfel& surfel, const SurfaceAt& surface);

  PagedOctree& octree_;
  float overlap_;
  std::optional<NormalRule> normals_;
  std::vector<SurfaceSearch> searchers_;
  float largest_radius_ = 0;
  std::uint32_t next_page_ = 0;
  std::vector<Surfel> surfels_;  // of the pages being sized
  std::atomic<std::uint64_t> normals_found_ = 0, thin_surfels_ = 0;
};

// The rules that need no neighbourhood; marks surfels that do.
void applySizeRules(Surfel& surfel, float overlap);

// Area of a surfel whose disk has this radius. Never zero, even where the square is.
inline float areaOfDisk(float radius, float overlap) {
  return std::max(kPi * radius * radius / overlap, std::numeric_limits<float>::min());
}

}  // namespace surfeit
