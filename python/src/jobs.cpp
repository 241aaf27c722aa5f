// Jobs from files to files, and what they are told by: convert, normals, bounce, lookup, verify,
// info. indexing.cpp and gathering.cpp have the others.
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "bindings.h"
#include "call.h"
#include "dry_run.h"
#include "errors.h"
#include "options.h"
#include "records.h"
#include "surfeit/group_names.h"
#include "surfeit/surfel.h"

namespace surfeit::python {
namespace {

// Corners of a box: ((x, y, z), (x, y, z)).
using Corners = std::array<std::array<double, 3>, 2>;

py::dict convert(const std::vector<std::string>& inputs, const std::string& output,
                 const py::dict& given, const py::object& watcher) {
  Options options(given);
  ConvertOptions converting;
  takeJob(options, converting);
  takeReading(options, converting);
  options.into("every", converting.every);
  options.into("spacing", converting.spacing);
  options.into("transform", converting.transform);
  takeUp(options, "up", converting.up);
  std::optional<Corners> crop;
  options.into("crop", crop);
  if (crop) {
    const auto& [min, max] = *crop;
    converting.crop = CropBox{{min[0], min[1], min[2]}, {max[0], max[1], max[2]}};
  }
  takeDensity(options, converting.density);
  options.into("keep", converting.keep);
  options.into("drop", converting.drop);
  options.into("assignments", converting.assignments);
  options.into("like", converting.like);
  bool is_dry_run = false;
  options.into("dry_run", is_dry_run);
  options.finish();
  if (is_dry_run) {
    return dryRun(
        inputs, output, converting, watcher,
        [](const auto& samples, const std::string& result, const auto& sampled,
           Progress& progress) { return convertClouds(samples, result, sampled, progress); });
  }
  return record(runFor<ConvertStats>(watcher, [&](Progress& progress) {
    return convertClouds(inputs, output, converting, progress);
  }));
}

py::dict normals(const std::string& input, const std::string& output, const py::dict& given,
                 const py::object& watcher) {
  Options options(given);
  NormalsOptions estimating;
  takeJob(options, estimating);
  takeReading(options, estimating);
  takeEstimation(options, estimating.estimation);
  takeUp(options, "up", estimating.up);
  options.into("sizes", estimating.with_sizes);
  bool is_dry_run = false;
  options.into("dry_run", is_dry_run);
  options.finish();
  if (is_dry_run) {
    return dryRun(
        {input}, output, estimating, watcher,
        [](const auto& samples, const std::string& result, const auto& sampled,
           Progress& progress) { return estimateNormals(samples[0], result, sampled, progress); });
  }
  return record(runFor<NormalsStats>(watcher, [&](Progress& progress) {
    return estimateNormals(input, output, estimating, progress);
  }));
}

py::dict bounce(const std::string& scene, const std::string& result, const py::dict& given,
                const py::object& watcher) {
  Options options(given);
  BounceOptions bouncing;
  takeJob(options, bouncing);
  takeQuality(options, bouncing.quality);
  takeGroups(options, bouncing.groups);
  options.into("bounces", bouncing.bounces);
  options.into("surfels_per_receiver", bouncing.surfels_per_receiver);
  options.into("spare_last", bouncing.spare_last);
  takeLook(options, bouncing.look);
  takeGroupCorrections(options, bouncing.group_corrections);
  std::vector<std::tuple<std::uint32_t, float, float>> glossy;
  options.into("glossy", glossy);
  for (const auto& [group, share, roughness] : glossy) {
    bouncing.glossy.push_back({group, share, roughness});
  }
  options.into("cache_split", bouncing.cache_split);
  options.into("direct_io", bouncing.direct_io);
  bool is_dry_run = false;
  options.into("dry_run", is_dry_run);
  options.finish();
  if (is_dry_run) {
    return record(runFor<SampleForecast>(watcher, [&](Progress& progress) {
      return forecastBounce(scene, result, bouncing, progress);
    }));
  }
  return record(runFor<BounceStats>(
      watcher, [&](Progress& progress) { return bounceScene(scene, result, bouncing, progress); }));
}

py::dict lookup(const std::string& map, const std::string& receivers, const std::string& result,
                const py::dict& given, const py::object& watcher) {
  Options options(given);
  LookupOptions looking;
  takeJob(options, looking);
  takeReading(options, looking);
  options.into("values", looking.values);
  options.into("map_channels", looking.map_channels);
  options.into("map_filter", looking.map_filter);
  options.choose<LookupInterpolation>(
      "interpolation", looking.interpolation,
      {{"smooth", LookupInterpolation::kSmooth}, {"nearest", LookupInterpolation::kNearest}});
  options.into("max_distance", looking.max_distance);
  options.into("filter_width", looking.filter_width);
  options.into("missing", looking.missing);
  options.into("from_space", looking.from_space);
  options.into("to_space", looking.to_space);
  options.into("pref", looking.reference_positions);
  options.into("nref", looking.reference_normals);
  bool is_dry_run = false;
  options.into("dry_run", is_dry_run);
  options.finish();
  if (is_dry_run) {
    return record(runFor<SampleForecast>(watcher, [&](Progress& progress) {
      return forecastLookup(map, receivers, result, looking, progress);
    }));
  }
  return record(runFor<LookupStats>(watcher, [&](Progress& progress) {
    return lookupCloud(map, receivers, result, looking, progress);
  }));
}

py::dict verify(const std::string& scene, const py::dict& given, const py::object& watcher) {
  Options options(given);
  JobOptions job;
  takeJob(options, job);
  options.finish();
  return record(runFor<VerifyReport>(watcher, [&](Progress& progress) {
    return verifyScene(scene, job.threads, progress, job.memory_bytes);
  }));
}

py::dict sceneInfo(const std::string& path) { return record(valueOf(readSceneInfo(path))); }

// Names by number.
py::dict groupNames(const std::string& path) {
  py::dict names;
  for (const GroupName& name : valueOf(readGroupNames(path)))
    names[py::int_(name.group)] = name.name;
  return names;
}

using NamesOfGroups = std::vector<std::pair<std::uint32_t, std::string>>;

// The numbers that a list of names and numbers means; without names, of numbers alone.
std::vector<std::uint32_t> groupNumbers(const std::string& text,
                                        const std::optional<NamesOfGroups>& given) {
  Result<std::uint64_t> set = parseGroups(text);
  if (!set.ok() && given) {
    std::vector<GroupName> names;
    for (const auto& [group, name] : *given) names.push_back({group, name});
    set = parseGroupNames(text, names);
  }
  const std::uint64_t groups = valueOf(std::move(set));
  std::vector<std::uint32_t> numbers;
  for (std::uint32_t group = 0; group < kMaxGroups; ++group) {
    if ((groups & groupBit(group)) != 0) numbers.push_back(group);
  }
  return numbers;
}

py::dict info(const std::string& path, const py::dict& given, const py::object& watcher) {
  Options options(given);
  ReadOptions reading;
  takeReading(options, reading);
  options.finish();
  if (!valueOf(isScene(path))) {
    return record(runFor<CloudInfo>(
        watcher, [&](Progress& progress) { return readCloudInfo(path, reading, progress); }));
  }
  const SceneInfo scene =
      runFor<SceneInfo>(watcher, [&](Progress&) { return readSceneInfo(path); });
  const CloudDensity density = runFor<CloudDensity>(
      watcher, [&](Progress& progress) { return measureSceneDensity(path, progress); });
  py::dict dict = record(scene);
  dict["density"] = record(density);
  dict["group_names"] = groupNames(path);
  return dict;
}

}  // namespace

void addJobs(py::module_& module) {
  module.def("convert", &convert);
  module.def("normals", &normals);
  module.def("bounce", &bounce);
  module.def("lookup", &lookup);
  module.def("verify", &verify);
  module.def("info", &info);
  module.def("scene_info", &sceneInfo);
  module.def("group_names", &groupNames);
  module.def("group_numbers", &groupNumbers);
}

}  // namespace surfeit::python
