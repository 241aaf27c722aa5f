// The inner loops of a search of nearest places, for the instruction set of the machine. Sums are
// rounded alike on all of them: the results do not depend on the machine.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace surfeit {

// Coordinates, side by side. Columns end in kPadding numbers that belong to no place (NaN).
struct PlaceColumns {
  static constexpr std::size_t kPadding = 16;

  std::vector<float> x, y, z;

  std::size_t size() const { return x.size() - kPadding; }
};

// Bounds of runs of places, side by side, with the same padding.
struct BoxColumns {
  PlaceColumns low, high;
};

struct NearestKernel {
  // Finds the boxes with parts no farther than sqrt(most_sq) from the box from `low` to `high`.
  // `found` has room for all boxes and the padding. Never leaves out a box with a place that
  // placesWithin would find from a position in the box.
  std::size_t (*boxesWithin)(const BoxColumns& boxes, const float* low, const float* high,
                             float most_sq, std::uint32_t* found);
  // Whether there is any.
  bool (*isAnyBoxWithin)(const BoxColumns& boxes, const float* low, const float* high,
                         float most_sq);
  // Finds the places no farther than sqrt(most_sq) from a position, and their squared distances.
  // `found` and `distance_sq` have room for all places and the padding.
  std::size_t (*placesWithin)(const PlaceColumns& places, const float* position, float most_sq,
                              std::uint32_t* found, float* distance_sq);
  // How many of the values are less than each. `values` and `ranks` have room for the padding.
  void (*rank)(const float* values, std::size_t count, std::int32_t* ranks);
};

const NearestKernel& fastestNearestKernel();
// Of all instruction sets that this machine has.
std::span<const NearestKernel> nearestKernels();

}  // namespace surfeit
