// Samples of clouds and scenes for forecasts: runs of neighbours from all over, so that what is
// near each other in a file stays so.
#pragma once

#include <cstdint>
#include <string>

#include "cloud/rows/row_reader.h"
#include "storage/scratch_folder.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

inline constexpr std::uint64_t kMostSampledRows = 65536;
// Of a scene, which is indexed within the least memory that a bounce takes.
inline constexpr std::uint64_t kMostSampledSurfels = 16384;

// Writes `most` rows from all over to a PLY file, or of what cannot be sought in the first. Returns
// how many.
Result<std::uint64_t> sampleRows(RowReader& reader, std::uint64_t most, const std::string& path);

// A scene of some of the surfels of a scene.
struct SceneSample {
  std::string path;
  std::uint64_t surfels = 0, sampled_surfels = 0;
  std::uint64_t bytes = 0, sampled_bytes = 0;  // of the files

  double times() const { return double(surfels) / double(sampled_surfels); }
};

// In a folder, which must outlive it.
Result<SceneSample> sampleScene(const std::string& scene, const ScratchFolder& folder,
                                Progress& progress);

}  // namespace surfeit
