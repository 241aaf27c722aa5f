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
#include <vector>

namespace surfeit {
namespace {

HWY_EXPORT(SurfaceFitKernelHere);

std::vector<SurfaceFitKernel> allKernels() {
  std::vector<SurfaceFitKernel> kernels;
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    kernels.push_back(HWY_DYNAMIC_DISPATCH(SurfaceFitKernelHere)());
  }
  hwy::SetSupportedTargetsForTest(0);
  return kernels;
}

}  // namespace

const SurfaceFitKernel& fastestSurfaceFitKernel() {
  static const SurfaceFitKernel kernel = HWY_DYNAMIC_DISPATCH(SurfaceFitKernelHere)();
  return kernel;
}

std::span<const SurfaceFitKernel> surfaceFitKernels() {
  static const std::vector<SurfaceFitKernel> kernels = allKernels();
  return kernels;
}

}  // namespace surfeit
#endif  // HWY_ONCE
