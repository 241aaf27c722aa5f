#include "tools/plan_options.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <iterator>
#include <string>
#include <vector>

#include "surfeit/shards.h"
#include "tools/console.h"
#include "tools/frames.h"
#include "tools/sequence.h"

namespace surfeit {
namespace {

constexpr std::size_t kMostTasks = 1'000'000;

// Options that are the plan's own; all others are those of the gather or the index.
constexpr const char* kOwnOptions[] = {
    "output",   "shards", "frames", "time",     "memory", "threads", "index",         "slurm",
    "parallel", "make",   "openjd", "progress", "quiet",  "verbose", "remove-shards", "neighbours"};

bool isOwn(const CLI::Option& option) {
  return std::any_of(std::begin(kOwnOptions), std::end(kOwnOptions),
                     [&](const char* name) { return option.check_lname(name); });
}

// The words of a parsed command line that are options of the job's command, "--name=value" each.
std::vector<std::string> jobWords(const CLI::App& command, const std::vector<std::string>& words) {
  std::vector<std::string> kept;
  for (std::size_t i = 1; i < words.size() && words[i] != "--"; ++i) {
    const std::string name = words[i].substr(0, words[i].find('='));
    const CLI::Option* const option =
        name.starts_with('-') ? command.get_option_no_throw(name) : nullptr;
    if (option == nullptr) continue;
    std::string word = words[i];
    const bool has_value = option->get_items_expected_max() > 0;
    if (has_value && word == name && i + 1 < words.size()) word += "=" + words[++i];
    if (!isOwn(*option)) kept.push_back(word);
  }
  return kept;
}

// "90s", "30m", "2h", "1d", "1:30:00", "1:30" (hours and minutes) or "30", minutes; in minutes.
std::uint64_t parseMinutes(const std::string& text) {
  const char* at = text.data();
  const char* const end = at + text.size();
  double numbers[3] = {0, 0, 0};
  std::size_t count = 0;
  bool ok = true;
  while (ok && count < 3) {
    const auto [number_end, error] = std::from_chars(at, end, numbers[count]);
    ok = error == std::errc() && numbers[count] >= 0 && std::isfinite(numbers[count]);
    at = number_end;
    ++count;
    if (at == end || *at != ':') break;
    ++at;
  }
  const std::string unit(at, end);
  double minutes = numbers[0];
  if (count > 1) minutes = 60 * numbers[0] + numbers[1] + numbers[2] / 60;
  if (unit == "s") minutes /= 60;
  if (unit == "h") minutes *= 60;
  if (unit == "d") minutes *= 24 * 60;
  const bool is_unit =
      unit.empty() || (count == 1 && std::string("smhd").find(unit) != std::string::npos);
  if (!ok || !is_unit || unit.size() > 1 || !(minutes > 0) || minutes > 1e6) {
    throw CLI::ValidationError(
        "--time",
        fmt::format("found \"{}\", expected a time such as 90s, 30m, 2h, 1d or 1:30:00", text));
  }
  return static_cast<std::uint64_t>(std::ceil(minutes));
}

std::uint64_t mebibytes(std::uint64_t bytes) { return (bytes + (1 << 20) - 1) >> 20; }

std::uint64_t limitOf(double seconds) {
  return static_cast<std::uint64_t>(std::ceil(2 * seconds / 60)) + 5;
}

Status checkPlan(const PlanOptions& options) {
  const FarmPlan& plan = options.plan;
  const int kinds = options.is_slurm + options.is_parallel + options.is_make + options.is_openjd;
  if (kinds != 1) {
    return Status::invalidArgument(
        fmt::format("found {} kinds of jobs, expected one of --slurm, --parallel, --make and "
                    "--openjd",
                    kinds));
  }
  if (plan.result == "-" || plan.result.starts_with("-.")) {
    return Status::invalidArgument(
        fmt::format("{}: shards lie beside the result, so it must be a file", plan.result));
  }
  if (plan.taskCount() > kMostTasks) {
    return Status::invalidArgument(
        fmt::format("found {} tasks, expected at most {}: plan some of the frames at a time",
                    plan.taskCount(), kMostTasks));
  }
  std::vector<std::string> texts = plan.options;
  texts.insert(texts.end(), plan.inputs.begin(), plan.inputs.end());
  texts.push_back(plan.result);
  for (const std::string& text : texts) {
    if (printable(text) == text && text.find('\n') == text.npos) continue;
    return Status::invalidArgument(fmt::format(
        "{}: a job can hold no control characters and no bytes that are not UTF-8", text));
  }
  return {};
}

void addKinds(CLI::App& command, PlanOptions& options) {
  constexpr const char* kGroup = "Kinds of jobs, one of";
  command
      .add_flag("--slurm", options.is_slurm,
                "Bash script that submits a Slurm job array, and a merge behind it")
      ->group(kGroup);
  command.add_flag("--parallel", options.is_parallel, "Bash script that runs GNU parallel")
      ->group(kGroup);
  command.add_flag("--make", options.is_make, "Makefile with a target for each task")
      ->group(kGroup);
  command
      .add_flag("--openjd", options.is_openjd,
                "Open Job Description template (YAML, specification 2023-09)")
      ->group(kGroup);
}

}  // namespace

void addPlanOptions(CLI::App& command, PlanOptions& options, CommandContext& context) {
  FarmPlan& plan = options.plan;
  command.add_flag("--index", options.is_index,
                   "An index of clouds instead of a gather: see `surfeit plan --index --help`");
  command.add_option("--shards", plan.shards, "Shards of each frame")
      ->required()
      ->check(CLI::Range(1, plan.is_index ? kMostShards : 100'000));
  addFramesOption(command, context.sequence);
  addKinds(command, options);
  command
      .add_option_function<std::string>(
          "--time",
          [&plan](const std::string& text) {
            plan.minutes = plan.merge_minutes = parseMinutes(text);
          },
          "Limit of a task, for --slurm and --openjd: 90s, 30m, 2h (default: by a sample)")
      ->type_name("TIME");
}

Status beginPlan(PlanOptions& options, const CLI::App& command, const CommandContext& context) {
  FarmPlan& plan = options.plan;
  plan.frames = context.sequence.frames;
  plan.threads = context.threads();
  plan.memory_mib = mebibytes(context.common.memory_bytes);
  plan.options = jobWords(command, context.words);
  SURFEIT_RETURN_IF_ERROR(checkFrameNames(command, plan.frames));
  return checkPlan(options);
}

bool needsForecast(const PlanOptions& options) {
  const FarmPlan& plan = options.plan;
  return plan.memory_mib == 0 || (plan.minutes == 0 && (options.is_slurm || options.is_openjd));
}

void takeForecast(std::uint64_t memory_bytes, double task_seconds, double merge_seconds,
                  FarmPlan& plan) {
  if (plan.memory_mib == 0) plan.memory_mib = mebibytes(memory_bytes);
  if (plan.minutes > 0) return;
  plan.minutes = limitOf(task_seconds);
  plan.merge_minutes = limitOf(merge_seconds);
}

std::string firstName(const FarmPlan& plan, const std::string& name) {
  return plan.frames.empty() ? name : frameName(name, plan.frames.front());
}

std::string jobText(const PlanOptions& options) {
  return options.is_slurm      ? slurmScript(options.plan)
         : options.is_parallel ? parallelScript(options.plan)
         : options.is_make     ? makefileOf(options.plan)
                               : openJdTemplate(options.plan);
}

}  // namespace surfeit
