// Estimates normals for clouds that have none, from the neighbours of every point.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "surfeit/api.h"
#include "surfeit/job.h"
#include "surfeit/normal_estimation.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"
#include "surfeit/up_axis.h"

namespace surfeit {

// `memory_bytes`: 0 stands for three quarters of the memory that the job may hold, at most 1 GiB.
struct NormalsOptions : JobOptions, ReadOptions {
  NormalEstimation estimation;
  std::optional<UpAxis> up{};  // absent: the axis that the cloud states (surfeit/up_axis.h)
  bool with_sizes = false;     // write the area, too, as indexClouds would find it
};

struct NormalsStats {
  std::uint64_t points = 0;
  std::uint64_t without = 0;             // points on no surface: no normal, or two-sided
  std::uint64_t outside_trajectory = 0;  // points seen before its first time or after its last
  double mean_confidence = 0;            // over points with a confidence
  std::uint64_t memory_bytes = 0;
  std::uint64_t temporary_bytes = 0;
  double index_seconds = 0, seconds = 0;
};

// Writes `output`; its name tells the format. The output has the rows of the input in their order,
// with all their properties, and adds nx ny nz and normal_confidence (0 to 1: how flat the
// neighbours lie, Pauly et al. 2002), and the channels that the options ask for. Normals of the
// input are replaced, and a note says so. An octree of the positions stands in a temporary file
// meanwhile. Neither memory nor time per point depends on the size of the cloud or on the order of
// its points. Errors: as indexClouds, and errors of the formats.
SURFEIT_API Result<NormalsStats> estimateNormals(const std::string& input,
                                                 const std::string& output,
                                                 const NormalsOptions& options, Progress& progress);

}  // namespace surfeit
