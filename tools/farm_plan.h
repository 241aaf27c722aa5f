// The jobs that `surfeit plan` prints: a gather in shards, for the schedulers of farms.
//
// A task is one shard of one frame; all tasks are one flat array. Every script has the same rules
// for the exit status of a task: 33 again with twice the memory; 74, 137 and 143 again; others not.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace surfeit {

struct FarmPlan {
  std::string scene, receivers, result;  // as given, patterns of frames included
  std::vector<std::string> options;      // of the gather, "--name=value"
  std::vector<int> frames;               // empty: no sequence
  int shards = 1;
  std::uint64_t memory_mib = 0;  // of a task, at first
  int threads = 1;
  std::uint64_t minutes = 0;  // limit of a task; 0: none

  std::size_t frameCount() const { return frames.empty() ? 1 : frames.size(); }
  std::size_t taskCount() const { return frameCount() * std::size_t(shards); }
};

// A bash script: `bash FILE` submits an array, and a job behind it that merges, and submits again
// what is missing.
std::string slurmScript(const FarmPlan& plan);
// A bash script that runs GNU parallel, then merges. Run again, it goes on where it ended.
std::string parallelScript(const FarmPlan& plan);
// A makefile with a target for each task and each merge.
std::string makefileOf(const FarmPlan& plan);
// An Open Job Description template, YAML, specification 2023-09.
std::string openJdTemplate(const FarmPlan& plan);

// What the scripts share. A word as bash takes it; safe in OpenJD's format strings, too.
std::string shellWord(std::string_view text);
// Lines of comment: what the job is, and the rules.
std::string planComment(const FarmPlan& plan);
// Variables of the job, and the functions `gather` and `merge`.
std::string planFunctions(const FarmPlan& plan);
// The function `runTask`, for schedulers that leave trying again to the task.
std::string_view runTaskFunction();

}  // namespace surfeit
