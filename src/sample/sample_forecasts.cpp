// What sampleMeshes, tracePhotons and relightScene take: they do their work with all of the meshes,
// and few surfels or photons.
#include <algorithm>
#include <string>
#include <vector>

#include "core/guard.h"
#include "index/rows/row_sample.h"
#include "storage/output_target.h"
#include "storage/scratch_folder.h"
#include "surfeit/process.h"
#include "surfeit/relight.h"
#include "surfeit/sample.h"

namespace surfeit {
namespace {

constexpr std::uint64_t kMostSampled = 65536;
// Edges of surfels for cameras are so many times as long in a sample.
constexpr double kCoarser = 4;

std::uint64_t bytesOf(const std::vector<std::string>& files) {
  std::uint64_t bytes = 0;
  for (const std::string& file : files) bytes += fileBytesOf(file);
  return bytes;
}

// The options of a sample.
SampleOptions fewer(const SampleOptions& options) {
  SampleOptions sampled = options;
  if (!options.density.cameras.empty()) {
    sampled.density.pixels = std::min(1e4, options.density.pixels * kCoarser);
    sampled.density.max_solid_angle =
        std::min(1., options.density.max_solid_angle * kCoarser * kCoarser);
    return sampled;
  }
  sampled.count = kMostSampled;
  if (options.spacing == 0) sampled.count = std::min(options.count, sampled.count);
  sampled.spacing = 0;
  return sampled;
}

// How many surfels there will be; of cameras where `sampled` is of surfels that much coarser.
double expectedSurfels(const SampleOptions& options, const SampleStats& stats, double coarser) {
  if (!options.density.cameras.empty()) return double(stats.surfels) * coarser * coarser;
  const double pieces = options.spacing > 0
                            ? std::max(1., stats.area / (options.spacing * options.spacing))
                            : double(options.count);
  return pieces * double(stats.surfels) / double(stats.surfels + stats.clear_surfels);
}

Result<SampleForecast> forecastSampleIn(const ScratchFolder& folder,
                                        const std::vector<std::string>& meshes,
                                        const std::string& output, const SampleOptions& options,
                                        Progress& progress) {
  const std::string result = folder.fileLike(output);
  SilentProgress silent(progress);
  double coarser = kCoarser;
  Result<SampleStats> stats = sampleMeshes(meshes, result, fewer(options), silent);
  if (!options.density.cameras.empty() && stats.status().code() == StatusCode::kInvalidArgument) {
    // All triangles together may be less than one surfel of a sample
    coarser = 1;
    stats = sampleMeshes(meshes, result, options, silent);
  }
  if (!stats.ok()) return withName(stats.status(), result, output);
  const double surfels = expectedSurfels(options, *stats, coarser);
  const double times = surfels / double(std::max<std::uint64_t>(1, stats->surfels));
  SampleForecast forecast;
  forecast.records = std::uint64_t(surfels + .5);
  forecast.sampled_records = stats->surfels;
  forecast.input_bytes = bytesOf(meshes);
  forecast.memory_bytes = peakResidentBytes();
  forecast.temporary_bytes = std::uint64_t(double(stats->temporary_bytes) * times);
  forecast.output_bytes = std::uint64_t(double(fileBytesOf(result)) * times);
  forecast.seconds = stats->load_seconds + stats->build_seconds + stats->sample_seconds * times;
  return forecast;
}

Result<SampleForecast> forecastPhotonsIn(const ScratchFolder& folder,
                                         const std::vector<std::string>& meshes,
                                         const std::string& output,
                                         const PhotonTracingOptions& options, Progress& progress) {
  PhotonTracingOptions sampled = options;
  sampled.photons = std::min(options.photons, kMostSampled);
  SURFEIT_ASSIGN_OR_RETURN(const ScratchFolder caustics, ScratchFolder::create(folder.path()));
  const std::string result = folder.fileLike(output);
  if (!options.caustic_output.empty()) {
    sampled.caustic_output = caustics.fileLike(options.caustic_output);
  }
  SilentProgress silent(progress);
  const Result<PhotonTracingStats> traced = tracePhotons(meshes, result, sampled, silent);
  if (!traced.ok()) return withName(traced.status(), result, output);
  const PhotonTracingStats& stats = *traced;
  const double times = double(options.photons) / double(sampled.photons);
  SampleForecast forecast;
  forecast.records = options.photons;
  forecast.sampled_records = sampled.photons;
  forecast.input_bytes = bytesOf(meshes);
  forecast.memory_bytes = peakResidentBytes();
  forecast.temporary_bytes = std::uint64_t(double(stats.temporary_bytes) * times);
  const std::uint64_t bytes = fileBytesOf(result) + fileBytesOf(sampled.caustic_output);
  forecast.output_bytes = std::uint64_t(double(bytes) * times);
  forecast.seconds = stats.load_seconds + stats.build_seconds + stats.trace_seconds * times;
  return forecast;
}

Result<SampleForecast> forecastRelightIn(const ScratchFolder& folder, const std::string& scene_path,
                                         const std::string& result_path,
                                         const RelightOptions& options, Progress& progress) {
  SURFEIT_RETURN_IF_ERROR(checkReplacesNot(result_path, scene_path, "scene"));
  SURFEIT_ASSIGN_OR_RETURN(const SceneSample sample, sampleScene(scene_path, folder, progress));
  SilentProgress silent(progress);
  const Result<RelightStats> relit =
      relightScene(sample.path, folder.file("result.sft"), options, silent);
  if (!relit.ok()) return withName(relit.status(), sample.path, scene_path);
  const RelightStats& stats = *relit;
  SampleForecast forecast;
  forecast.records = sample.surfels;
  forecast.sampled_records = sample.sampled_surfels;
  forecast.input_bytes = sample.bytes + bytesOf(options.meshes);
  forecast.memory_bytes = peakResidentBytes();
  forecast.output_bytes =
      std::uint64_t(double(sample.bytes) * double(stats.file_bytes) / double(sample.sampled_bytes));
  forecast.seconds =
      stats.load_seconds + stats.build_seconds + stats.light_seconds * sample.times();
  return forecast;
}

// Calls `run` with a folder for an output.
template <typename Run>
Result<SampleForecast> inFolder(const std::string& output, const Run& run) {
  return guarded(output, [&]() -> Result<SampleForecast> {
    SURFEIT_ASSIGN_OR_RETURN(const ScratchFolder folder,
                             ScratchFolder::create(temporaryDirectory({}, output)));
    return run(folder);
  });
}

}  // namespace

Result<SampleForecast> forecastSample(const std::vector<std::string>& meshes,
                                      const std::string& output, const SampleOptions& options,
                                      Progress& progress) {
  return inFolder(output, [&](const ScratchFolder& folder) {
    return forecastSampleIn(folder, meshes, output, options, progress);
  });
}

Result<SampleForecast> forecastPhotons(const std::vector<std::string>& meshes,
                                       const std::string& output,
                                       const PhotonTracingOptions& options, Progress& progress) {
  return inFolder(output, [&](const ScratchFolder& folder) {
    return forecastPhotonsIn(folder, meshes, output, options, progress);
  });
}

Result<SampleForecast> forecastRelight(const std::string& scene_path,
                                       const std::string& result_path,
                                       const RelightOptions& options, Progress& progress) {
  return inFolder(result_path, [&](const ScratchFolder& folder) {
    return forecastRelightIn(folder, scene_path, result_path, options, progress);
  });
}

}  // namespace surfeit
