#include "records.h"

#include <pybind11/stl.h>

#include <string>
#include <utility>

namespace surfeit::python {
namespace {

using namespace py::literals;

py::list channelNames(const CloudChannels& channels) {
  py::list names;
  for (const auto& [name, is_there] :
       {std::pair("normal", channels.normal), std::pair("radius", channels.radius),
        std::pair("area", channels.area), std::pair("radiosity", channels.radiosity),
        std::pair("albedo", channels.albedo), std::pair("two_sided", channels.two_sided),
        std::pair("group", channels.group), std::pair("long_side", channels.long_side),
        std::pair("opacity", channels.opacity), std::pair("tint", channels.tint)}) {
    if (is_there) names.append(name);
  }
  return names;
}

py::dict record(const TuneCache& cache) {
  return py::dict("frame_bytes"_a = cache.frame_bytes, "requests"_a = cache.requests,
                  "loads"_a = cache.loads, "hit_rate"_a = cache.hitRate(),
                  "bytes_read"_a = cache.bytes_read);
}

py::dict record(const TuneOutcome& outcome) {
  return py::dict("node_cache"_a = record(outcome.node_cache),
                  "surfel_cache"_a = record(outcome.surfel_cache),
                  "bytes_read"_a = outcome.bytesRead(), "seconds"_a = outcome.seconds);
}

py::dict record(const TuneRow& row) {
  py::dict dict("memory_bytes"_a = row.memory_bytes, "cache_bytes"_a = row.cache_bytes,
                "predicted"_a = record(row.predicted), "measured"_a = py::none());
  if (row.measured) dict["measured"] = record(*row.measured);
  return dict;
}

py::list record(const std::vector<TuneRow>& rows) {
  py::list list;
  for (const TuneRow& row : rows) list.append(record(row));
  return list;
}

}  // namespace

py::tuple place(const glm::dvec3& v) { return py::make_tuple(v.x, v.y, v.z); }

py::dict phases(const std::vector<std::pair<std::string, double>>& seconds) {
  py::dict dict;
  for (const auto& [name, value] : seconds) dict[name.c_str()] = value;
  return dict;
}

py::dict record(const GatherCacheStats& stats) {
  return py::dict("requests"_a = stats.requests, "hits"_a = stats.hits,
                  "front_hits"_a = stats.front_hits, "shared_hits"_a = stats.shared_hits,
                  "waits"_a = stats.waits, "misses"_a = stats.misses,
                  "prefetches"_a = stats.prefetches, "repeated_loads"_a = stats.repeated_loads,
                  "evictions"_a = stats.evictions, "bytes_read"_a = stats.bytes_read,
                  "repeated_bytes"_a = stats.repeated_bytes, "load_seconds"_a = stats.load_seconds,
                  "stall_seconds"_a = stats.stall_seconds, "peak_bytes"_a = stats.peak_bytes,
                  "budget_bytes"_a = stats.budget_bytes, "decoded_bytes"_a = stats.decoded_bytes,
                  "working_set_bytes"_a = stats.working_set_bytes);
}

py::list record(const std::vector<GatherWindow>& windows) {
  py::list list;
  for (const GatherWindow& window : windows) {
    list.append(py::dict("begin_seconds"_a = window.begin_seconds,
                         "end_seconds"_a = window.end_seconds, "receivers"_a = window.receivers,
                         "run_receivers"_a = window.run_receivers,
                         "prefetch_receivers"_a = window.prefetch_receivers,
                         "node_cache"_a = record(window.node_cache),
                         "surfel_cache"_a = record(window.surfel_cache)));
  }
  return list;
}

py::dict record(const EngineStatistics& statistics) {
  return py::dict("receivers"_a = statistics.receivers, "memory_bytes"_a = statistics.memory_bytes,
                  "held_bytes"_a = statistics.held_bytes, "scenes"_a = statistics.scenes,
                  "gatherers"_a = statistics.gatherers,
                  "node_cache"_a = record(statistics.node_cache),
                  "surfel_cache"_a = record(statistics.surfel_cache));
}

py::dict record(const SceneInfo& info) {
  return py::dict(
      "kind"_a = "scene", "file_bytes"_a = info.file_bytes, "surfels"_a = info.surfels,
      "nodes"_a = info.nodes, "leaf_capacity"_a = info.leaf_capacity,
      "node_pages"_a = info.node_pages, "surfel_pages"_a = info.surfel_pages,
      "node_page_bytes"_a = info.node_page_bytes, "surfel_page_bytes"_a = info.surfel_page_bytes,
      "node_cache_bytes"_a = info.node_cache_bytes,
      "surfel_cache_bytes"_a = info.surfel_cache_bytes, "min"_a = place(info.min),
      "max"_a = place(info.max), "origin"_a = place(info.origin),
      "cube"_a = py::make_tuple(info.cube.corner.x, info.cube.corner.y, info.cube.corner.z,
                                info.cube.size),
      "up"_a = std::string(1, "xyz"[int(info.up)]), "channels"_a = channelNames(info.channels),
      "full_precision"_a = info.full_precision, "has_lobes"_a = info.has_lobes,
      "level_pages"_a = info.level_pages, "provenance"_a = info.provenance,
      "groups"_a = describeGroups(info.groups));
}

py::dict record(const CloudDensity& density) {
  return py::dict("sampled"_a = density.sampled, "median_spacing"_a = density.median_spacing,
                  "low_spacing"_a = density.low_spacing, "high_spacing"_a = density.high_spacing,
                  "points_per_area"_a = density.points_per_area,
                  "repeated_share"_a = density.repeated_share);
}

py::dict record(const CloudInfo& info) {
  py::list elements, channels;
  for (const CloudElement& element : info.elements) {
    py::list properties;
    for (const CloudProperty& property : element.properties) {
      properties.append(py::dict("name"_a = property.name, "type"_a = property.type,
                                 "is_list"_a = property.is_list));
    }
    elements.append(
        py::dict("name"_a = element.name, "count"_a = element.count, "properties"_a = properties));
  }
  for (const CloudChannel& channel : info.channels) {
    channels.append(py::dict("name"_a = channel.name, "type"_a = channel.type,
                             "properties"_a = channel.properties));
  }
  py::dict dict("kind"_a = "cloud", "format"_a = info.format, "elements"_a = elements,
                "records"_a = info.records, "channels"_a = channels, "comments"_a = info.comments,
                "notes"_a = info.notes, "surfels"_a = py::none());
  if (info.surfels) {
    const CloudSurfels& surfels = *info.surfels;
    dict["surfels"] = py::dict("count"_a = surfels.count, "spheres"_a = surfels.spheres,
                               "channels"_a = channelNames(surfels.channels),
                               "defects"_a = surfels.defects, "min"_a = place(surfels.min),
                               "max"_a = place(surfels.max), "density"_a = record(surfels.density));
  }
  return dict;
}

py::dict record(const IndexStats& stats) {
  return py::dict("memory_bytes"_a = stats.memory_bytes, "input_bytes"_a = stats.input_bytes,
                  "surfels"_a = stats.surfels, "skipped_records"_a = stats.skipped_records,
                  "repeated_surfels"_a = stats.repeated_surfels,
                  "normals_found"_a = stats.normals_found, "thin_surfels"_a = stats.thin_surfels,
                  "scattered_surfels"_a = stats.scattered_surfels, "nodes"_a = stats.nodes,
                  "node_pages"_a = stats.node_pages, "surfel_pages"_a = stats.surfel_pages,
                  "file_bytes"_a = stats.file_bytes, "temporary_bytes"_a = stats.temporary_bytes,
                  "phase_seconds"_a = phases(stats.phase_seconds));
}

py::dict record(const GatherStats& stats) {
  return py::dict(
      "outputs"_a = describeOutputs(stats.outputs), "receivers"_a = stats.receivers,
      "invalid_receivers"_a = stats.invalid_receivers,
      "interpolated_receivers"_a = stats.interpolated_receivers,
      "gather_seconds"_a = stats.gather_seconds, "threads"_a = stats.threads,
      "memory_bytes"_a = stats.memory_bytes, "temporary_bytes"_a = stats.temporary_bytes,
      "staged_bytes_read"_a = stats.staged_bytes_read,
      "staged_bytes_kept"_a = stats.staged_bytes_kept, "node_cache"_a = record(stats.node_cache),
      "surfel_cache"_a = record(stats.surfel_cache), "windows"_a = record(stats.windows));
}

py::dict record(const ConvertStats& stats) {
  return py::dict("records"_a = stats.records, "skipped_records"_a = stats.skipped_records,
                  "cropped_records"_a = stats.cropped_records,
                  "thinned_records"_a = stats.thinned_records,
                  "placeless_records"_a = stats.placeless_records,
                  "written_records"_a = stats.written_records, "input_bytes"_a = stats.input_bytes,
                  "output_bytes"_a = stats.output_bytes, "properties"_a = stats.properties);
}

py::dict record(const NormalsStats& stats) {
  return py::dict("points"_a = stats.points, "without"_a = stats.without,
                  "outside_trajectory"_a = stats.outside_trajectory,
                  "mean_confidence"_a = stats.mean_confidence,
                  "memory_bytes"_a = stats.memory_bytes,
                  "temporary_bytes"_a = stats.temporary_bytes,
                  "index_seconds"_a = stats.index_seconds, "seconds"_a = stats.seconds);
}

py::dict record(const BounceStats& stats) {
  py::list passes;
  for (const BouncePass& pass : stats.passes) {
    passes.append(py::dict(
        "receivers"_a = pass.receivers, "gather_seconds"_a = pass.gather_seconds,
        "write_seconds"_a = pass.write_seconds, "mean_radiosity"_a = place(pass.mean_radiosity),
        "largest_change"_a = pass.largest_change, "node_cache"_a = record(pass.node_cache),
        "surfel_cache"_a = record(pass.surfel_cache)));
  }
  return py::dict("surfels"_a = stats.surfels, "threads"_a = stats.threads,
                  "memory_bytes"_a = stats.memory_bytes,
                  "temporary_bytes"_a = stats.temporary_bytes, "file_bytes"_a = stats.file_bytes,
                  "passes"_a = passes);
}

py::dict record(const LookupStats& stats) {
  return py::dict(
      "is_brick_map"_a = stats.is_brick_map, "channels"_a = stats.channels,
      "points"_a = stats.points, "skipped_points"_a = stats.skipped_points,
      "spacing"_a = stats.spacing, "max_distance"_a = stats.max_distance,
      "receivers"_a = stats.receivers, "invalid_receivers"_a = stats.invalid_receivers,
      "missing_receivers"_a = stats.missing_receivers, "page_loads"_a = stats.page_loads,
      "threads"_a = stats.threads, "memory_bytes"_a = stats.memory_bytes,
      "temporary_bytes"_a = stats.temporary_bytes, "phase_seconds"_a = phases(stats.phase_seconds));
}

py::dict record(const TuneReport& report) {
  return py::dict(
      "receivers"_a = report.receivers, "invalid_receivers"_a = report.invalid_receivers,
      "sampled_receivers"_a = report.sampled_receivers, "threads"_a = report.threads,
      "memory_bytes"_a = report.memory_bytes, "decoded_cache_bytes"_a = report.decoded_cache_bytes,
      "sample_seconds"_a = report.sample_seconds, "receiver_seconds"_a = report.receiver_seconds,
      "node_load_seconds"_a = report.node_load_seconds,
      "surfel_load_seconds"_a = report.surfel_load_seconds, "rows"_a = record(report.rows),
      "curve"_a = record(report.curve), "knee"_a = record(report.knee),
      "recommended"_a = record(report.recommended), "hit_rate_error"_a = report.hitRateError());
}

py::dict record(const VerifyReport& report) {
  return py::dict("pages_checked"_a = report.pages_checked,
                  "bytes_checked"_a = report.bytes_checked, "findings"_a = report.findings,
                  "finding_count"_a = report.finding_count);
}

py::dict record(const IndexShardStats& stats) {
  return py::dict("done_shards"_a = stats.done_shards, "finished_shards"_a = stats.finished_shards,
                  "memory_bytes"_a = stats.memory_bytes, "records"_a = stats.records,
                  "surfels"_a = stats.surfels, "file_bytes"_a = stats.file_bytes,
                  "temporary_bytes"_a = stats.temporary_bytes);
}

py::dict record(const IndexForecast& forecast) {
  return py::dict("records"_a = forecast.records, "sampled_surfels"_a = forecast.sampled_surfels,
                  "input_bytes"_a = forecast.input_bytes, "memory_bytes"_a = forecast.memory_bytes,
                  "temporary_bytes"_a = forecast.temporary_bytes,
                  "file_bytes"_a = forecast.file_bytes, "seconds"_a = forecast.seconds);
}

py::dict record(const SampleForecast& forecast) {
  return py::dict("records"_a = forecast.records, "sampled_records"_a = forecast.sampled_records,
                  "input_bytes"_a = forecast.input_bytes, "memory_bytes"_a = forecast.memory_bytes,
                  "temporary_bytes"_a = forecast.temporary_bytes,
                  "output_bytes"_a = forecast.output_bytes, "seconds"_a = forecast.seconds);
}

py::dict record(const ShardStats& stats) {
  py::dict dict = record(static_cast<const GatherStats&>(stats));
  dict["gathered_shards"] = stats.gathered_shards;
  dict["finished_shards"] = stats.finished_shards;
  return dict;
}

py::dict record(const MergeStats& stats) {
  return py::dict("shards"_a = stats.shards, "receivers"_a = stats.receivers,
                  "invalid_receivers"_a = stats.invalid_receivers,
                  "memory_bytes"_a = stats.memory_bytes,
                  "temporary_bytes"_a = stats.temporary_bytes);
}

py::dict record(const GatherForecast& forecast) {
  return py::dict("receivers"_a = forecast.receivers,
                  "sampled_receivers"_a = forecast.sampled_receivers,
                  "threads"_a = forecast.threads, "memory_bytes"_a = forecast.memory_bytes,
                  "least_memory_bytes"_a = forecast.least_memory_bytes,
                  "recommended_memory_bytes"_a = forecast.recommended_memory_bytes,
                  "temporary_bytes"_a = forecast.temporary_bytes,
                  "result_bytes"_a = forecast.result_bytes, "seconds"_a = forecast.seconds);
}

py::dict record(const BrickStats& stats) {
  return py::dict("memory_bytes"_a = stats.memory_bytes, "points"_a = stats.points,
                  "skipped_points"_a = stats.skipped_points, "channels"_a = stats.channels,
                  "voxel_size"_a = stats.voxel_size, "level_voxels"_a = stats.level_voxels,
                  "file_bytes"_a = stats.file_bytes, "temporary_bytes"_a = stats.temporary_bytes,
                  "threads"_a = stats.threads, "phase_seconds"_a = phases(stats.phase_seconds));
}

py::dict record(const RadianceStats& stats) {
  return py::dict(
      "photons"_a = stats.photons, "skipped_photons"_a = stats.skipped_photons,
      "surfels"_a = stats.surfels, "sparse_surfels"_a = stats.sparse_surfels,
      "bounded_surfels"_a = stats.bounded_surfels, "area"_a = stats.area,
      "power"_a = place(stats.power), "reflected_power"_a = place(stats.reflected_power),
      "mean_radius"_a = stats.mean_radius, "max_radius"_a = stats.max_radius,
      "temporary_bytes"_a = stats.temporary_bytes, "memory_bytes"_a = stats.memory_bytes,
      "threads"_a = stats.threads, "phase_seconds"_a = phases(stats.phase_seconds));
}

py::dict record(const GenerateStats& stats) {
  return py::dict("surfels"_a = stats.surfels, "area"_a = stats.area);
}

}  // namespace surfeit::python
