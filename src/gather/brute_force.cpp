#include "gather/brute_force.h"

namespace surfeit {

GatherResult gatherBruteForce(const Receiver& receiver, std::span<const Surfel> surfels,
                              GatherMode mode, const GatherQuality& quality) {
  ReceiverRaster raster(mode, quality);
  raster.begin(receiver);
  for (const Surfel& surfel : surfels) raster.addSurfel(surfel);
  return raster.finish();
}

}  // namespace surfeit
