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
  stop=$farm/$2-$3.stop
  if [[ -e $stop ]]; then exit "$(< "$stop")"; fi
  status=0
  runTask "$2" "$3" 1 || status=$?
  case $status in 0 | 33 | 74 | 137 | 143) ;; *) echo "$status" > "$stop" ;; esac
  exit "$status"
fi

# As many tasks as processors and memory allow
free=$(awk '/^MemAvailable:/ { print int($2 / 1024) }' /proc/meminfo)
most=$((free / memory < $(nproc) / threads ? free / memory : $(nproc) / threads))
jobs=${JOBS:-$((most > 0 ? most : 1))}
mkdir -p "$farm" || exit
rm -f "$farm"/*.stop

# Further rounds are for shards that are gone although their tasks were done, and for what waited for
# them
for _ in 1 2 3; do
  for pass in "${passes[@]}"; do
    tasksOf "$pass" | parallel --quote --joblog "$farm/joblog-$pass-$shards" --resume-failed \
      --retries 3 --jobs "$jobs" --workdir "$PWD" bash "$script" task "$pass" {}
  done
  status=0
  for index in "${!frames[@]}"; do
    merged=0
    merge "$index" "$memory" || merged=$?
    if ((merged != 0 && status != 75)); then status=$merged; fi
  done
  if ((status != 75)); then break; fi
  rm -f "$farm"/joblog-*-"$shards"
  for stop in "$farm"/*.stop; do
    if [[ -e $stop && $(< "$stop") == 75 ]]; then rm -f "$stop"; fi
  done
done
exit "$status"
)script";

constexpr std::string_view kMakeHow = R"(#
# make -k -j JOBS -f FILE runs JOBS tasks at a time and merges the frames that are complete; run again,
# it goes on with what has failed. )";

constexpr std::string_view kMakeScript = R"script(
case $1 in
  merge) merge "$2" "$memory" ;;
  *) runTask "$1" "$2" 3 ;;
esac
)script";

// Targets of the tasks of a frame, from 0 on, in a pass.
std::string frameTasks(const FarmPlan& plan, const std::string& pass, std::size_t frame) {
  if (FarmPlan::isSingle(pass)) {
    return fmt::format("{}-{}", pass, frame * std::size_t(plan.shards) + 1);
  }
  return fmt::format("$(addprefix {}-,$(shell seq {} {}))", pass,
                     frame * std::size_t(plan.shards) + 1, (frame + 1) * std::size_t(plan.shards));
}

// The tasks of a frame wait for those of the pass before, and the merge for all.
std::string frameRules(const FarmPlan& plan, std::size_t frame) {
  const std::string suffix = plan.frames.empty() ? "" : fmt::format("-{}", plan.frames[frame]);
  std::string text, before;
  for (const std::string& pass : plan.passes()) {
    const std::string tasks = frameTasks(plan, pass, frame);
    if (!before.empty()) {
      text += fmt::format(".PHONY: {0}\n{0}: {1}\n", "all-" + before + suffix,
                          frameTasks(plan, before, frame));
      text += fmt::format("{}: {}\n", tasks, "all-" + before + suffix);
    }
    before = pass;
  }
  return text + fmt::format(
                    "all: {0}\n.PHONY: {0}\n{0}: {1}\n"
                    "\t@bash -c \"$$surfeit_plan\" surfeit-plan merge {2}\n",
                    "merge" + suffix, frameTasks(plan, before, frame), frame);
}

}  // namespace

std::string parallelScript(const FarmPlan& plan) {
  return "#!/bin/bash\n" + planComment(plan) + std::string(kParallelHow) + planFunctions(plan) +
         std::string(tasksFunction()) + std::string(runTaskFunction()) +
         std::string(kParallelScript);
}

std::string makefileOf(const FarmPlan& plan) {
  std::string script;
  for (const char c :
       planFunctions(plan) + std::string(runTaskFunction()) + std::string(kMakeScript)) {
    script += c;
    if (c == '$') script += '$';
  }
  std::string tasks, frames;
  for (const std::string& pass : plan.passes()) {
    tasks += fmt::format(
        "{0}_tasks := $(addprefix {0}-,$(shell seq 1 {2} {1}))\n"
        ".PHONY: $({0}_tasks)\n$({0}_tasks): {0}-%:\n"
        "\t@bash -c \"$$surfeit_plan\" surfeit-plan {0} $*\n\n",
        pass, plan.taskCount(), FarmPlan::isSingle(pass) ? plan.shards : 1);
  }
  for (std::size_t i = 0; i < plan.frameCount(); ++i) frames += frameRules(plan, i);
  return planComment(plan) + std::string(kMakeHow) +
         fmt::format("`make -f FILE {}-3` is one task.\n", plan.passes().front()) +
         "define surfeit_plan\n" + script + "endef\nexport surfeit_plan\n\n.PHONY: all\nall:\n\n" +
         tasks + frames;
}

}  // namespace surfeit
