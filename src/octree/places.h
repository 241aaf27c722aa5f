// The different places of surfels, and which of them are nearest to one: through the octree for any
// place, or from a copy of what lies around many.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <memory>
#include <optional>
#include <vector>

#include "core/bounds.h"
#include "octree/paged_octree.h"
#include "octree/surface_cell.h"
#include "surfeit/status.h"

namespace surfeit {

struct NearestPlaces {
  // Ascending by distance, then by offset: all places that are nearer than `reach`, but for the one
  // in question.
  std::vector<Neighbour> neighbours;
  float reach = 0;               // infinity: there are no others
  std::uint64_t coincident = 0;  // surfels at the place itself
};

// A box of places, with a k-d tree (nanoflann). One thread at a time.
class PlaceIndex {
 public:
  PlaceIndex();
  PlaceIndex(PlaceIndex&&) noexcept;
  PlaceIndex& operator=(PlaceIndex&&) noexcept;
  ~PlaceIndex();

  // Takes a copy of what lies in `box`. False, and then empty, when that is more than `most`.
  Result<bool> read(const Bounds3& box, std::size_t most, PagedOctree::Reader& reader);

  // The nearest places, `count` or fewer. False when some may lie outside of the box.
  bool find(const glm::vec3& position, std::size_t count, NearestPlaces& found);

  // For `most` places.
  static std::size_t memoryBytes(std::size_t most);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

// The same of all places, through the octree.
Status findPlaces(const glm::vec3& position, std::size_t count, PagedOctree::Reader& reader,
                  NearestPlaces& found);

// The nearest place that isWanted(place), nearer than `most_distance`; none where there is none.
// Offsets are from `position`. Spheres around places are visited where mayHold(centre, radius).
Result<std::optional<Neighbour>> findPlace(
    const glm::vec3& position, float most_distance, PagedOctree::Reader& reader,
    const std::function<bool(const glm::vec3&, float)>& mayHold,
    const std::function<bool(const Neighbour&)>& isWanted);

}  // namespace surfeit
