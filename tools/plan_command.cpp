// surfeit plan: a gather in shards, as the job of a farm.
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "surfeit/tune.h"
#include "tools/command.h"
#include "tools/console.h"
#include "tools/farm_plan.h"
#include "tools/gather_options.h"
#include "tools/light_options.h"
#include "tools/sequence.h"

namespace surfeit {
namespace {

constexpr std::size_t kMostTasks = 1'000'000;

struct PlanArguments {
  FarmPlan plan;
  bool is_slurm = false, is_parallel = false, is_make = false, is_openjd = false;
  GatherOptions options;
};

// Options that are the plan's own; all others are the gather's.
constexpr const char* kOwnOptions[] = {"output",   "shards", "frames",   "time", "memory",
                                       "threads",  "slurm",  "parallel", "make", "openjd",
                                       "progress", "quiet",  "verbose"};

bool isOwn(const CLI::Option& option) {
  return std::any_of(std::begin(kOwnOptions), std::end(kOwnOptions),
                     [&](const char* name) { return option.check_lname(name); });
}

// The words of a parsed command line that are options of the gather, "--name=value" each.
std::vector<std::string> gatherWords(const CLI::App& command,
                                     const std::vector<std::string>& words) {
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

// Fills in memory and time by a sample of the receivers, of the first frame.
Status forecast(PlanArguments& arguments, CommandContext& context) {
  FarmPlan& plan = arguments.plan;
  const bool needs_time = plan.minutes == 0 && (arguments.is_slurm || arguments.is_openjd);
  if (plan.memory_mib > 0 && !needs_time) return {};
  GatherOptions options = arguments.options;
  options.threads = plan.threads;
  options.memory_bytes = context.common.memory_bytes;
  const auto nameOf = [&plan](const std::string& name) {
    return plan.frames.empty() ? name : frameName(name, plan.frames.front());
  };
  options.environment.path = nameOf(options.environment.path);
  SURFEIT_ASSIGN_OR_RETURN(
      const GatherForecast forecast,
      forecastGather(nameOf(plan.scene), nameOf(plan.receivers), options, context.progress()));
  if (plan.memory_mib == 0) plan.memory_mib = mebibytes(forecast.recommended_memory_bytes);
  // Twice the part of a shard, and five minutes for what all shards do
  const double seconds = 2 * forecast.seconds / plan.shards;
  if (plan.minutes == 0) plan.minutes = static_cast<std::uint64_t>(std::ceil(seconds / 60)) + 5;
  context.say(fmt::format(
      "plan: {} receivers, by a sample of {}: {} MiB, {:.0f} s for all shards of a frame with {} "
      "threads; limit of a task {} min",
      formatCount(forecast.receivers), formatCount(forecast.sampled_receivers), plan.memory_mib,
      forecast.seconds, plan.threads, plan.minutes));
  return {};
}

Status checkPlan(const PlanArguments& arguments) {
  const FarmPlan& plan = arguments.plan;
  const int kinds =
      arguments.is_slurm + arguments.is_parallel + arguments.is_make + arguments.is_openjd;
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
  texts.insert(texts.end(), {plan.scene, plan.receivers, plan.result});
  for (const std::string& text : texts) {
    if (printable(text) == text && text.find('\n') == text.npos) continue;
    return Status::invalidArgument(fmt::format(
        "{}: a job can hold no control characters and no bytes that are not UTF-8", text));
  }
  return {};
}

Status runPlan(PlanArguments& arguments, const CLI::App& command, CommandContext& context) {
  FarmPlan& plan = arguments.plan;
  plan.frames = context.sequence.frames;
  plan.threads = context.threads();
  plan.memory_mib = mebibytes(context.common.memory_bytes);
  plan.options = gatherWords(command, context.words);
  SURFEIT_RETURN_IF_ERROR(checkFrameNames(command, plan.frames));
  SURFEIT_RETURN_IF_ERROR(checkPlan(arguments));
  SURFEIT_RETURN_IF_ERROR(forecast(arguments, context));
  context.answer(arguments.is_slurm      ? slurmScript(plan)
                 : arguments.is_parallel ? parallelScript(plan)
                 : arguments.is_make     ? makefileOf(plan)
                                         : openJdTemplate(plan));
  return {};
}

void addKinds(CLI::App& command, PlanArguments& arguments) {
  constexpr const char* kGroup = "Kinds of jobs, one of";
  command
      .add_flag("--slurm", arguments.is_slurm,
                "Bash script that submits a Slurm job array, and a merge behind it")
      ->group(kGroup);
  command.add_flag("--parallel", arguments.is_parallel, "Bash script that runs GNU parallel")
      ->group(kGroup);
  command.add_flag("--make", arguments.is_make, "Makefile with a target for each task")
      ->group(kGroup);
  command
      .add_flag("--openjd", arguments.is_openjd,
                "Open Job Description template (YAML, specification 2023-09)")
      ->group(kGroup);
}

}  // namespace

void addPlanCommand(CLI::App& app, CommandContext& context) {
  CLI::App* command = app.add_subcommand("plan", "Print a gather in shards as the job of a farm");
  const auto arguments = std::make_shared<PlanArguments>();
  FarmPlan& plan = arguments->plan;
  command->add_option("SCENE", plan.scene, "Scene file (.sft)")->required();
  command->add_option("RECEIVERS", plan.receivers, "Receivers, as for gather")->required();
  command->add_option("-o,--output", plan.result, "Result of the gather")
      ->required()
      ->type_name("CLOUD");
  command->add_option("--shards", plan.shards, "Shards of each frame")
      ->required()
      ->check(CLI::Range(1, 100'000));
  addFramesOption(*command, context.sequence);
  addKinds(*command, *arguments);
  command
      ->add_option_function<std::string>(
          "--time", [&plan](const std::string& text) { plan.minutes = parseMinutes(text); },
          "Limit of a task, for --slurm and --openjd: 90s, 30m, 2h (default: by a sample)")
      ->type_name("TIME");
  addGatherOptions(*command, arguments->options);
  addLightOptions(*command, arguments->options);
  addSubsetOption(*command, arguments->options.groups, plan.scene);
  context.addCommonOptions(*command, {.stats = false});
  command->footer(
      "Memory and time of a task are found from a sample, as by tune, or given: --memory is the\n"
      "budget of a task, --threads its threads. All other options are those of gather. A task "
      "that\n"
      "fails is tried again by its exit status; docs/farm.md has the rules.\n"
      "Examples:\n"
      "  surfeit plan city.sft street.ply -o lit.ply --shards 16 --mode bleeding --slurm > job.sh\n"
      "  bash job.sh\n"
      "  surfeit plan set.sft street.####.ply -o lit.####.ply --frames 1-240 --shards 4 \\\n"
      "      --memory 4G --time 30m --threads 8 --openjd > job.yaml\n"
      "  surfeit plan city.sft street.ply -o lit.ply --shards 64 --parallel > job.sh\n"
      "  surfeit plan city.sft street.ply -o lit.ply --shards 64 --make > job.mk\n"
      "  make -k -j 8 -f job.mk");
  command->callback([arguments, command, &context] {
    context.run([&] { return runPlan(*arguments, *command, context); });
  });
}

}  // namespace surfeit
