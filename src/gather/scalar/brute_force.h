// The reference gather: every surfel by itself, no octree and no cut. A gather with
// max_solid_angle = 0 over the same surfels must equal it. For tests and benches.
#pragma once

#include <span>

#include "gather/rules/gather_rules.h"
#include "gather/scalar/receiver_raster.h"
#include "surfeit/gather.h"
#include "surfeit/surfel.h"

namespace surfeit {

// `rules` must be valid, as for PointGatherer; their max_solid_angle does not matter. Takes time
// and memory (120 bytes per surfel at worst) in proportion to the surfels, at every call.
GatherResult gatherBruteForce(const LocalReceiver& receiver, std::span<const Surfel> surfels,
                              const GatherRules& rules);

}  // namespace surfeit
