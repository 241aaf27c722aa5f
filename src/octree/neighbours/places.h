// The different places of surfels, and which of them are nearest to one, through the octree
// (place_index.h: from a copy of what lies around many).
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <optional>
#include <span>
#include <vector>

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

// Sorted by distance, then by offset.
bool isBefore(const Neighbour& a, const Neighbour& b);

// Drops the farthest of those in order, since others as far away may not be among them: what is
// found must not depend on how it was. Where all are as far, all stay.
void dropFarthest(NearestPlaces& found);

// The nearest places, `count` or fewer, through the octree.
Status findPlaces(const glm::vec3& position, std::size_t count, PagedOctree::Reader& reader,
                  NearestPlaces& found);

// The nearest place that isWanted(place), nearer than `most_distance`; none where there is none.
// Offsets are from `position`. What lies in bounds is visited where mayHold(bounds).
Result<std::optional<Neighbour>> findPlace(const glm::vec3& position, float most_distance,
                                           PagedOctree::Reader& reader,
                                           const std::function<bool(const PlaceBounds&)>& mayHold,
                                           const std::function<bool(const Neighbour&)>& isWanted);

}  // namespace surfeit
