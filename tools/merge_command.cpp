// surfeit merge: the result of a gather from its shards.
#include <fmt/format.h>

#include <memory>
#include <string>

#include "surfeit/process.h"
#include "surfeit/shards.h"
#include "tools/channel_options.h"
#include "tools/command.h"

namespace surfeit {
namespace {

struct MergeArguments {
  std::string scene, receivers, result;
  MergeOptions options;
};

Status runMerge(MergeArguments& arguments, CommandContext& context) {
  MergeOptions& options = arguments.options;
  options.threads = context.threads();
  options.strict = context.common.strict;
  options.memory_bytes = context.common.memory_bytes;
  SURFEIT_ASSIGN_OR_RETURN(const MergeStats stats,
                           mergeShards(arguments.scene, arguments.receivers, arguments.result,
                                       options, context.progress()));
  context.say(
      fmt::format("{}: {} receivers of {} shards in {:.1f} s\n"
                  "memory: budget {}, peak resident {}, temporary files {}",
                  arguments.result, formatCount(stats.receivers), stats.shards,
                  context.wallSeconds(), formatBytes(stats.memory_bytes),
                  formatBytes(peakResidentBytes()), formatBytes(stats.temporary_bytes)));
  return context.writeStats({{"command", "merge"},
                             {"shards", stats.shards},
                             {"receivers", stats.receivers},
                             {"invalid_receivers", stats.invalid_receivers},
                             {"memory_bytes", stats.memory_bytes},
                             {"temporary_bytes", stats.temporary_bytes}});
}

}  // namespace

void addMergeCommand(CLI::App& app, CommandContext& context) {
  CLI::App* command = app.add_subcommand(
      "merge", "Write the result of a gather whose shards were gathered by --shard");
  const auto arguments = std::make_shared<MergeArguments>();
  command->add_option("SCENE", arguments->scene, "Scene file of the gather")->required();
  command->add_option("RECEIVERS", arguments->receivers, "Receivers of the gather")->required();
  addCloudOutputOption(*command, arguments->result, "Result cloud, as named in the gather", true);
  command
      ->add_option("--shards", arguments->options.count,
                   "Number of shards (default: as the files beside CLOUD say)")
      ->check(CLI::Range(1, kMostShards));
  command->add_flag("--remove-shards", arguments->options.removes_shards,
                    "Remove the files of the shards when the result is complete");
  addTemporaryOption(*command, arguments->options.temporary_directory);
  context.addCommonOptions(*command);
  context.addFrameOptions(*command);
  command->footer(
      "The result is byte for byte that of one gather. Modes, outputs and how receivers are read\n"
      "are as in the gather; the shards say so. Exit status 75: shards are missing, damaged or of\n"
      "another job; the message names them. Gather these again, and merge again.\n"
      "Examples:\n"
      "  for i in 1 2 3 4; do\n"
      "    surfeit gather city.sft street.ply -o street_ao.ply --shard $i/4\n"
      "  done\n"
      "  surfeit merge city.sft street.ply -o street_ao.ply\n"
      "  surfeit merge city.sft street.ply -o street_ao.ply --shards 4 --remove-shards");
  command->callback(
      [arguments, &context] { context.run([&] { return runMerge(*arguments, context); }); });
}

}  // namespace surfeit
