// What gathers are judged by: rays traced on the true geometry of a scene, many enough to have
// converged.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "bench/internal/gather_scenes.h"
#include "gather/rules/receiver.h"
#include "surfeit/status.h"

namespace surfeit {

struct TruthOptions {
  int rays = 25600;  // the square of a multiple of 4
  int threads = 1;
};

// Occlusion and irradiance at the judged receivers of a set, in their order. With 25,600 rays
// their noise is about 0.0005 of occlusion and, on the lion, 0.4 % of color. Kept beside the scene
// when its directory is, and read from there next time. kFailed when Embree refuses, kIoError when
// the file cannot be written.
Result<std::vector<GatherResult>> traceTruth(const GatherScene& scene, const ReceiverSet& set,
                                             const TruthOptions& options);

}  // namespace surfeit
