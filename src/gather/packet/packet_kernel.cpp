#include "gather/packet/packet_kernel.h"

// Compiled once for every instruction set (Highway, "foreach_target").
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "gather/packet/packet_kernel.cpp"
#include <hwy/foreach_target.h>
// Highway's own headers come after
#include <hwy/highway.h>

#include "gather/packet/packet_kernel-inl.h"

HWY_BEFORE_NAMESPACE();
namespace surfeit {
namespace HWY_NAMESPACE {

PacketKernel Kernel() {
  return {.name = hwy::TargetName(HWY_TARGET),
          .findSeenPixels = FindSeenPixels,
          .facesThatSee = FacesThatSee,
          .seeLobe = SeeLobe,
          .seeSlope = SeeSlope,
          .seeRoughNode = SeeRoughNode,
          .draw = Draw,
          .integrate = Integrate,
          .readPixels = ReadPixels};
}

}  // namespace HWY_NAMESPACE
}  // namespace surfeit
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
#include "core/every_target.h"

namespace surfeit {
namespace {

HWY_EXPORT(Kernel);

}  // namespace

const PacketKernel& fastestPacketKernel() {
  static const PacketKernel kernel = HWY_DYNAMIC_DISPATCH(Kernel)();
  return kernel;
}

std::span<const PacketKernel> packetKernels() {
  static const auto kernels = forEveryTarget([] { return HWY_DYNAMIC_DISPATCH(Kernel)(); });
  return kernels;
}

}  // namespace surfeit
#endif
