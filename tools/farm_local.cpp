// Jobs without a scheduler: GNU parallel, on one machine or by ssh on several, and make.
#include <fmt/format.h>

#include "tools/farm_plan.h"
#include "tools/frames.h"

namespace surfeit {
namespace {

constexpr std::string_view kParallelHow = R"(#
# bash FILE runs the tasks, as many at a time as JOBS says, and merges. Run again, it goes on with
# what has failed. PARALLEL='--sshloginfile HOSTS' runs them on other machines that share these files;
# a task that failed is then tried on another machine (man parallel). Logs are in RESULT.farm.
)";

constexpr std::string_view kParallelScript = R"script(
farm=$result.farm
script=$(realpath "${BASH_SOURCE[0]:-}" 2> /dev/null)
if [[ ! -f $script ]]; then
  echo "save the plan to a file, and run it by bash FILE" >&2
  exit 2
fi

if [[ ${1:-} == task ]]; then
  # What would end the same way is not tried again, though parallel asks for it
  stop=$farm/task-$2.stop
  if [[ -e $stop ]]; then exit "$(< "$stop")"; fi
  status=0
  runTask "$2" 1 || status=$?
  case $status in 0 | 33 | 74 | 137 | 143) ;; *) echo "$status" > "$stop" ;; esac
  exit "$status"
fi

# As many tasks as processors and memory allow
free=$(awk '/^MemAvailable:/ { print int($2 / 1024) }' /proc/meminfo)
most=$((free / memory < $(nproc) / threads ? free / memory : $(nproc) / threads))
jobs=${JOBS:-$((most > 0 ? most : 1))}
mkdir -p "$farm" || exit
rm -f "$farm"/task-*.stop

# The second round is for shards that are gone although their tasks were done
for _ in 1 2; do
  seq "$tasks" | parallel --quote --joblog "$farm/joblog-$shards" --resume-failed --retries 3 \
    --jobs "$jobs" --workdir "$PWD" bash "$script" task {}
  status=0
  for index in "${!frames[@]}"; do
    merged=0
    merge "$index" "$memory" || merged=$?
    if ((merged != 0 && status != 75)); then status=$merged; fi
  done
  if ((status != 75)); then break; fi
  rm -f "$farm/joblog-$shards"
done
exit "$status"
)script";

constexpr std::string_view kMakeHow = R"(#
# make -k -j JOBS -f FILE runs JOBS tasks at a time and merges the frames that are complete; run again,
# it goes on with what has failed. `make -f FILE task-3` is one task.
)";

constexpr std::string_view kMakeScript = R"script(
case $1 in
  task) runTask "$2" 3 ;;
  merge) merge "$2" "$memory" ;;
esac
)script";

}  // namespace

std::string parallelScript(const FarmPlan& plan) {
  return "#!/bin/bash\n" + planComment(plan) + std::string(kParallelHow) + planFunctions(plan) +
         std::string(runTaskFunction()) + std::string(kParallelScript);
}

std::string makefileOf(const FarmPlan& plan) {
  std::string script;
  for (const char c :
       planFunctions(plan) + std::string(runTaskFunction()) + std::string(kMakeScript)) {
    script += c;
    if (c == '$') script += '$';
  }
  std::string merges;
  for (std::size_t i = 0; i < plan.frameCount(); ++i) {
    const std::string name =
        plan.frames.empty() ? "merge" : fmt::format("merge-{}", plan.frames[i]);
    merges += fmt::format(
        "all: {0}\n.PHONY: {0}\n{0}: $(addprefix task-,$(shell seq {1} {2}))\n"
        "\t@bash -c \"$$surfeit_plan\" surfeit-plan merge {3}\n",
        name, i * std::size_t(plan.shards) + 1, (i + 1) * std::size_t(plan.shards), i);
  }
  return planComment(plan) + std::string(kMakeHow) + "define surfeit_plan\n" + script +
         "endef\nexport surfeit_plan\n\n.PHONY: all\nall:\n\n" +
         fmt::format("tasks := $(addprefix task-,$(shell seq {}))\n", plan.taskCount()) +
         ".PHONY: $(tasks)\n$(tasks): task-%:\n"
         "\t@bash -c \"$$surfeit_plan\" surfeit-plan task $*\n\n" +
         merges;
}

}  // namespace surfeit
