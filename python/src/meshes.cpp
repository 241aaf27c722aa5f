// Triangle meshes: surfels, photons, other light for scenes, rays for cubes. The component `sample`
// (surfeit/sample.h, relight.h).
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <array>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "bindings.h"
#include "call.h"
#include "errors.h"
#include "options.h"
#include "records.h"
#include "surfeit/cube.h"
#include "surfeit/relight.h"
#include "surfeit/sample.h"

namespace surfeit::python {
namespace {

using namespace py::literals;

// A light: its numbers, the last three a color, and the gain of that color.
template <std::size_t N>
using GivenLights = std::vector<std::pair<std::array<double, N>, double>>;

template <std::size_t N>
glm::vec3 colorOf(const std::pair<std::array<double, N>, double>& light) {
  const std::array<double, N>& n = light.first;
  glm::vec3 color{float(n[N - 3]), float(n[N - 2]), float(n[N - 1])};
  return color *= float(light.second);
}

template <std::size_t N>
glm::vec3 vectorAt(const std::array<double, N>& n, std::size_t i) {
  return {float(n[i]), float(n[i + 1]), float(n[i + 2])};
}

// light_point, light_directional, light_area: lists of numbers and gains; light_samples, falloff,
// falloff_distance, emission.
void takeLights(Options& options, Lights& lights) {
  GivenLights<6> points, directionals;
  GivenLights<12> areas;
  options.into("light_point", points);
  options.into("light_directional", directionals);
  options.into("light_area", areas);
  for (const auto& light : points) {
    const auto& n = light.first;
    lights.points.push_back({{n[0], n[1], n[2]}, colorOf(light)});
  }
  for (const auto& light : directionals) {
    lights.directionals.push_back({vectorAt(light.first, 0), colorOf(light)});
  }
  for (const auto& light : areas) {
    const auto& n = light.first;
    lights.areas.push_back({{n[0], n[1], n[2]}, vectorAt(n, 3), vectorAt(n, 6), colorOf(light)});
  }
  options.into("light_samples", lights.samples);
  options.into("falloff", lights.falloff);
  options.into("falloff_distance", lights.falloff_distance);
  options.into("emission", lights.with_emission);
}

// ground_plane, ground_size, ground_albedo, up.
void takeGround(Options& options, GroundPlane& ground) {
  options.into("ground_plane", ground.enabled);
  options.into("ground_size", ground.size);
  takeVector(options, "ground_albedo", ground.albedo);
  std::optional<UpAxis> up;
  takeUp(options, "up", up);
  if (up) ground.up = *up;
}

void takeSurroundings(Options& options, Surroundings& surroundings) {
  takeLights(options, surroundings.lights);
  takeGround(options, surroundings.ground);
  takeVector(options, "albedo", surroundings.default_albedo);
  options.into("curve_width", surroundings.curves.width);
  options.into("strands", surroundings.curves.strands);
}

py::dict sample(const std::vector<std::string>& meshes, const std::string& output,
                const py::dict& given, const py::object& watcher) {
  Options options(given);
  SampleOptions sampling;
  takeSurroundings(options, sampling.surroundings);
  takeDensity(options, sampling.density);
  options.choose<SampleGroups>("group_by", sampling.groups,
                               {{"file", SampleGroups::kFile},
                                {"object", SampleGroups::kObject},
                                {"material", SampleGroups::kMaterial}});
  options.into("count", sampling.count);
  options.into("spacing", sampling.spacing);
  options.into("two_sided", sampling.is_two_sided);
  options.into("threads", sampling.threads);
  bool is_dry_run = false;
  options.into("dry_run", is_dry_run);
  options.finish();
  if (is_dry_run) {
    return record(runFor<SampleForecast>(watcher, [&](Progress& progress) {
      return forecastSample(meshes, output, sampling, progress);
    }));
  }
  const auto stats = runFor<SampleStats>(watcher, [&](Progress& progress) {
    return sampleMeshes(meshes, output, sampling, progress);
  });
  return py::dict("triangles"_a = stats.triangles, "degenerate_faces"_a = stats.degenerate_faces,
                  "surfels"_a = stats.surfels, "sliver_surfels"_a = stats.sliver_surfels,
                  "clear_surfels"_a = stats.clear_surfels, "area"_a = stats.area,
                  "surfel_area"_a = stats.surfel_area, "disk_area"_a = stats.disk_area,
                  "spacing"_a = stats.spacing, "load_seconds"_a = stats.load_seconds,
                  "build_seconds"_a = stats.build_seconds,
                  "sample_seconds"_a = stats.sample_seconds, "threads"_a = stats.threads);
}

py::dict photons(const std::vector<std::string>& meshes, const std::string& output,
                 const py::dict& given, const py::object& watcher) {
  Options options(given);
  PhotonTracingOptions tracing;
  takeSurroundings(options, tracing.surroundings);
  options.into("photons", tracing.photons);
  options.into("seed", tracing.seed);
  options.into("caustic_photons", tracing.caustic_output);
  options.into("threads", tracing.threads);
  bool is_dry_run = false;
  options.into("dry_run", is_dry_run);
  options.finish();
  if (is_dry_run) {
    return record(runFor<SampleForecast>(watcher, [&](Progress& progress) {
      return forecastPhotons(meshes, output, tracing, progress);
    }));
  }
  const auto stats = runFor<PhotonTracingStats>(
      watcher, [&](Progress& progress) { return tracePhotons(meshes, output, tracing, progress); });
  return py::dict(
      "triangles"_a = stats.triangles, "degenerate_faces"_a = stats.degenerate_faces,
      "emitted"_a = stats.emitted, "stored"_a = stats.stored, "caustic"_a = stats.caustic,
      "escaped"_a = stats.escaped, "lost_at_backs"_a = stats.lost_at_backs,
      "emitted_power"_a = place(stats.emitted_power), "stored_power"_a = place(stats.stored_power),
      "caustic_power"_a = place(stats.caustic_power), "load_seconds"_a = stats.load_seconds,
      "build_seconds"_a = stats.build_seconds, "trace_seconds"_a = stats.trace_seconds,
      "threads"_a = stats.threads);
}

py::dict relight(const std::string& scene, const std::string& result, const py::dict& given,
                 const py::object& watcher) {
  Options options(given);
  RelightOptions lighting;
  takeLights(options, lighting.lights);
  takeGround(options, lighting.ground);
  options.into("mesh", lighting.meshes);
  options.into("mesh_light", lighting.meshes_emit);
  options.into("gain", lighting.gain);
  options.into("add", lighting.adds);
  options.into("shadow_bias", lighting.shadow_bias);
  options.into("threads", lighting.threads);
  bool is_dry_run = false;
  options.into("dry_run", is_dry_run);
  options.finish();
  if (is_dry_run) {
    return record(runFor<SampleForecast>(watcher, [&](Progress& progress) {
      return forecastRelight(scene, result, lighting, progress);
    }));
  }
  const auto stats = runFor<RelightStats>(
      watcher, [&](Progress& progress) { return relightScene(scene, result, lighting, progress); });
  return py::dict("surfels"_a = stats.surfels, "lit_surfels"_a = stats.lit_surfels,
                  "triangles"_a = stats.triangles, "file_bytes"_a = stats.file_bytes,
                  "mean_radiosity"_a = place(stats.mean_radiosity),
                  "load_seconds"_a = stats.load_seconds, "build_seconds"_a = stats.build_seconds,
                  "light_seconds"_a = stats.light_seconds, "threads"_a = stats.threads);
}

CubeImage tracedCube(const CubeImage& cube, const std::vector<std::string>& meshes,
                     const py::dict& given, const py::object& watcher) {
  Options options(given);
  TracedCubeOptions tracing;
  options.into("rays", tracing.rays);
  options.choose<GatherSides>(
      "sides", tracing.sides,
      {{"front", GatherSides::kFront}, {"both", GatherSides::kBoth}, {"back", GatherSides::kBack}});
  options.into("max_distance", tracing.max_distance);
  options.into("threads", tracing.threads);
  options.finish();
  return runFor<CubeImage>(
      watcher, [&](Progress& progress) { return traceCube(cube, meshes, tracing, progress); });
}

}  // namespace

void addMeshes(py::module_& module) {
  module.def("sample", &sample);
  module.def("photons", &photons);
  module.def("relight", &relight);
  module.def("trace_cube", &tracedCube);
}

}  // namespace surfeit::python
