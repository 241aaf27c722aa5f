// Where a moving sensor was at any time.
#pragma once

#include <glm/vec3.hpp>
#include <string>
#include <vector>

#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

// Immutable: threads may share it.
class Trajectory {
 public:
  // Of so many places at most; of longer ones every N-th, which is told.
  static constexpr std::size_t kMostPlaces = 65536;

  // A cloud of places with their times: gps_time, time or t. Rows in any order; those that are not
  // finite are left out. kCorruption when it lacks any of that or has no rows.
  static Result<Trajectory> read(const std::string& path, Progress& progress);

  bool covers(double time) const;
  // On the line between the places before and after; the nearest end outside.
  glm::dvec3 at(double time) const;

 private:
  struct Place {
    double time = 0;
    glm::dvec3 position{0};
  };
  std::vector<Place> places_;  // ascending by time
};

}  // namespace surfeit
