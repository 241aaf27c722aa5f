// What a process takes beside the data that its jobs plan for. `--memory` is the limit of the
// process, so every plan of the program takes this off first.
#pragma once

#include <cstdint>

namespace surfeit {

// From now on budgets are limits of this process: programBytes() counts in all of them. Called by
// the program as a command begins. Elsewhere a budget is that of the job alone, and what its caller
// holds is the caller's business.
void countProgramInBudgets();

// Code, libraries, stacks, and what the allocator keeps, with so many threads at work; 0 where
// budgets do not count them, and under sanitizers, which multiply what they take. Safe from any
// thread.
std::uint64_t programBytes(int threads);

}  // namespace surfeit
