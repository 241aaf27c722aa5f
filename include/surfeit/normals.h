// Normals for clouds that have none, from the neighbours of every point.
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

// `memory_bytes` 0 stands for three quarters of what the job may hold, at most 1 GiB.
struct NormalsOptions : JobOptions, ReadOptions {
  NormalEstimation estimation;
  std::optional<UpAxis> up{};  // absent: what the cloud says (surfeit/up_axis.h)
  bool with_sizes = false;     // radius and area, too, as index would find them
};

struct NormalsStats {
  std::uint64_t points = 0;
  std::uint64_t without = 0;             // points that get no normal, or one seen from both sides
  std::uint64_t outside_trajectory = 0;  // points seen before its first place or after its last
  double mean_confidence = 0;            // of those with one
  std::uint64_t memory_bytes = 0;
  std::uint64_t temporary_bytes = 0;
  double index_seconds = 0, seconds = 0;
};

// Writes `output`, whose format its name tells, with all that the input has and the properties nx
// ny nz and normal_confidence (0 to 1: how flat the neighbours lie, Pauly et al. 2002), and what
// the options ask for; rows stay in their order. Normals that the input has are replaced, which is
// told. An octree of the places stands in a temporary file meanwhile. Neither memory nor time per
// point depends on the size of the cloud or the order of its points. Errors: as of indexClouds and
// of the formats.
SURFEIT_API Result<NormalsStats> estimateNormals(const std::string& input,
                                                 const std::string& output,
                                                 const NormalsOptions& options, Progress& progress);

}  // namespace surfeit
