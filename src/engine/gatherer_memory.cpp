#include "engine/gatherer_memory.h"

#include <algorithm>

#include "gather/packet/group_gatherer.h"

namespace surfeit {

std::uint64_t largeCutBytes(const GatherRules& rules, std::uint64_t surfels,
                            std::size_t bytes_beside_patch) {
  constexpr double kLayers = 8;
  // Rough nodes open to a quarter of the solid angle
  constexpr double kPatches = 4;
  const double bytes = 2 * double(sizeof(Patch) + bytes_beside_patch);  // vectors double
  const double cut = kPatches * 4 * double(kPi) / double(maxSolidAngle(rules)) * kLayers;
  const double most = std::min(double(surfels), cut);
  const double more = std::max(0.0, most - double(PacketRaster::kReservedPatches));
  return static_cast<std::uint64_t>(more * bytes);
}

std::uint64_t gathererBytes(const GatherRules& rules, std::uint64_t surfels) {
  constexpr std::uint64_t kThreadBytes = std::uint64_t{128} << 10;  // stack and allocator
  return GroupGatherer::memoryBytes(rules) + kThreadBytes +
         largeCutBytes(rules, surfels, 2 * sizeof(std::uint64_t));
}

}  // namespace surfeit
