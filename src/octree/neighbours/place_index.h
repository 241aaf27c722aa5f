// The nearest places of many that lie close to each other, from a copy of what lies around them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <memory>
#include <span>

#include "core/bounds.h"
#include "octree/neighbours/places.h"
#include "octree/read/paged_octree.h"
#include "surfeit/status.h"
#include "surfeit/surfel.h"

namespace surfeit {

// Places in runs along the curve, with bounds. One thread at a time.
class PlaceIndex {
 public:
  // Places that are searched at once.
  static constexpr std::size_t kGroup = 16;

  PlaceIndex();
  PlaceIndex(PlaceIndex&&) noexcept;
  PlaceIndex& operator=(PlaceIndex&&) noexcept;
  ~PlaceIndex();

  // Finds the `count` nearest of all places that wants(i), as many at a time as there is room for
  // what lies around them, and calls visit(group, found), up to kGroup at a time. Those that follow
  // each other are close to each other, or it takes long; they need not be in the octree.
  using Wants = std::function<bool(std::size_t)>;
  using Visit = std::function<Status(std::span<const std::size_t>, std::span<NearestPlaces>)>;
  Status serve(std::span<const Surfel> places, const Wants& wants, std::size_t count,
               PagedOctree::Reader& reader, const Visit& visit);

  // The nearest of one place: fast where it was visited of late.
  Status find(const glm::vec3& position, std::size_t count, PagedOctree::Reader& reader,
              NearestPlaces& found);

  // While it serves.
  static std::size_t memoryBytes();

 private:
  struct Service;
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace surfeit
