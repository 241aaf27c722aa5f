// surfeit index: surfel clouds to a paged octree file.
#include <fmt/format.h>

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "surfeit/index.h"
#include "surfeit/index_shards.h"
#include "surfeit/process.h"
#include "tools/command.h"
#include "tools/index_options.h"
#include "tools/shard_option.h"

namespace surfeit {
namespace {

struct IndexArguments : IndexSettings {
  bool is_dry_run = false;
  std::string pass;  // of an index in shards; empty: all at once
  std::optional<ShardRange> shard;
  int shards = 0;
  bool removes_shards = false;
};

// --dry-run
Status sayForecast(const IndexArguments& arguments, CommandContext& context) {
  SURFEIT_ASSIGN_OR_RETURN(
      const IndexForecast forecast,
      forecastIndex(arguments.inputs, arguments.output, arguments.options, context.progress()));
  context.answer(fmt::format(
      "{}: {} surfels in {} to read, by a sample of {}:\n"
      "  memory           {}\n"
      "  temporary files  about {}\n"
      "  scene            about {}\n"
      "  time             about {:.0f} s, and that to read the input\n"
      "Nothing was written.",
      arguments.output, formatCount(forecast.records), formatBytes(forecast.input_bytes),
      formatCount(forecast.sampled_surfels), formatBytes(forecast.memory_bytes),
      formatBytes(forecast.temporary_bytes), formatBytes(forecast.file_bytes), forecast.seconds));
  return context.writeStats({{"command", "index"},
                             {"dry_run", true},
                             {"records", forecast.records},
                             {"sampled_surfels", forecast.sampled_surfels},
                             {"input_bytes", forecast.input_bytes},
                             {"memory_bytes", forecast.memory_bytes},
                             {"temporary_bytes", forecast.temporary_bytes},
                             {"file_bytes", forecast.file_bytes},
                             {"seconds", forecast.seconds}});
}

// Those of shards; "merge" is of all.
constexpr std::pair<const char*, IndexPass> kPasses[] = {{"count", IndexPass::kCount},
                                                         {"distribute", IndexPass::kDistribute},
                                                         {"build", IndexPass::kBuild},
                                                         {"places", IndexPass::kPlaces},
                                                         {"sizes", IndexPass::kSizes}};

IndexPass passOf(const std::string& name) {
  for (const auto& [word, pass] : kPasses) {
    if (name == word) return pass;
  }
  return IndexPass::kCount;
}

// --pass: what goes with which.
Status checkPass(const IndexArguments& arguments) {
  const bool is_merge = arguments.pass == "merge";
  if (arguments.pass.empty()) {
    if (!arguments.shard && arguments.shards == 0 && !arguments.removes_shards) return {};
    return Status::invalidArgument(
        "--shard, --shards and --remove-shards are of one pass of an index in shards, expected "
        "--pass count|distribute|build|places|sizes|merge");
  }
  if (arguments.is_dry_run) {
    return Status::invalidArgument("--dry-run estimates a whole index, expected no --pass");
  }
  if (is_merge && (arguments.shard || arguments.shards == 0)) {
    return Status::invalidArgument(
        "--pass merge writes the scene from all shards, expected their number (--shards N)");
  }
  if (!is_merge && (!arguments.shard || arguments.shards > 0 || arguments.removes_shards)) {
    return Status::invalidArgument(
        fmt::format("--pass {} is of one shard, expected --shard I/N alone", arguments.pass));
  }
  return {};
}

// One shard of --pass.
Status runPass(const IndexArguments& arguments, CommandContext& context) {
  const IndexPass pass = passOf(arguments.pass);
  SURFEIT_ASSIGN_OR_RETURN(const IndexShardStats stats,
                           indexShards(arguments.inputs, arguments.output, arguments.options, pass,
                                       *arguments.shard, context.progress()));
  const std::string shard = fmt::format("{}: shard {} of {}", arguments.output,
                                        arguments.shard->first, arguments.shard->count);
  if (pass == IndexPass::kPlaces && arguments.shard->first > 1) {
    context.say(fmt::format("{}: nothing to do, places is of shard 1", shard));
  } else if (stats.finished_shards > 0) {
    context.say(fmt::format("{}: {} was done before", shard, arguments.pass));
  } else {
    context.say(
        fmt::format("{}: {} of {} surfels in {:.1f} s, wrote {}\n"
                    "memory: budget {}, peak resident {}, temporary files {}",
                    shard, arguments.pass, formatCount(stats.surfels), context.wallSeconds(),
                    formatBytes(stats.file_bytes), formatBytes(stats.memory_bytes),
                    formatBytes(peakResidentBytes()), formatBytes(stats.temporary_bytes)));
  }
  return context.writeStats({{"command", "index"},
                             {"pass", arguments.pass},
                             {"shard", arguments.shard->first},
                             {"shards", arguments.shard->count},
                             {"finished_shards", stats.finished_shards},
                             {"memory_bytes", stats.memory_bytes},
                             {"records", stats.records},
                             {"surfels", stats.surfels},
                             {"file_bytes", stats.file_bytes},
                             {"temporary_bytes", stats.temporary_bytes}});
}

Result<IndexStats> writeScene(const IndexArguments& arguments, CommandContext& context) {
  if (arguments.pass == "merge") {
    return mergeIndexShards(arguments.inputs, arguments.output, arguments.options, arguments.shards,
                            arguments.removes_shards, context.progress());
  }
  return indexClouds(arguments.inputs, arguments.output, arguments.options, context.progress());
}

Status runIndex(IndexArguments& arguments, CommandContext& context) {
  SURFEIT_RETURN_IF_ERROR(completeIndexOptions(arguments, context.common));
  SURFEIT_RETURN_IF_ERROR(checkPass(arguments));
  if (arguments.is_dry_run) return sayForecast(arguments, context);
  if (arguments.shard) return runPass(arguments, context);
  SURFEIT_ASSIGN_OR_RETURN(const IndexStats stats, writeScene(arguments, context));
  const double seconds = context.wallSeconds();
  const double bytes_per_surfel = double(stats.file_bytes) / double(stats.surfels);
  context.say(
      fmt::format("{}: {} surfels, {} nodes, {} pages, {} ({:.1f} bytes per surfel)\n"
                  "{:.1f} s ({}), {:.2f} M surfels/s, peak memory {}, temporary files {}",
                  arguments.output, formatCount(stats.surfels), formatCount(stats.nodes),
                  formatCount(std::uint64_t{stats.node_pages} + stats.surfel_pages),
                  formatBytes(stats.file_bytes), bytes_per_surfel, seconds,
                  formatPhases(stats.phase_seconds), double(stats.surfels) / seconds / 1e6,
                  formatBytes(peakResidentBytes()), formatBytes(stats.temporary_bytes)));
  return context.writeStats({{"command", "index"},
                             {"memory_bytes", stats.memory_bytes},
                             {"input_bytes", stats.input_bytes},
                             {"surfels", stats.surfels},
                             {"skipped_records", stats.skipped_records},
                             {"repeated_surfels", stats.repeated_surfels},
                             {"normals_found", stats.normals_found},
                             {"thin_surfels", stats.thin_surfels},
                             {"scattered_surfels", stats.scattered_surfels},
                             {"nodes", stats.nodes},
                             {"node_pages", stats.node_pages},
                             {"surfel_pages", stats.surfel_pages},
                             {"file_bytes", stats.file_bytes},
                             {"bytes_per_surfel", bytes_per_surfel},
                             {"temporary_bytes", stats.temporary_bytes},
                             {"surfels_per_second", double(stats.surfels) / seconds},
                             {"phases", jsonOfPhases(stats.phase_seconds)}});
}

void addPassOptions(CLI::App& command, IndexArguments& arguments) {
  constexpr const char* kGroup = "Many machines";
  command
      .add_option(
          "--pass", arguments.pass,
          "Do one pass of an index in shards alone (docs/farm.md): count, distribute and "
          "build of every shard, then merge; where sizes or normals follow from neighbours, "
          "places of shard 1 and sizes of every shard before it")
      ->check(CLI::IsMember({"count", "distribute", "build", "places", "sizes", "merge"}))
      ->group(kGroup);
  command
      .add_option_function<std::string>(
          "--shard", [&](const std::string& text) { arguments.shard = parseShard(text); },
          "The I-th of N shards of --pass, into a file beside the scene")
      ->type_name("I/N")
      ->group(kGroup);
  command
      .add_option("--shards", arguments.shards, "Number of shards that --pass merge puts together")
      ->check(CLI::Range(1, kMostShards))
      ->group(kGroup);
  command
      .add_flag("--remove-shards", arguments.removes_shards,
                "Remove the files of the shards when --pass merge has written the scene")
      ->group(kGroup);
}

}  // namespace

void addIndexCommand(CLI::App& app, CommandContext& context) {
  CLI::App* command =
      app.add_subcommand("index", "Build a paged octree file (.sft) from surfel clouds");
  const auto arguments = std::make_shared<IndexArguments>();
  addIndexOptions(*command, *arguments);
  command->add_flag("--dry-run", arguments->is_dry_run,
                    "Write no scene; estimate memory, files and time from a sample");
  addPassOptions(*command, *arguments);
  context.addCommonOptions(*command);
  context.addFrameOptions(*command);
  command->footer(
      "Missing channels are filled in by rules, and each rule used is reported once: area from\n"
      "radius and disk overlap; radius, or both, from the neighbours, with disks in the middle\n"
      "of their cells; without a normal a surfel is a sphere (or --normals estimate).\n"
      "--memory defaults to 1G, or 3/4 of what the job may hold where that is less; the least\n"
      "is 64M, and some 13M more for each thread beyond the second.\n"
      "Examples:\n"
      "  surfeit index lion.ply -o lion.sft\n"
      "  surfeit index city.ply -o city.sft --memory 512M --dry-run\n"
      "  surfeit index part1.ply part2.ply -o city.sft --memory 512M --temp /scratch\n"
      "  surfeit index room.ply --group lamp=lamp.ply --group tree=tree.ply -o named.sft\n"
      "  surfeit index tile1.las tile2.las -o survey.sft --overlap thin\n"
      "  surfeit index city.ply -o city.sft --memory 80%\n"
      "  surfeit index city.ply -o city.sft --pass count --shard 3/16  # then the other passes\n"
      "  surfeit index city.ply -o city.sft --pass merge --shards 16 --remove-shards\n"
      "  surfeit index frame2.ply -o frame2.sft --cube frame1.sft\n"
      "  surfeit index scan.las -o scan.sft --normals estimate --orient up\n"
      "  surfeit index baked.ptc -o baked.sft --channels _bake=radiosity,_N2=-");
  command->callback(
      [arguments, &context] { context.run([&] { return runIndex(*arguments, context); }); });
}

}  // namespace surfeit
