// What this process may use, beside what surfeit/process.h tells of it.
#pragma once

#include <cstdint>
#include <limits>
#include <string>

#include "surfeit/process.h"
#include "surfeit/status.h"

namespace surfeit {

inline constexpr std::uint64_t kNoMemoryLimit = std::numeric_limits<std::uint64_t>::max();

// memoryLimitBytes(), where /proc and /sys lie in `root`.
std::uint64_t memoryLimitBytes(const std::string& root);

// The budget of a command that was given none: three quarters of what the job may hold, no more
// than `most`.
std::uint64_t defaultMemoryBytes(std::uint64_t most = kNoMemoryLimit);

// kInvalidArgument for a number of threads that is neither 0 nor one to start.
Status checkThreadCount(int threads);

// Where the job wants its temporary files: SLURM_TMPDIR, else TMPDIR; empty where neither is set.
std::string jobTemporaryDirectory();

}  // namespace surfeit
