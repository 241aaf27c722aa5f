// Direct light again without sampling again: gives the surfels of a scene other direct light, or
// one light more, and writes the scene with it (memo 08-01, section 3.1; course, interactive
// lighting).
//
//   B = gain * albedo * E            E: irradiance of the lights at the surfel
//   B = B_scene + gain * albedo * E  with `adds`: lights in layers
//
// Needs the component `sample`, which links Embree (docs/engine.md). Units as in surfeit/sample.h.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <string>
#include <vector>

#include "surfeit/api.h"
#include "surfeit/forecast.h"
#include "surfeit/progress.h"
#include "surfeit/sample.h"
#include "surfeit/status.h"

namespace surfeit {

struct RelightOptions {
  // Lights, and shadow rays per light.
  // `with_emission` is refused: a scene does not keep the emission of its surfels.
  Lights lights;
  // Triangle meshes that cast shadows, in the coordinates of the scene: those that were sampled,
  // fewer, or others. None: light passes through everything, which a note tells.
  std::vector<std::string> meshes;
  // Emissive triangles of the meshes light the surfels, too. Of layers one alone should have them.
  bool meshes_emit = true;
  GroundPlane ground;  // below the meshes; casts shadows, too
  double gain = 1;     // factor of the new light, 0 to 1e6
  bool adds = false;   // keep the radiosity of the scene, and add the new light to it
  // Shadow rays start at least so far above a surfel, in scene units. They start as far above it as
  // rounding and quantization moved it in any case; meshes that surfels do not lie on need more.
  double shadow_bias = 0;
  int threads = 0;  // 0: all that the job may use
};

struct RelightStats {
  std::uint64_t surfels = 0;
  std::uint64_t lit_surfels = 0;  // that get any of the new light
  std::uint64_t triangles = 0;    // that cast shadows
  std::uint64_t file_bytes = 0;   // of the result
  glm::dvec3 mean_radiosity{0};   // of the result, weighted by area
  double load_seconds = 0, build_seconds = 0, light_seconds = 0;
  int threads = 0;
};

// Writes `result_path`: the scene with the new radiosity. Surfels, their order, pages, nodes and
// references stay the same, bit for bit; radiosities of surfels and nodes and the power
// coefficients are new. The file appears under its name only when complete.
//
// A two-sided surfel gets the mean of its two sides, a sphere the mean over its surface (a quarter
// of what a disk that faces the light gets). Area lights and emissive triangles are sampled with
// another pattern than sampleMeshes has: the same light within the noise of `lights.samples`. All
// other light is that of sampleMeshes within the digits of the scene: at full precision the same,
// else within .4 % for albedos of 1 and .6 % for .5, which have 8 bits. With `adds`, the radiosity
// of the scene is rounded once more for each layer. Bounces of the scene (surfeit/bounce.h) stay
// with `adds`; else they go, which a note tells.
//
// The result depends only on scene, meshes and options, not on the threads. Memory: the meshes and
// Embree's hierarchy (less than 200 bytes per triangle), the page directory (24 bytes a page), and
// some pages per thread, whatever the number of surfels. Calls are independent, so threads may
// call at once. Errors: as sampleMeshes; kCorruption for a scene without albedo; kInvalidArgument
// where nothing emits; kBudgetTooSmall where limitProcess (surfeit/process.h) leaves no room.
SURFEIT_API Result<RelightStats> relightScene(const std::string& scene_path,
                                              const std::string& result_path,
                                              const RelightOptions& options, Progress& progress);

// What relightScene takes, by a scene of some of the surfels, and all of the meshes. Writes nothing
// but in a temporary folder. Errors: as relightScene.
SURFEIT_API Result<SampleForecast> forecastRelight(const std::string& scene_path,
                                                   const std::string& result_path,
                                                   const RelightOptions& options,
                                                   Progress& progress);

}  // namespace surfeit
