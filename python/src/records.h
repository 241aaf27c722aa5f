// Statistics and descriptions of the library as dicts, under the names of the structs' members.
#pragma once

#include <pybind11/pybind11.h>

#include <string>
#include <utility>
#include <vector>

#include "surfeit/bake.h"
#include "surfeit/bounce.h"
#include "surfeit/brick.h"
#include "surfeit/cloud_info.h"
#include "surfeit/convert.h"
#include "surfeit/engine.h"
#include "surfeit/forecast.h"
#include "surfeit/generate.h"
#include "surfeit/index.h"
#include "surfeit/index_shards.h"
#include "surfeit/lookup.h"
#include "surfeit/normals.h"
#include "surfeit/radiance.h"
#include "surfeit/scene.h"
#include "surfeit/shards.h"
#include "surfeit/tune.h"

namespace surfeit::python {

namespace py = pybind11;

py::tuple place(const glm::dvec3& v);
// Seconds by phase.
py::dict phases(const std::vector<std::pair<std::string, double>>& seconds);

py::dict record(const GatherCacheStats& stats);
py::list record(const std::vector<GatherWindow>& windows);
py::dict record(const EngineStatistics& statistics);
py::dict record(const SceneInfo& info);
py::dict record(const CloudInfo& info);
py::dict record(const CloudDensity& density);
py::dict record(const IndexStats& stats);
py::dict record(const GatherStats& stats);
py::dict record(const ConvertStats& stats);
py::dict record(const NormalsStats& stats);
py::dict record(const BounceStats& stats);
py::dict record(const LookupStats& stats);
py::dict record(const TuneReport& report);
py::dict record(const VerifyReport& report);
py::dict record(const IndexShardStats& stats);
py::dict record(const IndexForecast& forecast);
py::dict record(const SampleForecast& forecast);
py::dict record(const ShardStats& stats);
py::dict record(const MergeStats& stats);
py::dict record(const GatherForecast& forecast);
py::dict record(const BrickStats& stats);
py::dict record(const RadianceStats& stats);
py::dict record(const GenerateStats& stats);

}  // namespace surfeit::python
