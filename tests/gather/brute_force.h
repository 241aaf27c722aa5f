// The gather of every surfel by itself, without octree and cut.
#pragma once

#include <span>

#include "gather/cut/cut.h"
#include "gather/packet/packet_raster.h"
#include "gather/rules/gather_rules.h"
#include "surfeit/surfel.h"

namespace surfeit {

// A gather with a max solid angle of 0 over the same surfels equals it, but that equal distances
// are drawn in the order of the surfels.
inline GatherResult gatherBruteForce(const LocalReceiver& receiver, std::span<const Surfel> surfels,
                                     const GatherRules& rules) {
  PacketRaster raster(rules);
  raster.begin({&receiver, 1}, viewPacket({&receiver, 1}, rules));
  for (const Surfel& surfel : surfels) {
    if ((rules.groups & groupBit(surfel.group)) != 0) raster.addSurfels({&surfel, 1});
  }
  raster.sort();
  raster.draw();
  GatherResult result;
  raster.integrate({&result, 1});
  return result;
}

}  // namespace surfeit
