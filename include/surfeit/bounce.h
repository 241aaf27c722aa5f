// Several bounces of light: the radiosity of every surfel of a paged octree file from what it
// receives, again and again (memo 08-01, section 7.4).
//
//   B_0 = the radiosity in the scene: emission and direct light
//   B_k = B_0 + albedo * E(B_{k-1}),   k = 1 .. bounces
//
// with E the irradiance that a gather finds at the surfel (surfeit/gather.h), in the unit of the
// radiosity: inside a closed shell of radiosity B it is B. A gather from the result adds one bounce
// more at its receivers.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <string>
#include <vector>

#include "surfeit/api.h"
#include "surfeit/gather.h"
#include "surfeit/job.h"
#include "surfeit/progress.h"
#include "surfeit/statistics.h"
#include "surfeit/status.h"

namespace surfeit {

// `temporary_directory` holds intermediate bounces; `strict` changes nothing.
struct BounceOptions : JobOptions {
  int bounces = 1;  // 1 to 100
  GatherQuality quality;
  // All bounces but the last are gathered at about one of so many surfels, 1 to 64, and
  // interpolated to their neighbours by distance and normal. 1: at every surfel.
  int surfels_per_receiver = 1;
  // Set of the groups of surfels that send light and cover, as in GatherOptions; all receive.
  std::uint64_t groups = kAllGroups;

  double cache_split = -1;  // as in GatherOptions
  bool direct_io = false;
};

// What one bounce did.
struct BouncePass {
  std::uint64_t receivers = 0;  // places at which it gathered
  double gather_seconds = 0, write_seconds = 0;
  glm::dvec3 mean_radiosity{0};  // after it, by area
  double largest_change = 0;     // of any color of any surfel's radiosity, from the bounce before
  GatherCacheStats node_cache, surfel_cache;
};

struct BounceStats {
  std::uint64_t surfels = 0;
  int threads = 0;
  std::uint64_t memory_bytes = 0;
  std::uint64_t temporary_bytes = 0;  // most bytes of temporary files at any time
  std::uint64_t file_bytes = 0;       // of the result
  std::vector<BouncePass> passes;
};

// Writes `result_path`: the scene with the radiosity after so many bounces. Surfels, their order,
// pages, nodes and references are the same, bit for bit; radiosities of surfels and nodes and the
// power coefficients are new. It appears under its name only when complete.
//
// A two-sided surfel, which has one radiosity for both sides, receives the mean of what its sides
// receive; a sphere, the mean over all directions. So no light is lost, and none is made.
//
// The result depends on scene, bounces, quality, surfels_per_receiver and the machine's instruction
// set alone, bit for bit. What a surfel takes from albedo above 1 grows without end; radiosity is
// limited to 1e12.
// Errors: as indexClouds; kCorruption for a scene without albedo or radiosity; kInvalidArgument for
// one that bounce has written: its bounces would count again.
SURFEIT_API Result<BounceStats> bounceScene(const std::string& scene_path,
                                            const std::string& result_path,
                                            const BounceOptions& options, Progress& progress);

}  // namespace surfeit
