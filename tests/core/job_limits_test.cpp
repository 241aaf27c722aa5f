#include "core/job_limits.h"

#include <gtest/gtest.h>
#include <stdlib.h>

#include <filesystem>
#include <fstream>
#include <string>

namespace surfeit {
namespace {

constexpr std::uint64_t kMega = 1 << 20;

// A job with its own variables and its own /proc and /sys. Limits are far below the machine's
// memory.
class JobLimits : public testing::Test {
 protected:
  JobLimits() {
    for (const char* name : kVariables) unsetenv(name);
    std::string name = (std::filesystem::temp_directory_path() / "surfeit_limits_XXXXXX").string();
    root_ = mkdtemp(name.data());
  }
  ~JobLimits() override {
    for (const char* name : kVariables) unsetenv(name);
    std::filesystem::remove_all(root_);
  }

  void write(const std::string& path, const std::string& text) const {
    std::filesystem::create_directories(std::filesystem::path(root_ + path).parent_path());
    std::ofstream(root_ + path) << text << '\n';
  }
  static void set(const char* name, const char* value) { setenv(name, value, 1); }
  std::uint64_t limit() const { return memoryLimitBytes(root_); }

  std::string root_;

 private:
  static constexpr const char* kVariables[] = {"SLURM_MEM_PER_NODE", "SLURM_MEM_PER_CPU",
                                               "SLURM_CPUS_ON_NODE", "SLURM_CPUS_PER_TASK",
                                               "SLURM_TMPDIR",       "TMPDIR"};
};

TEST_F(JobLimits, WithoutAJobTheMachineIsTheLimit) {
  const std::uint64_t machine = limit();
  EXPECT_GT(machine, 256 * kMega);
  set("SLURM_MEM_PER_NODE", "0");  // Slurm: all of the node
  EXPECT_EQ(limit(), machine);
  set("SLURM_MEM_PER_NODE", "99999999999");
  EXPECT_EQ(limit(), machine);
}

TEST_F(JobLimits, MemoryPerNodeIsInMebibytes) {
  set("SLURM_MEM_PER_NODE", "64");
  EXPECT_EQ(limit(), 64 * kMega);
}

TEST_F(JobLimits, MemoryPerCpuIsMultipliedByTheCpusOfTheNode) {
  set("SLURM_MEM_PER_CPU", "10");
  EXPECT_EQ(limit(), 10 * kMega * static_cast<std::uint64_t>(defaultThreadCount()));
  set("SLURM_CPUS_PER_TASK", "3");
  EXPECT_EQ(limit(), 30 * kMega);
  set("SLURM_CPUS_ON_NODE", "7");
  EXPECT_EQ(limit(), 70 * kMega);
  set("SLURM_MEM_PER_NODE", "50");
  EXPECT_EQ(limit(), 50 * kMega);
}

TEST_F(JobLimits, CgroupsOfVersion2LimitAndSoDoThoseAbove) {
  write("/proc/self/cgroup", "0::/job/step");
  write("/sys/fs/cgroup/job/step/memory.max", "max");
  write("/sys/fs/cgroup/job/memory.max", std::to_string(96 * kMega));
  EXPECT_EQ(limit(), 96 * kMega);
  write("/sys/fs/cgroup/job/step/memory.max", std::to_string(80 * kMega));
  EXPECT_EQ(limit(), 80 * kMega);
  // In a container the mount is the group itself
  write("/sys/fs/cgroup/memory.max", std::to_string(72 * kMega));
  EXPECT_EQ(limit(), 72 * kMega);
}

TEST_F(JobLimits, CgroupsOfVersion1Limit) {
  write("/proc/self/cgroup", "5:cpu,cpuacct:/job\n4:memory:/job");
  write("/sys/fs/cgroup/memory/job/memory.limit_in_bytes", std::to_string(96 * kMega));
  write("/sys/fs/cgroup/memory/memory.limit_in_bytes", "9223372036854771712");
  EXPECT_EQ(limit(), 96 * kMega);
}

TEST_F(JobLimits, TheSmallestLimitCounts) {
  write("/proc/self/cgroup", "0::/job");
  write("/sys/fs/cgroup/job/memory.max", std::to_string(96 * kMega));
  set("SLURM_MEM_PER_NODE", "128");
  EXPECT_EQ(limit(), 96 * kMega);
  set("SLURM_MEM_PER_NODE", "64");
  EXPECT_EQ(limit(), 64 * kMega);
}

TEST_F(JobLimits, DefaultsAreThreeQuartersOfTheJob) {
  set("SLURM_MEM_PER_NODE", "64");
  EXPECT_LE(defaultMemoryBytes(), 48 * kMega);
  EXPECT_EQ(defaultMemoryBytes(kMega), kMega);
}

TEST_F(JobLimits, TemporaryFilesGoWhereTheJobWants) {
  EXPECT_EQ(jobTemporaryDirectory(), "");
  set("TMPDIR", "/one");
  EXPECT_EQ(jobTemporaryDirectory(), "/one");
  set("SLURM_TMPDIR", "/two");
  EXPECT_EQ(jobTemporaryDirectory(), "/two");
  set("SLURM_TMPDIR", "");
  EXPECT_EQ(jobTemporaryDirectory(), "/one");
}

}  // namespace
}  // namespace surfeit
