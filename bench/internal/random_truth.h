// Occlusion at the receivers of random scenes by rays on the true geometry.
#pragma once

#include <vector>

#include "random/random_scene.h"
#include "surfeit/gather.h"
#include "surfeit/status.h"

namespace surfeit {

// Rays pass through backs of one-sided triangles unless sides are kBoth, as the gather does; with
// kBack through their fronts. `rays` is the square of a multiple of 4. Negative at receivers that
// have no truth: those without a normal that are close to spheres, which the gather takes to be
// their own surface. Builds and traces on the calling thread. kFailed when Embree refuses.
Result<std::vector<float>> traceOcclusion(const RandomScene& scene, GatherSides sides, int rays);

}  // namespace surfeit
