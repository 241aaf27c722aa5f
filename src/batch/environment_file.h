// Environments from files.
#pragma once

#include "gather/light/environment_map.h"
#include "surfeit/bake.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

// Reads a lat-long picture (OpenEXR or Radiance), which must be twice as wide as high, or an
// OpenEXR cube map, six times as high as wide; the formats are told apart by their contents
// (cloud/pictures/picture_reader.h). Values that are negative, infinite or NaN become 0, with one
// note. kInvalidArgument for options out of range and pictures of another shape or too large, else
// as PictureReader. Takes up to 70 MB more than the map holds for a while.
Result<EnvironmentMap> loadEnvironmentMap(const GatherEnvironment& environment, Progress& progress);

}  // namespace surfeit
