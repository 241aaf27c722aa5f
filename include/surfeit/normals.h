// Normals for clouds that have none, from the neighbours of every point.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <optional>
#include <string>

#include "surfeit/color_range.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"
#include "surfeit/up_axis.h"

namespace surfeit {

// Which of its two sides a plane faces.
struct NormalOrientation {
  enum class Toward : std::uint8_t {
    kUp,      // the up axis of the cloud: terrain, airborne scans
    kSensor,  // the place that the points were seen from
    kOutward  // away from the middle of the cloud's bounds: single objects
  };
  Toward toward = Toward::kUp;
  glm::dvec3 sensor{0};  // in the cloud's coordinates, for kSensor
};

struct NormalsOptions {
  NormalOrientation orientation;
  std::optional<UpAxis> up{};  // absent: what the cloud says (surfeit/up_axis.h)
  // Points of which the neighbours lie all around (foliage, wires) get no normal, so that they are
  // spheres; or that of the plane through these, seen from both sides.
  bool thin_is_two_sided = false;
  bool with_sizes = false;                   // radius and area, too, as index would find them
  std::string channels{}, part{}, filter{};  // of the input, as in IndexOptions
  ColorRange color_range = ColorRange::kAuto;
  std::uint64_t memory_bytes =
      0;            // of the job; 0: three quarters of what it may hold, at most 1 GiB
  int threads = 0;  // 0: all that the job may use
  std::string temporary_directory{};  // empty: as of index
};

struct NormalsStats {
  std::uint64_t points = 0;
  std::uint64_t without = 0;   // points that get no normal, or one seen from both sides
  double mean_confidence = 0;  // of those with one
  std::uint64_t memory_bytes = 0;
  std::uint64_t temporary_bytes = 0;
  double index_seconds = 0, seconds = 0;
};

// Writes `output`, whose format its name tells, with all that the input has and the properties nx
// ny nz and normal_confidence (0 to 1: how flat the neighbours lie, Pauly et al. 2002), and what
// the options ask for. Normals that the input has are replaced, which is told. An octree of the
// places stands in a temporary file meanwhile. Memory does not grow with the cloud, but where
// points come in random order it may pass a small budget by a tenth (105 of 96 MiB was seen), and
// they take ten times as long as those that come beside their neighbours. Errors: as of indexClouds
// and of the formats.
Result<NormalsStats> estimateNormals(const std::string& input, const std::string& output,
                                     const NormalsOptions& options, Progress& progress);

}  // namespace surfeit
