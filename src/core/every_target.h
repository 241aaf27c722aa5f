// A kernel for every instruction set that this machine has and the build knows, for tests and
// benches.
#pragma once

#include <hwy/targets.h>

#include <cstdint>
#include <type_traits>
#include <vector>

namespace surfeit {

// `here`: dispatches to the target that is chosen (HWY_DYNAMIC_DISPATCH), and answers its kernel.
// Changes for a while what others are dispatched to: one thread at a time.
template <typename Here>
std::vector<std::invoke_result_t<Here>> forEveryTarget(const Here& here) {
  std::vector<std::invoke_result_t<Here>> kernels;
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    kernels.push_back(here());
  }
  hwy::SetSupportedTargetsForTest(0);
  return kernels;
}

}  // namespace surfeit
