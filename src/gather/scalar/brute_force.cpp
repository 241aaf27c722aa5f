#include "gather/scalar/brute_force.h"

namespace surfeit {

GatherResult gatherBruteForce(const LocalReceiver& receiver, std::span<const Surfel> surfels,
                              const GatherRules& rules) {
  ReceiverRaster raster(rules);
  raster.begin(receiver);
  for (const Surfel& surfel : surfels) {
    if ((rules.groups & groupBit(surfel.group)) != 0) raster.addSurfel(surfel);
  }
  return raster.finish();
}

}  // namespace surfeit
