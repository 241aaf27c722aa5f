// What a cloud holds, and how dense a cloud or a scene is (surfeit/scene.h has the rest of a
// scene).
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <optional>
#include <string>
#include <vector>

#include "surfeit/api.h"
#include "surfeit/job.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"
#include "surfeit/surfel.h"

namespace surfeit {

// Spacing at a place is sqrt(pi r^2 / k), r being the distance of the k-th nearest other place and
// k 8, or all where there are fewer: the edge of the square that a place has for its own on a
// surface.
struct CloudDensity {
  std::uint64_t sampled = 0;  // points whose places were looked at
  // Over places: the median, and what 5 and 95 % are below. 0 where there is one place at most.
  double median_spacing = 0, low_spacing = 0, high_spacing = 0;
  double points_per_area = 0;  // of the median spacing, all points of a place counted
  double repeated_share = 0;   // of the places, those that have several points
};

// Of a PLY file, as it is stored.
struct CloudProperty {
  std::string name;
  std::string type;  // "float", "uchar", ...: of the value, or of the items of a list
  bool is_list = false;
};
struct CloudElement {
  std::string name;
  std::uint64_t count = 0;
  std::vector<CloudProperty> properties;
};

// Values of a row that belong together: "position" and its properties "x", "y", "z".
struct CloudChannel {
  std::string name;
  std::string type;  // the widest of its properties'
  std::vector<std::string> properties;
};

// The records as surfels: docs/files.md has the channels that they need.
struct CloudSurfels {
  std::uint64_t count = 0;    // valid ones
  std::uint64_t spheres = 0;  // of these, without a normal
  CloudChannels channels;
  std::string defects;  // which records are not valid, and why; empty: all are
  // Of the positions, in the cloud's coordinates; undefined where count is 0.
  glm::dvec3 min{0}, max{0};
  CloudDensity density;
};

struct CloudInfo {
  // "ply" of a PLY file that is described as it is stored; else what its reader calls it, "PLY",
  // "LAS 1.2", ...
  std::string format;
  std::vector<CloudElement> elements;  // of "ply"
  // Else records, what a record holds, and comments of the file.
  std::uint64_t records = 0;
  std::vector<CloudChannel> channels;
  std::vector<std::string> comments;
  // What the file has that records do not, and rules by which values are read, a sentence each.
  std::vector<std::string> notes;
  std::optional<CloudSurfels> surfels;  // absent where the records are none
};

// Whether the file begins like a scene (.sft). Errors: kIoError.
SURFEIT_API Result<bool> isScene(const std::string& path);

// Reads a cloud of any format, twice, or three times where it lies far from 0; takes a few MiB. A
// PLY file is described as it is stored unless options choose channels, a part or records. Calls
// are independent. Errors: kIoError, kCorruption, kInvalidArgument (options), kInterrupted.
SURFEIT_API Result<CloudInfo> readCloudInfo(const std::string& path, const ReadOptions& options,
                                            Progress& progress);

// The density of a scene, by searches in its octree: a few thousand pages are read at most, and 16
// MiB of them kept. Errors: kIoError, kCorruption, kInterrupted.
SURFEIT_API Result<CloudDensity> measureSceneDensity(const std::string& path, Progress& progress);

}  // namespace surfeit
