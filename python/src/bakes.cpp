// What makes clouds and maps beside the gather: brick maps, surfels of photons, generated scenes
// (surfeit/brick.h, radiance.h, generate.h).
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "arrays.h"
#include "bindings.h"
#include "call.h"
#include "dry_run.h"
#include "errors.h"
#include "options.h"
#include "records.h"
#include "surfeit/brick.h"
#include "surfeit/generate.h"
#include "surfeit/process.h"
#include "surfeit/radiance.h"

namespace surfeit::python {
namespace {

// Look-ups between two questions whether the call should stop.
constexpr std::size_t kLookupsAtATime = 4096;

py::dict brick(const std::vector<std::string>& clouds, const std::string& output,
               const py::dict& given, const py::object& watcher) {
  Options options(given);
  BrickOptions bricking;
  takeJob(options, bricking);
  options.into("channel", bricking.channels);
  options.into("max_error", bricking.max_error);
  options.into("voxel_size", bricking.voxel_size);
  options.into("filter", bricking.filter);
  takeColorRange(options, bricking.color_range);
  bool is_dry_run = false;
  options.into("dry_run", is_dry_run);
  options.finish();
  if (is_dry_run) {
    return record(runFor<SampleForecast>(watcher, [&](Progress& progress) {
      return forecastBrick(clouds, output, bricking, progress);
    }));
  }
  return record(runFor<BrickStats>(watcher, [&](Progress& progress) {
    return brickClouds(clouds, output, bricking, progress);
  }));
}

BrickMap openMap(const std::string& path, std::uint64_t memory_bytes) {
  return runFor<BrickMap>(py::none(), [&](Progress&) {
    return memory_bytes == 0 ? BrickMap::open(path) : BrickMap::open(path, memory_bytes);
  });
}

// Values (n, values) and whether there are any (n,).
py::tuple lookUp(const BrickMap& map, const py::object& places, const py::object& facing,
                 double filter_width, const py::object& watcher) {
  const Vectors positions(places, "positions"), normals(facing, "normals");
  if (normals.isThere() && normals.count() != positions.count()) {
    throw py::value_error("normals: found " + std::to_string(normals.count()) + ", expected " +
                          std::to_string(positions.count()) + " as of positions");
  }
  const auto count = py::ssize_t(positions.count());
  py::array_t<float> values({count, py::ssize_t(map.valueCount())});
  py::array_t<bool> found(count);
  float* const to = values.mutable_data();
  bool* const is_found = found.mutable_data();
  run(watcher, [&](Progress& progress) -> Status {
    progress.beginPhase("look up", positions.count(), "receivers");
    for (std::size_t i = 0; i < positions.count(); ++i) {
      const glm::vec3 normal = normals.isThere() ? glm::vec3(normals[i]) : glm::vec3(0);
      SURFEIT_ASSIGN_OR_RETURN(
          is_found[i], map.lookup(positions[i], normal, filter_width, to + i * map.valueCount()));
      if ((i + 1) % kLookupsAtATime != 0) continue;
      if (progress.isCancelled()) return Status::interrupted();
      progress.advance(kLookupsAtATime);
    }
    return {};
  });
  return py::make_tuple(values, found);
}

py::list channelsOf(const BrickMap& map) {
  py::list list;
  for (const BrickChannel& channel : map.channels()) {
    list.append(py::make_tuple(channel.name, channel.properties));
  }
  return list;
}

std::vector<double> voxelSizes(const BrickMap& map) {
  std::vector<double> sizes;
  for (int level = 0; level < map.levelCount(); ++level) sizes.push_back(map.voxelSize(level));
  return sizes;
}

py::dict radiance(const std::vector<std::string>& photons, const std::string& output,
                  const py::dict& given, const py::object& watcher) {
  Options options(given);
  RadianceOptions estimating;
  takeJob(options, estimating);
  takeReading(options, estimating);
  options.into("photons_per_estimate", estimating.photons_per_estimate);
  options.into("max_radius", estimating.max_radius);
  takeVector(options, "albedo", estimating.default_albedo);
  options.into("disk_overlap", estimating.disk_overlap);
  bool is_dry_run = false;
  options.into("dry_run", is_dry_run);
  options.finish();
  if (is_dry_run) {
    return dryRun(
        photons, output, estimating, watcher,
        [](const auto& samples, const std::string& result, const auto& sampled,
           Progress& progress) { return radianceCloud(samples, result, sampled, progress); });
  }
  return record(runFor<RadianceStats>(watcher, [&](Progress& progress) {
    return radianceCloud(photons, output, estimating, progress);
  }));
}

py::dict generate(const std::string& output, const py::dict& given, const py::object& watcher) {
  Options options(given);
  SceneRecipe recipe;
  options.choose<SceneKind>("kind", recipe.kind,
                            {{"terrain", SceneKind::kTerrain},
                             {"city", SceneKind::kCity},
                             {"volume", SceneKind::kVolume}});
  options.into("surfels", recipe.surfels);
  options.into("seed", recipe.seed);
  options.choose<RecordOrder>("order", recipe.order,
                              {{"scan", RecordOrder::kScan}, {"shuffled", RecordOrder::kShuffled}});
  std::optional<std::string> part;
  options.into("part", part);
  if (part) check(parseScenePart(*part, recipe));
  options.into("outlier", recipe.outlier_distance);
  options.into("duplicates", recipe.duplicate_percent);
  bool is_recipe = false;
  options.into("recipe", is_recipe);
  int threads = 0;
  options.into("threads", threads);
  options.finish();
  if (is_recipe) {
    check(writeSceneRecipe(recipe, output));
    return py::dict();
  }
  if (threads == 0) threads = defaultThreadCount();
  return record(runFor<GenerateStats>(watcher, [&](Progress& progress) {
    return generateScene(recipe, output, threads, progress);
  }));
}

}  // namespace

void addBakes(py::module_& module) {
  py::class_<BrickMap>(module, "BrickMap")
      .def(py::init(&openMap))
      .def("lookup", &lookUp)
      .def_property_readonly("channels", &channelsOf)
      .def_property_readonly("voxel_sizes", &voxelSizes)
      .def_property_readonly("cached_bytes", &BrickMap::cachedBytes)
      .def_property_readonly("directory_bytes", &BrickMap::directoryBytes);
  module.def("brick", &brick);
  module.def("radiance", &radiance);
  module.def("generate", &generate);
  module.def("parse_surfel_count",
             [](const std::string& text) { return valueOf(parseSurfelCount(text)); });
}

}  // namespace surfeit::python
