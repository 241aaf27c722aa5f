// Surfaces through the places of an octree: what the neighbours of a place tell of area and normal
// (docs/surfels.md, "Sizes from the neighbourhood").
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "octree/neighbours/place_index.h"
#include "octree/neighbours/surface_cell.h"
#include "octree/read/paged_octree.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"
#include "surfeit/surfel.h"

namespace surfeit {

// Of the neighbours of strays, in spacings; a surface with noise may have as much, which does no
// harm: only radii 8 times the median's are limited.
inline constexpr float kLooseThickness = 0.4f;

struct SurfaceAt {
  float area = 0;     // per surfel at the place; 0: unknown
  float sharers = 1;  // surfels at the place, or nearly there
  float radius = 0;  // of a disk that is spread out as far as the piece of surface around the place
  glm::vec3 middle{0};      // SurfaceCell::middle
  glm::vec3 height{0};      // SurfaceCells::heightOf
  glm::vec3 long_side{0};   // SurfaceCell::long_side, of a surfel's area
  glm::vec3 normal{0};      // of the plane through the neighbours, unit, either way; zero: unknown
  float confidence = 0;     // 1: they lie on the plane; 0: all around (Pauly et al. 2002)
  float thickness = 0;      // how far they lie off it, over the spacing: about 1 all around
  glm::vec3 own_normal{0};  // of a surfel at the place itself; zero: none
};

// What of it is asked for: area and radius; confidence and thickness; these and the normal.
struct SurfaceNeeds {
  bool size = false, plane = false, normal = false;

  bool operator==(const SurfaceNeeds&) const = default;
};

// One thread at a time; several search one octree.
class SurfaceSearch {
 public:
  explicit SurfaceSearch(PagedOctree& octree);

  // Besides the octree's reader.
  static std::size_t memoryBytes();

  // Calls take(i, surface) for all places i, in any order, with what wants(i). Those that follow
  // each other are close to each other, or it takes long. They need not be in the octree.
  using Wants = std::function<SurfaceNeeds(std::size_t)>;
  using Take = std::function<void(std::size_t, const SurfaceAt&)>;
  // kInterrupted as soon as `progress` is cancelled.
  Status find(std::span<const Surfel> places, const Wants& wants, const Take& take,
              const Progress& progress);

  // Of places off a surface; and of those without a normal, or with hardly any neighbours, that
  // only places farther away tell the size of: no radius becomes larger.
  void limitRadii(float largest_loose, float largest_sparse) {
    largest_loose_radius_ = largest_loose;
    largest_sparse_radius_ = largest_sparse;
  }

 private:
  struct Spot {
    std::size_t index = 0;
    glm::vec3 position{0};
    SurfaceNeeds needs;
  };
  // With what is known so far.
  struct OpenPlace {
    Spot spot;
    glm::vec3 normal{0};  // its own; zero: none
    SurfaceAt surface;
    bool is_line = false;  // the nearest lie on one
    std::uint64_t coincident = 0;
  };

  void fit(std::span<const std::size_t> group, std::span<const NearestPlaces> found,
           std::span<const Surfel> places, const Wants& wants);
  Status findAt(const Spot& spot, std::size_t lane, const NearestPlaces& nearest, const Take& take);
  Status findOpen(const Take& take);
  Status finish(const OpenPlace& place, SurfaceCell cell, float reach, SurfaceCells& cells,
                const Take& take);
  Status findWide(const glm::vec3& position, SurfaceCells& cells, SurfaceCell& cell);
  Status cutByFarther(const glm::vec3& position, float reach, SurfaceCells& cells);
  Result<bool> isDenseAt(const glm::vec3& position, const Neighbour& place,
                         const SurfaceCells& cells);
  Result<bool> cutBesideDense(const glm::vec3& position, float reach, SurfaceCells& cells,
                              SurfaceCell& cell);
  Status cutFromCorners(const glm::vec3& position, SurfaceCells& cells);
  void limit(SurfaceCell& cell, bool is_doubtful, float thickness) const;

  std::unique_ptr<PagedOctree::Reader> reader_;
  float widest_ = 0;  // of the root cube
  PlaceIndex index_;
  std::array<CellPlace, PlaceIndex::kGroup> group_, wider_group_;
  SurfaceCells cells_, wider_cells_;  // of a group; with more neighbours
  std::vector<OpenPlace> open_;       // up to a group
  std::array<NearestPlaces, PlaceIndex::kGroup> wider_;
  std::vector<Neighbour> dense_;  // at the sides of a cell
  float largest_loose_radius_ = std::numeric_limits<float>::infinity();
  float largest_sparse_radius_ = std::numeric_limits<float>::infinity();
};

// The same by a thread for each search, in slices of the places; wants and take are called by all
// at once.
Status findOnThreads(std::span<SurfaceSearch> searches, std::span<const Surfel> places,
                     const SurfaceSearch::Wants& wants, const SurfaceSearch::Take& take,
                     const Progress& progress);

}  // namespace surfeit
