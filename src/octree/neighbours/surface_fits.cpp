#include "octree/neighbours/surface_fits.h"

// Compiled once for every instruction set (Highway, "foreach_target"), without fused
// multiplications.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "octree/neighbours/surface_fits.cpp"
#include <hwy/foreach_target.h>
// Highway's own headers come after
#include <hwy/highway.h>

#include "octree/neighbours/cell_lanes-inl.h"
#include "octree/neighbours/surface_fits-inl.h"

HWY_BEFORE_NAMESPACE();
namespace surfeit {
namespace HWY_NAMESPACE {

SurfaceFitKernel SurfaceFitKernelHere() { return {.fit = FitSurfaces, .measure = MeasureCells}; }

}  // namespace HWY_NAMESPACE
}  // namespace surfeit
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
#include "core/every_target.h"

namespace surfeit {
namespace {

HWY_EXPORT(SurfaceFitKernelHere);

}  // namespace

const SurfaceFitKernel& fastestSurfaceFitKernel() {
  static const SurfaceFitKernel kernel = HWY_DYNAMIC_DISPATCH(SurfaceFitKernelHere)();
  return kernel;
}

std::span<const SurfaceFitKernel> surfaceFitKernels() {
  static const auto kernels =
      forEveryTarget([] { return HWY_DYNAMIC_DISPATCH(SurfaceFitKernelHere)(); });
  return kernels;
}

}  // namespace surfeit
#endif  // HWY_ONCE
