#include "surfeit/process.h"

#include <atomic>

#include "core/job_limits.h"
#include "core/process_cancelled.h"
#include "core/program_memory.h"
#include "core/resident_limit.h"

namespace surfeit {
namespace {

std::atomic<bool (*)()> process_cancelled{nullptr};

}  // namespace

void setProcessCancelled(bool (*is_cancelled)()) { process_cancelled = is_cancelled; }

bool isProcessCancelled() {
  bool (*const is_cancelled)() = process_cancelled;
  return is_cancelled != nullptr && is_cancelled();
}

void limitProcess(std::uint64_t memory_bytes) {
  countProgramInBudgets();
  if (programBytes(1) > 0) {
    limitResidentBytes(memory_bytes > 0 ? memory_bytes : defaultMemoryBytes());
  }
}

}  // namespace surfeit
