// Builds the paged octree file (.sft) from surfel clouds, offline.
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
#include "surfeit/scene.h"
#include "surfeit/status.h"
#include "surfeit/up_axis.h"

namespace surfeit {

// Treatment of surfels that repeat another: at the same position in the scene (in floats about its
// origin), in the same object group, and facing the same way.
enum class Repeats {
  kKeep,  // all stay; their areas count more than once, and a note reports their number
  kThin,  // one stays, the same for any order of the inputs; a note reports the number left out
};

// An input whose surfels belong to the object group of that name.
struct NamedInput {
  std::string name;  // as checkGroupName has it (surfeit/group_names.h)
  std::string path;
};

// `memory_bytes`: 0 stands for 1 GiB, or for three quarters of the memory that the job may hold
// where that is less.
struct IndexOptions : JobOptions, ReadOptions {
  std::uint32_t leaf_capacity = 16;  // surfels per leaf (memo 3.2: "less than 16" or so)
  float disk_overlap = 2;            // disk area over surfel area, where radius or area is
                                     // missing; without both, disks move to mid-cell
  Repeats repeats = Repeats::kKeep;  // of overlapping clouds, such as tiles (--overlap)
  bool full_precision = false;       // keep floats instead of quantized values
  // The origin of positions in the scene, in the cloud's coordinates: finite, at most 1e12. Absent:
  // 0 for clouds about 0, a corner of the root cube for others (docs/format.md). Scenes of one
  // sequence may share an origin.
  std::optional<glm::dvec3> origin{};
  // The root cube. Scenes of one sequence that share a cube share their cells, so that a surfel
  // that comes or goes changes no node but those that it lies in. Surfels outside are an error,
  // which names a cube that holds all. Origin and size are at most 1e12; where `origin` is absent,
  // it follows from the cube alone: 0, or the corner of a cube far away. Absent: the least cube
  // about the surfels (docs/format.md). A cube equal to that one changes nothing.
  std::optional<SceneCube> cube{};
  // The axis that points up. Absent: the axis that the inputs state (surfeit/up_axis.h).
  std::optional<UpAxis> up{};
  // Estimates a normal from the neighbours for each surfel without one, as surfeit/normals.h does.
  // Surfels on no surface stay spheres or become two-sided. Absent: surfels without a normal are
  // spheres.
  std::optional<NormalEstimation> normals{};
  // More input files, whose surfels belong to object groups with names, which the scene keeps.
  // Names get the groups 1, 2, ... in the order in which they come here; files of one name are one
  // group, in place of groups of their own. Surfels of the other inputs keep their groups, or have
  // 0.
  std::vector<NamedInput> named{};
};

struct IndexStats {
  std::uint64_t memory_bytes = 0;  // the budget
  std::uint64_t input_bytes = 0;   // of the input files
  std::uint64_t surfels = 0;
  std::uint64_t skipped_records = 0;
  // Surfels that repeat another: left out with Repeats::kThin; else kept, and counted only where
  // they bring radius and area.
  std::uint64_t repeated_surfels = 0;
  std::uint64_t normals_found = 0;  // surfels with a normal from their neighbours
  std::uint64_t thin_surfels = 0;   // surfels without a normal that lie on no surface
  // Surfels that scatter about a surface, whose disks stand on it instead.
  std::uint64_t scattered_surfels = 0;
  std::uint64_t nodes = 0;
  std::uint64_t node_pages = 0;
  std::uint64_t surfel_pages = 0;
  std::uint64_t file_bytes = 0;
  std::uint64_t temporary_bytes = 0;  // most bytes of temporary files at any time
  std::vector<std::pair<std::string, double>> phase_seconds;
};

// Writes `output` from the surfels of all inputs. The result depends only on the surfels and the
// options that describe the scene, not on the order of the surfels, the threads or the budget. It
// appears under its name only when complete. Channels that an input lacks are filled in by the
// rules of docs/format.md and reported through progress.note(). `inputs` may be empty where
// `options.named` is not.
// Errors: kIoError, kCorruption (bad input, or no valid surfel at all), kInvalidArgument,
// kBudgetTooSmall, kInterrupted.
SURFEIT_API Result<IndexStats> indexClouds(const std::vector<std::string>& inputs,
                                           const std::string& output, const IndexOptions& options,
                                           Progress& progress);

// An estimate of what indexClouds needs.
struct IndexForecast {
  std::uint64_t records = 0, sampled_surfels = 0;
  std::uint64_t input_bytes = 0;
  std::uint64_t memory_bytes = 0;
  std::uint64_t temporary_bytes = 0;
  std::uint64_t file_bytes = 0;
  double seconds = 0;  // without the time to read the inputs
};

// Indexes a sample from all over the inputs, in the directory of temporary files, and scales the
// figures up. A sample is less dense, so the real file is somewhat smaller than forecast. Writes
// nothing else. Errors: as indexClouds.
SURFEIT_API Result<IndexForecast> forecastIndex(const std::vector<std::string>& inputs,
                                                const std::string& output,
                                                const IndexOptions& options, Progress& progress);

}  // namespace surfeit
