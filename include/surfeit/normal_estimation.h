// How normals are estimated for clouds without them: `surfeit normals`, `surfeit index --normals`.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <string>

namespace surfeit {

// Which of its two ways a normal points.
struct NormalOrientation {
  enum class Toward : std::uint8_t {
    kUp,          // along the up axis of the cloud: terrain, airborne scans
    kSensor,      // to the place that all points were seen from
    kOutward,     // away from the middle of the cloud's bounds: single objects, about round
    kConsistent,  // consistent with the neighbours: closed surfaces outward, open ones up
    kTrajectory   // to the place of the sensor when it saw the point; only for estimateNormals
  };
  Toward toward = Toward::kUp;
  glm::dvec3 sensor{0};  // finite, in the cloud's coordinates, for kSensor
  // For kTrajectory: a cloud of the sensor's positions with their times, as gps_time, time or t, in
  // the units and coordinates of the points. The points must have a gps_time.
  std::string trajectory{};
};

struct NormalEstimation {
  NormalOrientation orientation;
  // For points whose neighbours lie all around (foliage, wires). False: they get no normal, so they
  // are spheres. True: they get the normal of the plane through their neighbours, and are
  // two-sided.
  bool thin_is_two_sided = false;
};

}  // namespace surfeit
