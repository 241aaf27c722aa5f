// Radii for clouds that have none: from the density of the cloud around each record, counted in a
// grid of bounded size while the cloud streams by once.
//
// A surface with normal n cuts (|nx| + |ny| + |nz|) / h^2 cells of edge h per unit of area, 3/2
// on average over all directions. So the occupied cells around a place tell the surface area
// there, the records in them the area per record, and its root is the spacing s of the records.
// Disks of radius s / sqrt 2 just close a square grid; irregular captures need more.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <limits>
#include <vector>

#include "core/bounds.h"

namespace surfeit {

// add() by one thread at a time; radiusAt() from any thread after finish().
class RadiusEstimate {
 public:
  // Bytes that a grid takes at most.
  static constexpr std::uint64_t kMaxBytes = 40u << 20;

  // A grid over `bounds` for a cloud of `count` records.
  RadiusEstimate(const Bounds3d& bounds, std::uint64_t count);

  void add(const glm::dvec3& position);
  // Turns counts into radii.
  void finish();

  // The radius for a record at `position`; > 0, at most three times the mean.
  float radiusAt(const glm::dvec3& position) const;
  // Mean over the records.
  float meanRadius() const { return mean_radius_; }

 private:
  // A grid of cells of equal size. Each level's cells are twice as large as the last one's.
  struct Level {
    double cell_size = 1;
    std::array<std::size_t, 3> cells{1, 1, 1};
    std::vector<std::uint32_t> count;
    std::vector<float> radius;  // 0: too few records around to tell

    std::array<std::size_t, 3> cellOf(const glm::dvec3& offset) const;
    std::size_t index(std::size_t x, std::size_t y, std::size_t z) const {
      return (z * cells[1] + y) * cells[0] + x;
    }
  };

  glm::dvec3 origin_{0};
  std::vector<Level> levels_;
  float mean_radius_ = 0;
  float max_radius_ = std::numeric_limits<float>::infinity();
};

}  // namespace surfeit
