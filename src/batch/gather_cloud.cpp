// A gather reads its receivers twice: once to sort them along the scene's curve, and once to write
// them with their results.
//
//   rows --sort--> receivers along the curve --gather (all threads)--> results --by index--> rows
//
// No result depends on any other, so that order, runs and threads show nowhere in them.

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>

#include "batch/gather_crew.h"
#include "batch/gather_input.h"
#include "batch/gather_memory.h"
#include "batch/gather_options.h"
#include "batch/result_store.h"
#include "batch/sorted_receiver.h"
#include "cloud/cloud_formats.h"
#include "core/guard.h"
#include "core/parallel.h"
#include "core/program_memory.h"
#include "octree/read/group_set.h"
#include "octree/read/scene_file.h"
#include "octree/read/scene_light.h"
#include "storage/file.h"
#include "storage/output_target.h"
#include "surfeit/bake.h"

namespace surfeit {
namespace {

Result<GatherStats> gatherCloudOrThrow(const std::string& scene_path,
                                       const std::string& receivers_path,
                                       const std::string& result_path, const GatherOptions& given,
                                       Progress& progress) {
  SURFEIT_RETURN_IF_ERROR(checkGatherOptions(given));
  if (result_path == scene_path) {
    return Status::invalidArgument(
        fmt::format("{}: the result would replace the scene", scene_path));
  }
  GatherOptions options = withDefaults(given);
  GatherStats stats;
  stats.threads = options.threads;
  stats.memory_bytes = options.memory_bytes;
  const std::string temporary_directory =
      temporaryDirectory(options.temporary_directory, result_path);

  // Open scene and receivers
  SURFEIT_ASSIGN_OR_RETURN(SceneFile scene, SceneFile::open(scene_path, sceneAccess(options)));
  SURFEIT_RETURN_IF_ERROR(checkGroups(scene, options.groups));
  options.eye -= scene.header().origin;
  SURFEIT_ASSIGN_OR_RETURN(
      const std::optional<ColorRange> colors,
      colorRangeFor(std::span(&receivers_path, 1), result_path, options.color_range));
  SURFEIT_ASSIGN_OR_RETURN(
      GatherInput input,
      GatherInput::open(receivers_path, options.channels, options.part, options.filter, colors));
  SURFEIT_RETURN_IF_ERROR(input.check(GatherRules(options)));
  const ResultRows result_rows(input.receivers(), options.outputs, options.mode);
  stats.receivers = input.receiverCount();

  SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<const LoadedEnvironment> environment,
                           loadEnvironment(options, scene.header().up, progress));
  // Spend the budget before anything large is allocated
  GatherWork work = gatherWork(input.receivers(), options);
  if (environment != nullptr) {
    work.held_bytes = environment->map.memoryBytes() + environment->cube.memoryBytes();
  }
  SURFEIT_ASSIGN_OR_RETURN(const GatherMemory memory,
                           planGatherMemory(scene, stats.memory_bytes, work));

  RowWriterOptions writing;
  writing.properties = result_rows.properties();
  writing.comments = input.reader().comments();
  writing.count = stats.receivers;
  writing.like = &input.reader();
  // Of what the caches give back before
  writing.memory_parts = 2;
  writing.memory_beside_bytes = programBytes(options.threads);
  writing.memory_bytes =
      (stats.memory_bytes - std::min(stats.memory_bytes, writing.memory_beside_bytes)) / 2;
  writing.progress = &progress;
  SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<RowWriter> writer,
                           createRowWriter(result_path, writing));

  // Sort
  input.note(progress);
  if (options.mode != GatherMode::kOcclusion && environment == nullptr) {
    SURFEIT_RETURN_IF_ERROR(noteDarkness(scene, progress));
  }
  std::set<std::string> told;
  const auto noteOfWriter = [&] {
    for (const std::string& note : writer->notes()) {
      if (told.insert(note).second) progress.note(fmt::format("{}: {}", result_path, note));
    }
  };
  noteOfWriter();
  progress.beginPhase("sort", stats.receivers, "receivers");
  auto sorter = std::make_unique<ExternalSorter>(
      ExternalSorter::Options{.record_bytes = sizeof(SortedReceiver),
                              .count = stats.receivers,
                              .memory_bytes = memory.sorter_bytes,
                              .reading_bytes = memory.sorter_reading_bytes,
                              .temporary_directory = temporary_directory});
  Status sorted;
  withThreads(stats.threads, [&] {
    sorted = input.sort(options.order, scene.header(), options.strict, *sorter, progress);
  });
  SURFEIT_RETURN_IF_ERROR(sorted);
  stats.invalid_receivers = input.defects().total();
  if (stats.invalid_receivers > 0) {
    progress.note(fmt::format("{}: no result (NaN) at invalid receivers: {}", receivers_path,
                              input.defects().describe()));
  }

  // Gather
  ResultStore results({.count = stats.receivers,
                       .outputs = options.outputs,
                       .memory_bytes = memory.result_bytes,
                       .temporary_directory = temporary_directory});
  SURFEIT_RETURN_IF_ERROR(gatherSorted(
      std::move(scene), *sorter, memory, options, stats,
      [&](std::span<const ResultStore::Entry> entries) { return results.put(entries); }, progress,
      environment.get()));
  stats.temporary_bytes = sorter->temporaryBytes() + results.temporaryBytes();
  sorter.reset();

  // Write
  SURFEIT_RETURN_IF_ERROR(results.finish());
  progress.beginPhase("write", stats.receivers, "receivers");
  SURFEIT_RETURN_IF_ERROR(input.write(result_rows, results, *writer, progress));
  noteOfWriter();  // what it found out on the way
  return stats;
}

}  // namespace

Result<GatherStats> gatherCloud(const std::string& scene_path, const std::string& receivers_path,
                                const std::string& result_path, const GatherOptions& options,
                                Progress& progress) {
  return guarded(result_path, [&]() -> Result<GatherStats> {
    return gatherCloudOrThrow(scene_path, receivers_path, result_path, options, progress);
  });
}

}  // namespace surfeit
