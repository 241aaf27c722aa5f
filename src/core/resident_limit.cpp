#include "core/resident_limit.h"

#include <fmt/format.h>
#include <unistd.h>
#ifdef __GLIBC__
#include <malloc.h>
#endif

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <limits>

namespace surfeit {
namespace {

// The parts of a step from which the rest can be foreseen roughly, and well.
constexpr double kRoughlyForeseen = 0.1, kForeseen = 0.5;
constexpr double kRoughness = 1.5;
// Before that, so much is too little to foresee anything from: what would do shows a little later,
// also where the budget has no room for it.
constexpr std::uint64_t kUnforeseenBytes = std::uint64_t{8} << 20;

std::atomic<std::uint64_t> limit{0}, resident_at_first{0};

std::uint64_t residentBytes() {
  std::FILE* const file = std::fopen("/proc/self/statm", "re");
  if (file == nullptr) return 0;
  unsigned long long pages = 0;
  const int found = std::fscanf(file, "%*u %llu", &pages);
  std::fclose(file);
  return found == 1 ? pages * static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE)) : 0;
}

}  // namespace

void limitResidentBytes(std::uint64_t bytes) {
  resident_at_first = residentBytes();
  limit = bytes;
}

void beginResidentStep() {
#ifdef __GLIBC__
  malloc_trim(0);
#endif
  if (limit != 0) resident_at_first = residentBytes();
}

ResidentRoom residentRoom() {
  const std::uint64_t most = limit;
  if (most == 0) return {0, std::numeric_limits<std::uint64_t>::max()};
  const std::uint64_t resident = residentBytes();
  return {resident, most - std::min(most, resident)};
}

Status checkResidentBytes(const std::string& what, std::uint64_t more_bytes, double part,
                          double times) {
  const std::uint64_t most = limit;
  if (most == 0) return {};
  const std::uint64_t resident = residentBytes(), base = resident_at_first;
  if (more_bytes == 0 && part < kRoughlyForeseen && resident < base + kUnforeseenBytes) return {};
  const double held = double(resident - std::min(resident, base)) / std::clamp(part, .01, 1.);
  const double needed = double(base) + times * held + double(more_bytes);
  const bool is_foreseen = (part >= kForeseen && needed > double(most)) ||
                           (part >= kRoughlyForeseen && needed > kRoughness * double(most));
  if (resident + more_bytes <= most && !is_foreseen) return {};
  // Early, the rest may take more than what is there lets expect
  const double named = needed * (1 + 0.5 * (1 - std::min(part, 1.0)));
  return Status::budgetTooSmall(fmt::format(
      "{}: a memory budget of {} MiB is too small for what is held: {:.0f} MiB would do", what,
      most >> 20, std::ceil(std::max(named, 1.05 * double(most)) / (1 << 20)) + 1));
}

}  // namespace surfeit
