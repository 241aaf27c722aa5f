// The jobs that `surfeit plan` prints: a gather or an index in shards, for the schedulers of farms.
//
// A task is one shard of one frame in one pass; the tasks of a pass are one flat array. A gather is
// one pass, an index three, and five where sizes or normals follow from neighbours, each behind the
// one before. Every script has the same rules for the
// exit status of a task: 33 again with twice the memory; 74, 137 and 143 again; others not.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace surfeit {

struct FarmPlan {
  bool is_index = false;
  // As given, patterns of frames included
  std::vector<std::string> inputs;  // scene and receivers of a gather, clouds of an index
  std::string result;
  std::vector<std::string> options;  // of the command, "--name=value"
  bool removes_shards = false;       // when an index is complete
  bool has_neighbours = false;       // an index takes sizes or normals from these
  std::vector<int> frames;           // empty: no sequence
  int shards = 1;
  std::uint64_t memory_mib = 0;  // of a task, at first
  int threads = 1;
  std::uint64_t minutes = 0, merge_minutes = 0;  // limits of a task and of the merge; 0: none

  std::size_t frameCount() const { return frames.empty() ? 1 : frames.size(); }
  // Of each pass.
  std::size_t taskCount() const { return frameCount() * std::size_t(shards); }
  std::vector<std::string> passes() const {
    if (!is_index) return {"gather"};
    if (!has_neighbours) return {"count", "distribute", "build"};
    return {"count", "distribute", "build", "places", "sizes"};
  }
  // A pass of one task for each frame, that of its first shard; it takes as long as a merge.
  static bool isSingle(std::string_view pass) { return pass == "places"; }
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
// Variables of the job, and the functions `task` and `merge`.
std::string planFunctions(const FarmPlan& plan);
// The function `tasksOf`, for scripts that count tasks.
std::string_view tasksFunction();
// The function `runTask`, for schedulers that leave trying again to the task.
std::string_view runTaskFunction();

}  // namespace surfeit
