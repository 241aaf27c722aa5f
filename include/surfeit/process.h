// What this process may use: its cgroup and batch job first, then the machine; and what it has used
// so far. All functions are safe from any thread.
#pragma once

#include <cstdint>

#include "surfeit/api.h"

namespace surfeit {

// The most threads that a job may ask for.
inline constexpr int kMostThreads = 4096;

// Threads that jobs use by default: SLURM_CPUS_PER_TASK, the CPUs the scheduler allows, at least 1.
SURFEIT_API int defaultThreadCount();

// Bytes of memory this job may hold: the smallest of SLURM_MEM_PER_NODE, SLURM_MEM_PER_CPU times
// the CPUs of the node (SLURM_CPUS_ON_NODE, else defaultThreadCount()), the memory limits of its
// cgroups (version 1 and 2, those above it too) and the machine's memory.
SURFEIT_API std::uint64_t memoryLimitBytes();

// Largest resident size of this process so far, in bytes; 0 where the system does not tell.
SURFEIT_API std::uint64_t peakResidentBytes();

// Processor time of all threads of this process so far, in seconds.
SURFEIT_API double processCpuSeconds();

// For a program that is one job: from now on a budget is the limit of this process, so that every
// plan first takes off what code, libraries, stacks and the allocator have; and what holds whole
// inputs (meshes) refuses with kBudgetTooSmall to go beyond `memory_bytes`, 0 being three quarters
// of memoryLimitBytes(). Without it a budget is that of a job alone, and meshes have no limit. Does
// nothing under sanitizers, which multiply what a process takes. Call before the jobs begin.
SURFEIT_API void limitProcess(std::uint64_t memory_bytes);

// For such a program, too: whatever reads an input asks this before every block, from any thread,
// and ends with kInterrupted when it is true. So an input that takes long to look into, before any
// Progress has a say, stops as well. nullptr, as at first: nobody is asked.
SURFEIT_API void setProcessCancelled(bool (*is_cancelled)());

// Reads of files that fail with EIO, as those of networked file systems may for a moment, are tried
// again up to so many times each, after 10 ms, 20 ms and so on, in this process. 0, as at first: a
// failed read is an error. What is read is checked as always.
SURFEIT_API void setReadRetries(int retries);
// How many reads were tried again so far.
SURFEIT_API std::uint64_t readsRetried();

}  // namespace surfeit
