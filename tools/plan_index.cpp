// surfeit plan --index: an index in shards, as the job of a farm.
#include <fmt/format.h>

#include <memory>
#include <string>
#include <vector>

#include "surfeit/index_shards.h"
#include "tools/command.h"
#include "tools/farm_plan.h"
#include "tools/index_options.h"
#include "tools/plan_options.h"

namespace surfeit {
namespace {

struct IndexPlanArguments : PlanOptions {
  IndexSettings settings;
};

// Fills in memory and time by a sample of the surfels, of the first frame.
Status forecastIndexPlan(IndexPlanArguments& arguments, CommandContext& context) {
  FarmPlan& plan = arguments.plan;
  IndexSettings& settings = arguments.settings;
  settings.cube_like = firstName(plan, settings.cube_like);
  SURFEIT_RETURN_IF_ERROR(completeIndexOptions(settings, context.common));
  settings.options.threads = plan.threads;
  std::vector<std::string> clouds;
  for (const std::string& cloud : plan.inputs) clouds.push_back(firstName(plan, cloud));
  SURFEIT_ASSIGN_OR_RETURN(const IndexShardForecast forecast,
                           forecastIndexShards(clouds, firstName(plan, plan.result),
                                               settings.options, plan.shards, context.progress()));
  plan.has_neighbours = plan.has_neighbours || forecast.may_need_neighbours;
  takeForecast(forecast.memory_bytes, forecast.task_seconds, forecast.merge_seconds, plan);
  context.say(fmt::format(
      "plan: {} surfels in {}, by a sample of {}: {} MiB, about {:.0f} s for a task and {:.0f} s "
      "for the merge; limits {} and {} min\n"
      "files: {} of shards beside {} of the scene, of each frame",
      formatCount(forecast.records), formatBytes(forecast.input_bytes),
      formatCount(forecast.sampled_surfels), plan.memory_mib, forecast.task_seconds,
      forecast.merge_seconds, plan.minutes, plan.merge_minutes, formatBytes(forecast.shard_bytes),
      formatBytes(forecast.scene_bytes)));
  return {};
}

Status checkIndexPlan(const IndexPlanArguments& arguments) {
  const IndexSettings& settings = arguments.settings;
  if (!settings.inputs.empty() || !settings.options.named.empty()) return {};
  return Status::invalidArgument("plan --index: no input cloud");
}

// Without a forecast: by the channels of the first frame, where its clouds are there already.
Status lookForSizes(IndexPlanArguments& arguments, CommandContext& context) {
  FarmPlan& plan = arguments.plan;
  if (plan.has_neighbours) return {};
  IndexOptions options = arguments.settings.options;
  for (NamedInput& named : options.named) named.path = firstName(plan, named.path);
  std::vector<std::string> clouds;
  for (const std::string& cloud : plan.inputs) clouds.push_back(firstName(plan, cloud));
  const Result<bool> needs = mayNeedNeighbours(clouds, options);
  if (needs.ok()) {
    plan.has_neighbours = *needs;
  } else if (needs.status().code() == StatusCode::kIoError) {
    context.say(fmt::format("{}: planned as if every surfel had a size (--neighbours)",
                            needs.status().message()));
  } else {
    return needs.status();
  }
  return {};
}

Status runIndexPlan(IndexPlanArguments& arguments, const CLI::App& command,
                    CommandContext& context) {
  arguments.plan.inputs = arguments.settings.inputs;
  arguments.plan.result = arguments.settings.output;
  SURFEIT_RETURN_IF_ERROR(checkIndexPlan(arguments));
  SURFEIT_RETURN_IF_ERROR(beginPlan(arguments, command, context));
  arguments.plan.has_neighbours |= arguments.settings.normals != "none";
  SURFEIT_RETURN_IF_ERROR(needsForecast(arguments) ? forecastIndexPlan(arguments, context)
                                                   : lookForSizes(arguments, context));
  context.answer(jobText(arguments));
  return {};
}

}  // namespace

void addIndexPlan(CLI::App& command, CommandContext& context) {
  const auto arguments = std::make_shared<IndexPlanArguments>();
  arguments->plan.is_index = true;
  addIndexOptions(command, arguments->settings);
  addPlanOptions(command, *arguments, context);
  command.add_flag("--remove-shards", arguments->plan.removes_shards,
                   "The merge removes the files of the shards when the scene is complete");
  command.add_flag("--neighbours", arguments->plan.has_neighbours,
                   "The job has the passes for sizes from neighbours (default: as options and "
                   "clouds say, which may not be there yet)");
  context.addCommonOptions(command, {.stats = false});
  command.footer(
      "The job counts, distributes, builds and merges (docs/farm.md, \"An index in shards\"); "
      "each\n"
      "pass waits for the one before. Memory and time of a task follow from the number of "
      "surfels,\n"
      "the bytes of the clouds and an index of a sample, or are given: --memory is the budget of "
      "a\n"
      "task, --threads its threads. All other options are those of index. A task that fails is "
      "tried\n"
      "again by its exit status.\n"
      "Examples:\n"
      "  surfeit plan --index tile1.ply tile2.ply -o city.sft --shards 16 --slurm > index.sh\n"
      "  bash index.sh\n"
      "  surfeit plan --index crowd.####.ply -o crowd.####.sft --frames 1-240 --shards 4 \\\n"
      "      --memory 1G --make > index.mk\n"
      "  make -k -j 8 -f index.mk");
  command.callback([arguments, &command, &context] {
    context.run([&] { return runIndexPlan(*arguments, command, context); });
  });
}

}  // namespace surfeit
