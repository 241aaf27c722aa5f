#include "octree/neighbours/nearest_kernel.h"

// Compiled once for every instruction set (Highway, "foreach_target"), without fused
// multiplications.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "octree/neighbours/nearest_kernel.cpp"
#include <hwy/foreach_target.h>
// Highway's own headers come after
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace surfeit {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<float, PlaceColumns::kPadding>;
using DI = hn::RebindToSigned<D>;
using DU = hn::RebindToUnsigned<D>;
using V = hn::Vec<D>;
constexpr std::size_t kStep = hn::MaxLanes(D());

V SquareSum(V x, V y, V z) { return hn::Add(hn::Add(hn::Mul(x, x), hn::Mul(y, y)), hn::Mul(z, z)); }

// How far intervals lie from one, along an axis.
V Gap(const float* lows, const float* highs, float low, float high) {
  const D d;
  return hn::Max(hn::Max(hn::Sub(hn::LoadU(d, lows), hn::Set(d, high)),
                         hn::Sub(hn::Set(d, low), hn::LoadU(d, highs))),
                 hn::Zero(d));
}

// Squared distances of boxes from one.
V BoxDistances(const BoxColumns& boxes, std::size_t i, const float* low, const float* high) {
  return SquareSum(Gap(boxes.low.x.data() + i, boxes.high.x.data() + i, low[0], high[0]),
                   Gap(boxes.low.y.data() + i, boxes.high.y.data() + i, low[1], high[1]),
                   Gap(boxes.low.z.data() + i, boxes.high.z.data() + i, low[2], high[2]));
}

std::size_t BoxesWithin(const BoxColumns& boxes, const float* low, const float* high, float most_sq,
                        std::uint32_t* found) {
  const D d;
  const DU du;
  const std::size_t all = boxes.low.size();
  std::size_t count = 0;
  for (std::size_t i = 0; i < all; i += kStep) {
    const auto is_near =
        hn::RebindMask(du, hn::Le(BoxDistances(boxes, i, low, high), hn::Set(d, most_sq)));
    if (hn::AllFalse(du, is_near)) continue;
    // To memory at once would be many times as slow on some machines
    const auto indices = hn::Iota(du, static_cast<std::uint32_t>(i));
    hn::StoreU(hn::Compress(indices, is_near), du, found + count);
    count += hn::CountTrue(du, is_near);
  }
  while (count > 0 && found[count - 1] >= all) --count;  // of the padding
  return count;
}

bool IsAnyBoxWithin(const BoxColumns& boxes, const float* low, const float* high, float most_sq) {
  const D d;
  const std::size_t all = boxes.low.size();
  for (std::size_t i = 0; i < all; i += kStep) {
    const auto is_near = hn::Le(BoxDistances(boxes, i, low, high), hn::Set(d, most_sq));
    if (!hn::AllFalse(d, hn::And(is_near, hn::FirstN(d, all - i)))) return true;
  }
  return false;
}

std::size_t PlacesWithin(const PlaceColumns& places, const float* position, float most_sq,
                         std::uint32_t* found, float* distance_sq) {
  const D d;
  const DU du;
  const V x = hn::Set(d, position[0]), y = hn::Set(d, position[1]), z = hn::Set(d, position[2]);
  const V most = hn::Set(d, most_sq);
  const std::size_t all = places.size();
  std::size_t count = 0;
  for (std::size_t i = 0; i < all; i += kStep) {
    const V squares = SquareSum(hn::Sub(hn::LoadU(d, places.x.data() + i), x),
                                hn::Sub(hn::LoadU(d, places.y.data() + i), y),
                                hn::Sub(hn::LoadU(d, places.z.data() + i), z));
    const auto is_near = hn::Le(squares, most);
    const auto indices = hn::Iota(du, static_cast<std::uint32_t>(i));
    hn::StoreU(hn::Compress(squares, is_near), d, distance_sq + count);
    hn::StoreU(hn::Compress(indices, hn::RebindMask(du, is_near)), du, found + count);
    count += hn::CountTrue(d, is_near);
  }
  return count;
}

void Rank(const float* values, std::size_t count, std::int32_t* ranks) {
  const D d;
  const DI di;
  const auto one = hn::Set(di, 1);
  for (std::size_t i = 0; i < count; i += kStep) {
    const V those = hn::LoadU(d, values + i);
    auto rank = hn::Zero(di);
    for (std::size_t j = 0; j < count; ++j) {
      const auto is_less = hn::Lt(hn::Set(d, values[j]), those);
      rank = hn::Add(rank, hn::IfThenElseZero(hn::RebindMask(di, is_less), one));
    }
    hn::StoreU(rank, di, ranks + i);
  }
}

}  // namespace

NearestKernel NearestKernelHere() {
  return {.boxesWithin = BoxesWithin,
          .isAnyBoxWithin = IsAnyBoxWithin,
          .placesWithin = PlacesWithin,
          .rank = Rank};
}

}  // namespace HWY_NAMESPACE
}  // namespace surfeit
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
#include "core/every_target.h"

namespace surfeit {
namespace {

HWY_EXPORT(NearestKernelHere);

}  // namespace

const NearestKernel& fastestNearestKernel() {
  static const NearestKernel kernel = HWY_DYNAMIC_DISPATCH(NearestKernelHere)();
  return kernel;
}

std::span<const NearestKernel> nearestKernels() {
  static const auto kernels =
      forEveryTarget([] { return HWY_DYNAMIC_DISPATCH(NearestKernelHere)(); });
  return kernels;
}

}  // namespace surfeit
#endif  // HWY_ONCE
