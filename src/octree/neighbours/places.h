// The different places of surfels, and which of them are nearest to one: through the octree for any
// place, or from a copy of what lies around many.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "core/bounds.h"
#include "octree/neighbours/surface_cell.h"
#include "octree/read/paged_octree.h"
#include "surfeit/status.h"

namespace surfeit {

struct NearestPlaces {
  // Ascending by distance, then by offset: all places that are nearer than `reach`, but for the one
  // in question.
  std::vector<Neighbour> neighbours;
  float reach = 0;               // infinity: there are no others
  std::uint64_t coincident = 0;  // surfels at the place itself
  glm::vec3 own_normal{0};       // of the first of them, zero: none
};

// Of a surfel: numbers that rise along the curve, with gaps.
inline std::uint64_t surfelId(const SceneFile& file, std::uint32_t page, std::uint32_t index) {
  return std::uint64_t{page} * file.header().surfel_group_capacity + index;
}

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

  // Calls visit(i) for all places, with a box around them read each time that serves as many as it
  // can. Those that follow each other are close to each other, or it takes long.
  using Visit = std::function<Status(std::size_t)>;
  Status serve(std::span<const Surfel> places, PagedOctree::Reader& reader, const Visit& visit);

  // While it serves.
  static std::size_t memoryBytes();

 private:
  Status serveFrom(std::span<const Surfel> places, std::size_t first, PagedOctree::Reader& reader,
                   const Visit& visit);

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
