#include "core/job_limits.h"

#include <fmt/format.h>
#include <sched.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>

namespace surfeit {
namespace {

// The text of an environment variable; absent and empty ones are the same.
std::string textFromEnvironment(const char* name) {
  const char* text = std::getenv(name);
  return text == nullptr ? std::string() : text;
}

// The positive number in an environment variable, 0 when there is none.
std::uint64_t numberFromEnvironment(const char* name) {
  const char* text = std::getenv(name);
  if (text == nullptr) return 0;
  char* end = nullptr;
  const unsigned long long value = std::strtoull(text, &end, 10);
  return end != text && *end == '\0' ? value : 0;
}

// Lowers `limit` to the number in a control file; "max" and absent files change nothing.
void applyLimitFile(const std::string& path, std::uint64_t& limit) {
  std::ifstream file(path);
  std::uint64_t value = 0;
  if (file >> value && value > 0) limit = std::min(limit, value);
}

// Applies the limit of one cgroup and of all above it.
void applyCgroupLimits(const std::string& mount, std::string group, const char* file,
                       std::uint64_t& limit) {
  for (;;) {
    applyLimitFile(mount + group + "/" + file, limit);
    const std::size_t slash = group.rfind('/');
    if (slash == std::string::npos || group.empty()) return;
    group.resize(slash);
  }
}

// Bytes that Slurm gives this job on this node; no limit where it says nothing.
std::uint64_t slurmMemoryBytes() {
  std::uint64_t limit = kNoMemoryLimit;
  if (const std::uint64_t mebibytes = numberFromEnvironment("SLURM_MEM_PER_NODE")) {
    limit = mebibytes << 20;
  }
  if (const std::uint64_t mebibytes = numberFromEnvironment("SLURM_MEM_PER_CPU")) {
    std::uint64_t cpus = numberFromEnvironment("SLURM_CPUS_ON_NODE");
    if (cpus == 0) cpus = static_cast<std::uint64_t>(defaultThreadCount());
    limit = std::min(limit, (mebibytes << 20) * cpus);
  }
  return limit;
}

}  // namespace

Status checkThreadCount(int threads) {
  if (threads >= 0 && threads <= kMostThreads) return {};
  return Status::invalidArgument(
      fmt::format("thread count is {}, expected 0 to {}", threads, kMostThreads));
}

int defaultThreadCount() {
  if (const std::uint64_t cpus = numberFromEnvironment("SLURM_CPUS_PER_TASK")) {
    return static_cast<int>(std::min<std::uint64_t>(cpus, 4096));
  }
  cpu_set_t allowed;
  if (sched_getaffinity(0, sizeof allowed, &allowed) == 0) return std::max(1, CPU_COUNT(&allowed));
  return std::max(1, static_cast<int>(sysconf(_SC_NPROCESSORS_ONLN)));
}

std::uint64_t memoryLimitBytes(const std::string& root) {
  const std::uint64_t page_bytes = static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE));
  std::uint64_t limit = static_cast<std::uint64_t>(sysconf(_SC_PHYS_PAGES)) * page_bytes;
  limit = std::min(limit, slurmMemoryBytes());
  // Lines of /proc/self/cgroup: "0::/group" (version 2) or "4:memory:/group" (version 1)
  std::ifstream cgroups(root + "/proc/self/cgroup");
  for (std::string line; std::getline(cgroups, line);) {
    const std::size_t first = line.find(':');
    const std::size_t second = line.find(':', first + 1);
    if (first == std::string::npos || second == std::string::npos) continue;
    const std::string controllers = line.substr(first + 1, second - first - 1);
    const std::string group = line.substr(second + 1);
    if (controllers.empty()) {
      applyCgroupLimits(root + "/sys/fs/cgroup", group, "memory.max", limit);
    } else if (controllers.find("memory") != std::string::npos) {
      applyCgroupLimits(root + "/sys/fs/cgroup/memory", group, "memory.limit_in_bytes", limit);
    }
  }
  return limit;
}

std::uint64_t memoryLimitBytes() { return memoryLimitBytes(std::string()); }

std::uint64_t defaultMemoryBytes(std::uint64_t most) {
  return std::min(most, memoryLimitBytes() / 4 * 3);
}

std::string jobTemporaryDirectory() {
  const std::string of_job = textFromEnvironment("SLURM_TMPDIR");
  return of_job.empty() ? textFromEnvironment("TMPDIR") : of_job;
}

std::uint64_t peakResidentBytes() {
  // Not getrusage: its peak survives exec, so a small program started by a large one would report
  // the large one's
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.rfind("VmHWM:", 0) == 0) return std::strtoull(line.c_str() + 6, nullptr, 10) * 1024;
  }
  return 0;
}

double processCpuSeconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return double(now.tv_sec) + 1e-9 * double(now.tv_nsec);
}

}  // namespace surfeit
