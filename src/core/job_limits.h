// What this process may use: its cgroup and batch job first, then the machine; and
// what it has used so far.
#pragma once

#include <cstdint>
#include <limits>
#include <string>

namespace surfeit {

inline constexpr std::uint64_t kNoMemoryLimit = std::numeric_limits<std::uint64_t>::max();

// Threads to use by default: SLURM_CPUS_PER_TASK, the CPUs the scheduler allows, at least 1.
int defaultThreadCount();

// Bytes of memory this job may hold: the smallest of SLURM_MEM_PER_NODE, SLURM_MEM_PER_CPU times
// the CPUs of the node (SLURM_CPUS_ON_NODE, else defaultThreadCount()), the memory limits of its
// cgroups (version 1 and 2, those above it too) and the machine's memory. /proc and /sys lie in
// `root`.
std::uint64_t memoryLimitBytes(const std::string& root = {});

// The budget of a command that was given none: three quarters of what the job may hold, no more
// than `most`.
std::uint64_t defaultMemoryBytes(std::uint64_t most = kNoMemoryLimit);

// Where the job wants its temporary files: SLURM_TMPDIR, else TMPDIR; empty where neither is set.
std::string jobTemporaryDirectory();

// Largest resident size of this process so far, in bytes.
std::uint64_t peakResidentBytes();

// Processor time of all threads of this process so far, in seconds.
double processCpuSeconds();

// The most threads that a job may ask for.
inline constexpr int kMostThreads = 4096;

}  // namespace surfeit
