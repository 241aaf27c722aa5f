#include "core/program_memory.h"

#include <algorithm>
#include <atomic>

#include "core/job_limits.h"

namespace surfeit {
namespace {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kIsSanitized = true;
#else
constexpr bool kIsSanitized = false;
#endif

constexpr std::uint64_t kMega = 1 << 20;
// When a command begins the program has 9.4 to 11.6 MiB, by machine and run; code that runs later
// and what the allocator keeps add up to 2.5 MiB, a thread .85 (docs/architecture.md, "Memory", has
// the measurements). The least is a constant, so that the same budget does or does not do in every
// run.
constexpr std::uint64_t kLeastBytes = 15 * kMega, kGrowthBytes = 5 * kMega / 2,
                        kThreadBytes = kMega;

std::atomic<std::uint64_t> program_bytes{0};

}  // namespace

void countProgramInBudgets() {
  if (!kIsSanitized) program_bytes = std::max(kLeastBytes, peakResidentBytes() + kGrowthBytes);
}

std::uint64_t programBytes(int threads) {
  const std::uint64_t bytes = program_bytes;
  return bytes == 0 ? 0 : bytes + static_cast<std::uint64_t>(threads) * kThreadBytes;
}

}  // namespace surfeit
