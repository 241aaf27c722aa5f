// What this process may use: its cgroup and batch job first, then the machine; and
// what it has used so far.
#pragma once

#include <cstdint>

namespace surfeit {

// Threads to use by default: SLURM_CPUS_PER_TASK, the CPUs the scheduler allows, at least 1.
int defaultThreadCount();

// Bytes of memory this job may hold: the smallest of SLURM_MEM_PER_NODE, the memory limits of its
// cgroups (version 1 and 2) and the machine's memory.
std::uint64_t memoryLimitBytes();

// Largest resident size of this process so far, in bytes.
std::uint64_t peakResidentBytes();

// Processor time of all threads of this process so far, in seconds.
double processCpuSeconds();

}  // namespace surfeit
