// Surfaces through the places of an octree: what the neighbours of a place tell of area and normal
// (docs/surfels.md, "Sizes from the neighbourhood").
#pragma once

#include <cstddef>
#include <functional>
#include <glm/vec3.hpp>
#include <limits>
#include <memory>
#include <span>

#include "octree/neighbours/places.h"
#include "octree/neighbours/surface_cell.h"
#include "octree/read/paged_octree.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"
#include "surfeit/surfel.h"

namespace surfeit {

struct SurfaceAt {
  float area = 0;    // per surfel at the place; 0: unknown
  float radius = 0;  // of a disk that is spread out as far as the piece of surface around the place
  glm::vec3 normal{0};      // of the plane through the neighbours, unit, either way; zero: unknown
  float confidence = 0;     // 1: they lie on the plane; 0: all around (Pauly et al. 2002)
  float thickness = 0;      // how far they lie off it, over the spacing: about 1 all around
  glm::vec3 own_normal{0};  // of a surfel at the place itself; zero: none
};

// One thread at a time; several search one octree.
class SurfaceSearch {
 public:
  explicit SurfaceSearch(PagedOctree& octree);

  // Besides the octree's reader.
  static std::size_t memoryBytes();

  // Calls take(i, surface) for all places i that wants(i). Those that follow each other are close
  // to each other, or it takes long. They need not be in the octree.
  using Wants = std::function<bool(std::size_t)>;
  using Take = std::function<void(std::size_t, const SurfaceAt&)>;
  // kInterrupted as soon as `progress` is cancelled.
  Status find(std::span<const Surfel> places, const Wants& wants, const Take& take,
              const Progress& progress);
  // The same at one place.
  Result<SurfaceAt> at(const Surfel& place);

  // Of places off a surface, and of those that only places farther away tell the size of (sparse
  // beside dense): no radius becomes larger.
  void limitRadii(float largest_loose, float largest_sparse) {
    largest_loose_radius_ = largest_loose;
    largest_sparse_radius_ = largest_sparse;
    has_last_ = false;
  }

 private:
  Status cutByFarther(const glm::vec3& position);

  std::unique_ptr<PagedOctree::Reader> reader_;
  PlaceIndex index_;
  SurfaceCells cells_;
  NearestPlaces found_;
  float largest_loose_radius_ = std::numeric_limits<float>::infinity();
  float largest_sparse_radius_ = std::numeric_limits<float>::infinity();
  // Surfels at one position follow each other, and a search among a million of them should happen
  // once.
  bool has_last_ = false;
  glm::vec3 last_position_{0};
  SurfaceAt last_;
};

// The same by a thread for each search, in slices of the places; wants and take are called by all
// at once.
Status findOnThreads(std::span<SurfaceSearch> searches, std::span<const Surfel> places,
                     const SurfaceSearch::Wants& wants, const SurfaceSearch::Take& take,
                     const Progress& progress);

}  // namespace surfeit
