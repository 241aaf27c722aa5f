// surfeit plan: a gather or an index in shards, as the job of a farm.
#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <string>

#include "surfeit/tune.h"
#include "tools/command.h"
#include "tools/farm_plan.h"
#include "tools/gather_options.h"
#include "tools/light_options.h"
#include "tools/plan_options.h"

namespace surfeit {
namespace {

struct GatherPlanArguments : PlanOptions {
  std::string scene, receivers;
  GatherOptions options;
};

// Fills in memory and time by a sample of the receivers, of the first frame.
Status forecastPlan(GatherPlanArguments& arguments, CommandContext& context) {
  FarmPlan& plan = arguments.plan;
  GatherOptions options = arguments.options;
  options.threads = plan.threads;
  options.memory_bytes = context.common.memory_bytes;
  options.environment.path = firstName(plan, options.environment.path);
  SURFEIT_ASSIGN_OR_RETURN(
      const GatherForecast forecast,
      forecastGather(firstName(plan, arguments.scene), firstName(plan, arguments.receivers),
                     options, context.progress()));
  const double seconds = forecast.seconds / plan.shards;
  takeForecast(forecast.recommended_memory_bytes, seconds, seconds, plan);
  context.say(fmt::format(
      "plan: {} receivers, by a sample of {}: {} MiB, {:.0f} s for all shards of a frame with {} "
      "threads; limit of a task {} min",
      formatCount(forecast.receivers), formatCount(forecast.sampled_receivers), plan.memory_mib,
      forecast.seconds, plan.threads, plan.minutes));
  return {};
}

Status runGatherPlan(GatherPlanArguments& arguments, const CLI::App& command,
                     CommandContext& context) {
  arguments.plan.inputs = {arguments.scene, arguments.receivers};
  SURFEIT_RETURN_IF_ERROR(beginPlan(arguments, command, context));
  if (needsForecast(arguments)) SURFEIT_RETURN_IF_ERROR(forecastPlan(arguments, context));
  context.answer(jobText(arguments));
  return {};
}

void addGatherPlan(CLI::App& command, CommandContext& context) {
  const auto arguments = std::make_shared<GatherPlanArguments>();
  command.add_option("SCENE", arguments->scene, "Scene file (.sft)")->required();
  command.add_option("RECEIVERS", arguments->receivers, "Receivers, as for gather")->required();
  command.add_option("-o,--output", arguments->plan.result, "Result of the gather")
      ->required()
      ->type_name("CLOUD");
  addPlanOptions(command, *arguments, context);
  addGatherOptions(command, arguments->options);
  addStageOptions(command, arguments->options);
  addLightOptions(command, arguments->options);
  addSubsetOption(command, arguments->options.groups, arguments->scene);
  addGainOption(command, arguments->options.gains, arguments->scene);
  context.addCommonOptions(command, {.stats = false});
  command.footer(
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
      "  make -k -j 8 -f job.mk\n"
      "  surfeit plan --index tile1.ply tile2.ply -o city.sft --shards 16 --slurm > index.sh");
  command.callback([arguments, &command, &context] {
    context.run([&] { return runGatherPlan(*arguments, command, context); });
  });
}

}  // namespace

void addPlanCommand(CLI::App& app, CommandContext& context) {
  CLI::App* const command =
      app.add_subcommand("plan", "Print a gather or an index in shards as the job of a farm");
  // Both have arguments and options of their own
  const std::vector<std::string>& words = context.words;
  const auto end = std::find(words.begin(), words.end(), "--");
  if (std::find(words.begin(), end, "--index") != end) {
    addIndexPlan(*command, context);
  } else {
    addGatherPlan(*command, context);
  }
}

}  // namespace surfeit
