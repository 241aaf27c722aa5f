// Building the paged octree file (.sft) from surfel clouds, offline.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "surfeit/api.h"
#include "surfeit/job.h"
#include "surfeit/normal_estimation.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"
#include "surfeit/up_axis.h"

namespace surfeit {

// What becomes of surfels that repeat another: of one position, as the scene counts it (floats
// about its origin), one group, and facing the same way.
enum class Repeats {
  kKeep,  // all stay, and their areas count twice, which is told
  kThin,  // one stays, the same for any order of the inputs; how many do not is told
};

// `memory_bytes` 0 stands for 1 GiB, or three quarters of what the job may hold where that is less.
struct IndexOptions : JobOptions, ReadOptions {
  std::uint32_t leaf_capacity = 16;  // surfels per leaf (memo 3.2: "less than 16" or so)
  float disk_overlap = 2;            // disk area over surfel area where one must be made up
                                     // (--disk-overlap)
  Repeats repeats = Repeats::kKeep;  // of overlapping clouds, such as tiles (--overlap)
  bool full_precision = false;       // keep floats instead of quantized values
  // What places are counted from in the scene, in the cloud's coordinates: finite, at most 1e12.
  // Absent: 0 for clouds about 0, a corner of their root cube for others (docs/format.md). Scenes
  // of one sequence may share one.
  std::optional<glm::dvec3> origin{};
  // What is up. Absent: what the inputs say (surfeit/up_axis.h).
  std::optional<UpAxis> up{};
  // Surfels without a normal get one from their neighbours, as those of surfeit/normals.h do; those
  // on no surface stay spheres or are seen from both sides. Absent: they are spheres.
  std::optional<NormalEstimation> normals{};
};

struct IndexStats {
  std::uint64_t memory_bytes = 0;  // the budget
  std::uint64_t input_bytes = 0;   // of the input files
  std::uint64_t surfels = 0;
  std::uint64_t skipped_records = 0;
  // That repeat another: left out with Repeats::kThin; else kept, and counted where they bring
  // their sizes.
  std::uint64_t repeated_surfels = 0;
  std::uint64_t normals_found = 0;  // from the neighbours
  std::uint64_t thin_surfels = 0;   // on no surface, of those that lacked a normal
  std::uint64_t nodes = 0;
  std::uint64_t node_pages = 0;
  std::uint64_t surfel_pages = 0;
  std::uint64_t file_bytes = 0;
  std::uint64_t temporary_bytes = 0;  // most bytes of temporary files at any time
  std::vector<std::pair<std::string, double>> phase_seconds;
};

// Writes `output` from the surfels of all inputs. The result depends on the surfels alone: not on
// their order, the threads or the budget. It appears under its name only when complete. What an
// input lacks is filled in by the rules of docs/format.md and told through progress.note().
// Errors: kIoError, kCorruption (bad input, or no valid surfel at all), kInvalidArgument,
// kBudgetTooSmall, kInterrupted.
SURFEIT_API Result<IndexStats> indexClouds(const std::vector<std::string>& inputs,
                                           const std::string& output, const IndexOptions& options,
                                           Progress& progress);

// What indexClouds will take, about.
struct IndexForecast {
  std::uint64_t records = 0, sampled_surfels = 0;
  std::uint64_t input_bytes = 0;
  std::uint64_t memory_bytes = 0;
  std::uint64_t temporary_bytes = 0;
  std::uint64_t file_bytes = 0;
  double seconds = 0;  // without the reading of the inputs
};

// Indexes a sample from all over the inputs, in the folder of temporary files, and multiplies: a
// sample is less dense, so the file will be somewhat smaller. Writes nothing else. Errors: as of
// indexClouds.
SURFEIT_API Result<IndexForecast> forecastIndex(const std::vector<std::string>& inputs,
                                                const std::string& output,
                                                const IndexOptions& options, Progress& progress);

}  // namespace surfeit
