#include "tools/farm_plan.h"

#include <fmt/format.h>

#include "surfeit/version.h"
#include "tools/frames.h"

namespace surfeit {
namespace {

constexpr std::string_view kGatherFunctions = R"(
# task PASS TASK MEMORY: one shard. Tasks count the shards of the first frame, then of the second.
task() {
  local frame=${frames[($2 - 1) / shards]}
  "$surfeit" gather "$scene" "$receivers" -o "$result" ${options[@]+"${options[@]}"} \
    --threads="$threads" --memory="$3M" --shard="$((($2 - 1) % shards + 1))/$shards" \
    ${frame:+"--frames=$frame"}
}

# merge INDEX MEMORY: the shards of the frame at that place of `frames`; they say how they were made.
merge() {
  local frame=${frames[$1]}
  "$surfeit" merge "$scene" "$receivers" -o "$result" \
    --threads="$threads" --memory="$2M" --shards="$shards" ${frame:+"--frames=$frame"}
}
)";

constexpr std::string_view kIndexFunctions = R"(
# task PASS TASK MEMORY: one shard of a pass. Tasks count the shards of the first frame, then of the
# second.
task() {
  local frame=${frames[($2 - 1) / shards]}
  "$surfeit" index ${clouds[@]+"${clouds[@]}"} -o "$result" ${options[@]+"${options[@]}"} \
    --threads="$threads" --memory="$3M" --pass="$1" --shard="$((($2 - 1) % shards + 1))/$shards" \
    ${frame:+"--frames=$frame"}
}

# merge INDEX MEMORY: the shards of the frame at that place of `frames`.
merge() {
  local frame=${frames[$1]}
  "$surfeit" index ${clouds[@]+"${clouds[@]}"} -o "$result" ${options[@]+"${options[@]}"} \
    --threads="$threads" --memory="$2M" --pass=merge --shards="$shards" ${remove:+--remove-shards} \
    ${frame:+"--frames=$frame"}
}
)";

constexpr std::string_view kTasksOf = R"(
# tasksOf PASS: the numbers of its tasks. The pass `places` has one for each frame.
tasksOf() {
  local step=1
  [[ $1 != places ]] || step=$shards
  seq 1 "$step" "$tasks"
}
)";

constexpr std::string_view kRunTask = R"(
# runTask PASS TASK TRIES: a shard, by the rules above; TRIES limits 74, 137 and 143.
runTask() {
  local memory=$memory most status tries=0
  most=$(awk '/^MemTotal:/ { print int($2 / 1024) }' /proc/meminfo)
  while :; do
    status=0
    task "$1" "$2" "$memory" || status=$?
    case $status in
      33)
        ((2 * memory <= most)) || return 33
        memory=$((2 * memory))
        ;;
      74 | 137 | 143)
        tries=$((tries + 1))
        ((tries < $3)) || return "$status"
        sleep "${PAUSE:-5}"
        ;;
      *) return "$status" ;;
    esac
    echo "$1 $2: exit status $status, again with $memory MiB" >&2
  done
}
)";

}  // namespace

std::string shellWord(std::string_view text) {
  constexpr std::string_view kSafe =
      "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_./:,=@%+-";
  if (!text.empty() && text.find_first_not_of(kSafe) == text.npos) return std::string(text);
  std::string word = "'";
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '\'') {
      word += "'\\''";
      continue;
    }
    // {{ begins a value in format strings of OpenJD; quotes between them are nothing to bash
    if (text[i] == '{' && word.back() == '{') word += "''";
    word += text[i];
  }
  return word + "'";
}

std::string planComment(const FarmPlan& plan) {
  const std::string frames =
      plan.frames.empty() ? "" : fmt::format(" for each of {} frames", plan.frames.size());
  const std::string passes =
      !plan.is_index ? "" : fmt::format("{} passes of ", plan.passes().size());
  return fmt::format(
      "# {} in {} shards{}: {}{} tasks of {} MiB and {} threads (surfeit {}, docs/farm.md).\n"
      "# Exit statuses of a task: 0 done, also where its shard was finished before; 33 too little\n"
      "# memory: again with twice as much; 74, 137 and 143 (files, killed, told to stop): again; "
      "any\n"
      "# other, such as 2 and 3 (command line, data): not again, it would end the same way.\n{}",
      plan.is_index ? "An index" : "A gather", plan.shards, frames, passes, plan.taskCount(),
      plan.memory_mib, plan.threads, kVersion,
      (plan.is_index ? "# 75: the pass before is not complete; again behind it.\n" : "") +
          std::string(plan.has_neighbours
                          ? "# The pass `places` has one task for each frame, and no other.\n"
                          : ""));
}

std::string planFunctions(const FarmPlan& plan) {
  const auto joined = [](const std::vector<std::string>& words) {
    std::string text;
    for (const std::string& word : words) text += (text.empty() ? "" : " ") + shellWord(word);
    return text;
  };
  std::string frames;
  for (const int frame : plan.frames)
    frames += fmt::format("{}{}", frames.empty() ? "" : " ", frame);
  const std::string inputs =
      plan.is_index ? fmt::format("clouds=({})\n", joined(plan.inputs))
                    : fmt::format("scene={}\nreceivers={}\n", shellWord(plan.inputs[0]),
                                  shellWord(plan.inputs[1]));
  return fmt::format(
             "set -u\n"
             "surfeit=${{SURFEIT:-surfeit}}\n"
             "{}"
             "result={}\n"
             "options=({})\n"
             "threads={}\n"
             "memory={} # MiB\n"
             "shards={}\n"
             "frames=({})\n"
             "tasks={} # of each pass\n"
             "passes=({})\n{}",
             inputs, shellWord(plan.result), joined(plan.options), plan.threads, plan.memory_mib,
             plan.shards, plan.frames.empty() ? "''" : frames, plan.taskCount(),
             joined(plan.passes()),
             !plan.is_index        ? ""
             : plan.removes_shards ? "remove=yes\n"
                                   : "remove=\n") +
         std::string(plan.is_index ? kIndexFunctions : kGatherFunctions);
}

std::string_view tasksFunction() { return kTasksOf; }

std::string_view runTaskFunction() { return kRunTask; }

}  // namespace surfeit
