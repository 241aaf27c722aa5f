// Several bounces of light: computes the radiosity of every surfel of a paged octree file from the
// light that it receives, once per bounce (memo 08-01, section 7.4).
//
//   B_0 = the radiosity in the scene: emission and direct light
//   B_k = B_0 + albedo * E(B_{k-1}),   k = 1 .. bounces
//
// With a look (surfeit/bounce_look.h) B_k = B_0 + C_group(albedo * F(E(B_{k-1}))): F is its color
// correction and its filters at the surfel, C_group the correction of the surfel's object group.
//
// Glossy surfels (BounceOptions::glossy) send a part of what they reflect in a lobe around the
// mirror direction. B is what a surfel sends in all directions together, so lobes change it only by
// way of other surfels.
//
// E is the irradiance that a gather finds at the surfel (surfeit/gather.h), in the unit of the
// radiosity: inside a closed shell of radiosity B, E = B. A gather from the result adds one more
// bounce at its receivers.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <string>
#include <vector>

#include "surfeit/api.h"
#include "surfeit/bounce_look.h"
#include "surfeit/forecast.h"
#include "surfeit/gather.h"
#include "surfeit/job.h"
#include "surfeit/progress.h"
#include "surfeit/statistics.h"
#include "surfeit/status.h"

namespace surfeit {

// What surfels of an object group do with the light that they reflect (memo 9). Plain data.
struct GroupGloss {
  std::uint32_t group = 0;  // 0 to kMaxGroups - 1 (surfeit/surfel.h)
  // The part of it, 0 to 1, that they send in a lobe around the mirror direction. The rest, and
  // what they emit, goes evenly to all sides.
  float share = 0;
  // Width of the lobe, as GatherWeights::roughness: cos^n of the angle to the mirror direction,
  // with n = 2 / roughness^2 - 2; .05 to 1.
  float roughness = 0.2f;
};

// `temporary_directory` holds intermediate bounces. `strict` has no effect.
struct BounceOptions : JobOptions {
  int bounces = 1;        // 1 to 100
  GatherQuality quality;  // but max_variation: surfels_per_receiver spares receivers
  // All bounces but the last are gathered at about one surfel out of this many, 1 to 64, and
  // interpolated to its neighbours by distance and normal. 1: at every surfel.
  int surfels_per_receiver = 1;
  // The last bounce, too. A gather from the result smooths it once more; a picture of the
  // radiosity itself shows the interpolation.
  bool spare_last = false;
  // Set of the object groups that send light and cover, as in GatherSettings; all surfels receive.
  std::uint64_t groups = kAllGroups;

  BounceLook look;  // of all bounces
  // Of what surfels of these groups reflect; no group twice. Groups that the scene lacks are told.
  std::vector<GroupCorrection> group_corrections;

  // Glossy surfels: each stores one lobe, the cone of the mean direction and spread of all that it
  // reflects; several lamps make one wide lobe. The result is then of format version 4. Two-sided
  // surfels and spheres have no mirror direction: they send evenly, which is told. No group twice;
  // groups that the scene lacks are told.
  std::vector<GroupGloss> glossy;

  double cache_split = -1;  // as in GatherOptions (surfeit/bake.h)
  bool direct_io = false;
};

// Statistics of one bounce.
struct BouncePass {
  std::uint64_t receivers = 0;  // gathered
  double gather_seconds = 0, write_seconds = 0;
  glm::dvec3 mean_radiosity{0};  // after the bounce, weighted by area
  double largest_change = 0;     // of any color of any surfel's radiosity, since the last bounce
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

// Writes `result_path`: the scene with the radiosity after `options.bounces` bounces. Surfels,
// their order, pages, nodes and references stay the same, bit for bit. Radiosities of surfels and
// nodes and the power coefficients are new, and lobes, where surfels are glossy. The file appears
// under its name only when complete.
//
// A two-sided surfel has one radiosity for both sides; it receives the mean of its two sides. A
// sphere receives the mean over all directions. So no light is lost, and none is made.
//
// The result depends only on scene, bounces, quality, surfels_per_receiver, spare_last, groups,
// look, group_corrections, glossy and the machine's instruction set, bit for bit. With albedo or
// gains above 1 radiosity can grow without end; it is limited to 1e12. Errors: as indexClouds;
// kCorruption for a scene without albedo or radiosity; kInvalidArgument for a scene that
// bounceScene has written, because its bounces would count twice, and with glossy surfels for a
// scene of format version 1.
SURFEIT_API Result<BounceStats> bounceScene(const std::string& scene_path,
                                            const std::string& result_path,
                                            const BounceOptions& options, Progress& progress);

// What bounceScene takes: gathers at some of the surfels, in the scene itself and in the budget,
// and bounces a scene of others to see how long the file is and takes to be written. Records are
// surfels. Writes nothing but temporary files. Errors: as bounceScene.
SURFEIT_API Result<SampleForecast> forecastBounce(const std::string& scene_path,
                                                  const std::string& result_path,
                                                  const BounceOptions& options, Progress& progress);

}  // namespace surfeit
