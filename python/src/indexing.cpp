// Clouds and arrays to scenes, at once or in shards: surfeit/index.h, index_shards.h.
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <array>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "arrays.h"
#include "bindings.h"
#include "call.h"
#include "errors.h"
#include "options.h"
#include "records.h"
#include "surfeit/index.h"
#include "surfeit/index_shards.h"

namespace surfeit::python {
namespace {

IndexOptions indexOptions(const py::dict& given) {
  Options options(given);
  IndexOptions index;
  takeJob(options, index);
  takeReading(options, index);
  options.into("leaf_capacity", index.leaf_capacity);
  options.into("disk_overlap", index.disk_overlap);
  options.into("full_precision", index.full_precision);
  options.choose<Repeats>("overlap", index.repeats,
                          {{"keep", Repeats::kKeep}, {"thin", Repeats::kThin}});
  std::optional<std::array<double, 3>> origin;
  options.into("origin", origin);
  if (origin) index.origin = glm::dvec3((*origin)[0], (*origin)[1], (*origin)[2]);
  std::optional<std::array<double, 4>> cube;
  options.into("cube", cube);
  if (cube) index.cube = {{(*cube)[0], (*cube)[1], (*cube)[2]}, (*cube)[3]};
  takeUp(options, "up", index.up);
  bool estimates = false;
  options.choose<bool>("normals", estimates, {{"none", false}, {"estimate", true}});
  NormalEstimation estimation;
  takeEstimation(options, estimation);
  if (estimates) index.normals = estimation;
  std::vector<std::pair<std::string, std::string>> named;
  options.into("group", named);
  for (const auto& [name, path] : named) index.named.push_back({name, path});
  options.finish();
  return index;
}

py::dict indexFiles(const std::vector<std::string>& inputs, const std::string& output,
                    const py::dict& given, const py::object& watcher) {
  const IndexOptions options = indexOptions(given);
  return record(runFor<IndexStats>(
      watcher, [&](Progress& progress) { return indexClouds(inputs, output, options, progress); }));
}

py::dict indexArrays(const py::list& arrays, const std::string& output, const py::dict& given,
                     const py::object& watcher) {
  const IndexOptions options = indexOptions(given);
  const Columns columns(arrays);
  CloudColumns rows;
  rows.name = "arrays";
  rows.count = columns.count;
  rows.columns = columns.columns;
  rows.values = columns.values;
  return record(runFor<IndexStats>(
      watcher, [&](Progress& progress) { return indexColumns(rows, output, options, progress); }));
}

// One pass over shards first to last, of count.
py::dict indexShardsOf(const std::vector<std::string>& inputs, const std::string& output,
                       const std::string& pass_word, const std::array<int, 3>& shards,
                       const py::dict& given, const py::object& watcher) {
  const IndexOptions options = indexOptions(given);
  const IndexPass pass = pass_word == "count"        ? IndexPass::kCount
                         : pass_word == "distribute" ? IndexPass::kDistribute
                         : pass_word == "build"      ? IndexPass::kBuild
                         : pass_word == "places"     ? IndexPass::kPlaces
                                                     : IndexPass::kSizes;
  const ShardRange range = {shards[0], shards[1], shards[2]};
  return record(runFor<IndexShardStats>(watcher, [&](Progress& progress) {
    return indexShards(inputs, output, options, pass, range, progress);
  }));
}

py::dict mergeIndex(const std::vector<std::string>& inputs, const std::string& output, int count,
                    bool removes_shards, const py::dict& given, const py::object& watcher) {
  const IndexOptions options = indexOptions(given);
  return record(runFor<IndexStats>(watcher, [&](Progress& progress) {
    return mergeIndexShards(inputs, output, options, count, removes_shards, progress);
  }));
}

py::dict forecastIndex(const std::vector<std::string>& inputs, const std::string& output,
                  const py::dict& given, const py::object& watcher) {
  const IndexOptions options = indexOptions(given);
  return record(runFor<IndexForecast>(watcher, [&](Progress& progress) {
    return forecastIndex(inputs, output, options, progress);
  }));
}

}  // namespace

void addIndexing(py::module_& module) {
  module.def("index_files", &indexFiles);
  module.def("index_arrays", &indexArrays);
  module.def("index_shards", &indexShardsOf);
  module.def("merge_index", &mergeIndex);
  module.def("forecast_index", &forecastIndex);
}

}  // namespace surfeit::python
