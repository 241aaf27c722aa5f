// How normals are found where a cloud has none: `surfeit normals` and `surfeit index --normals`.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <string>

namespace surfeit {

// Which of its two sides a plane faces.
struct NormalOrientation {
  enum class Toward : std::uint8_t {
    kUp,          // the up axis of the cloud: terrain, airborne scans
    kSensor,      // the place that the points were seen from
    kOutward,     // away from the middle of the cloud's bounds: single objects, about round
    kConsistent,  // as the neighbours do: closed surfaces outward, open ones up
    kTrajectory   // the place of the sensor when it saw the point; of surfeit/normals.h only
  };
  Toward toward = Toward::kUp;
  glm::dvec3 sensor{0};  // finite, in the cloud's coordinates, for kSensor
  // For kTrajectory: a cloud of the sensor's places with their times, as gps_time, time or t; in
  // units and coordinates of the points, which must have a gps_time.
  std::string trajectory{};
};

struct NormalEstimation {
  NormalOrientation orientation;
  // Points of which the neighbours lie all around (foliage, wires) get no normal, so that they are
  // spheres; or that of the plane through these, seen from both sides.
  bool thin_is_two_sided = false;
};

}  // namespace surfeit
