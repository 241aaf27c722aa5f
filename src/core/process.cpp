#include "surfeit/process.h"

#include "core/job_limits.h"
#include "core/program_memory.h"
#include "core/resident_limit.h"

namespace surfeit {

void limitProcess(std::uint64_t memory_bytes) {
  countProgramInBudgets();
  if (programBytes(1) > 0) {
    limitResidentBytes(memory_bytes > 0 ? memory_bytes : defaultMemoryBytes());
  }
}

}  // namespace surfeit
