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
#include "storage/external_sorter.h"
#include "storage/file.h"
#include "storage/output_target.h"
#include "surfeit/bake.h"

namespace surfeit {
namespace {

class CloudGather {
 public:
  CloudGather(const std::string& receivers_path, const std::string& result_path,
              const GatherOptions& options, Progress& progress)
      : receivers_path_(receivers_path),
        result_path_(result_path),
        options_(options),
        temporary_directory_(temporaryDirectory(options.temporary_directory, result_path)),
        progress_(progress) {
    stats_.outputs = options.outputs;
    stats_.threads = options.threads;
    stats_.memory_bytes = options.memory_bytes;
  }

  Result<GatherStats> run(SceneFile scene) {
    options_.eye -= scene.header().origin;
    SURFEIT_ASSIGN_OR_RETURN(GatherInput input, openReceivers());
    stats_.receivers = input.receiverCount();
    SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<const LoadedEnvironment> environment,
                             loadEnvironment(options_, scene.header().up, progress_));
    // Spend the budget before anything large is allocated
    SURFEIT_ASSIGN_OR_RETURN(const GatherMemory memory,
                             plan(scene, input.receivers(), environment.get()));
    const ResultRows rows(input.receivers(), options_.outputs, options_.mode);
    SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<RowWriter> writer, createWriter(input, rows));
    input.note(progress_);
    if (options_.mode != GatherMode::kOcclusion && environment == nullptr) {
      SURFEIT_RETURN_IF_ERROR(noteDarkness(scene, progress_));
    }
    noteOf(*writer);

    SURFEIT_ASSIGN_OR_RETURN(std::unique_ptr<ExternalSorter> sorter,
                             sort(input, scene.header(), memory));
    ResultStore results({.count = stats_.receivers,
                         .outputs = options_.outputs,
                         .memory_bytes = memory.result_bytes,
                         .temporary_directory = temporary_directory_});
    SURFEIT_RETURN_IF_ERROR(gatherSorted(
        std::move(scene), *sorter, memory, options_, stats_,
        [&](std::span<const ResultStore::Entry> entries) { return results.put(entries); },
        progress_, environment.get()));
    stats_.temporary_bytes = sorter->temporaryBytes() + results.temporaryBytes();
    sorter.reset();
    SURFEIT_RETURN_IF_ERROR(results.finish());
    progress_.beginPhase("write", stats_.receivers, "receivers");
    SURFEIT_RETURN_IF_ERROR(input.write(rows, results, *writer, progress_));
    noteOf(*writer);  // what it found out on the way
    return stats_;
  }

 private:
  Result<GatherInput> openReceivers() {
    SURFEIT_ASSIGN_OR_RETURN(
        const std::optional<ColorRange> colors,
        colorRangeFor(std::span(&receivers_path_, 1), result_path_, options_.color_range));
    SURFEIT_ASSIGN_OR_RETURN(GatherInput input,
                             GatherInput::open(receivers_path_, options_.channels, options_.part,
                                               options_.filter, colors));
    SURFEIT_RETURN_IF_ERROR(input.check(GatherRules(options_)));
    return input;
  }

  Result<GatherMemory> plan(const SceneFile& scene, const RowLayout& receivers,
                            const LoadedEnvironment* environment) const {
    GatherWork work = gatherWork(receivers, options_);
    if (environment != nullptr) {
      work.held_bytes = environment->map.memoryBytes() + environment->cube.memoryBytes();
    }
    return planGatherMemory(scene, stats_.memory_bytes, work);
  }

  Result<std::unique_ptr<RowWriter>> createWriter(const GatherInput& input,
                                                  const ResultRows& rows) {
    RowWriterOptions writing;
    writing.properties = rows.properties();
    writing.comments = input.reader().comments();
    writing.count = stats_.receivers;
    writing.like = &input.reader();
    // Of what the caches give back before
    writing.memory_parts = 2;
    writing.memory_beside_bytes = programBytes(options_.threads);
    writing.memory_bytes =
        (stats_.memory_bytes - std::min(stats_.memory_bytes, writing.memory_beside_bytes)) / 2;
    writing.progress = &progress_;
    return createRowWriter(result_path_, writing);
  }

  Result<std::unique_ptr<ExternalSorter>> sort(GatherInput& input, const SceneHeader& scene,
                                               const GatherMemory& memory) {
    progress_.beginPhase("sort", stats_.receivers, "receivers");
    auto sorter = std::make_unique<ExternalSorter>(
        ExternalSorter::Options{.record_bytes = sizeof(SortedReceiver),
                                .count = stats_.receivers,
                                .memory_bytes = memory.sorter_bytes,
                                .reading_bytes = memory.sorter_reading_bytes,
                                .temporary_directory = temporary_directory_});
    Status sorted;
    withThreads(stats_.threads, [&] {
      sorted = input.sort(options_.order, scene, options_.strict, *sorter, progress_);
    });
    SURFEIT_RETURN_IF_ERROR(sorted);
    stats_.invalid_receivers = input.defects().total();
    if (stats_.invalid_receivers > 0) {
      progress_.note(fmt::format("{}: no result (NaN) at invalid receivers: {}", receivers_path_,
                                 input.defects().describe()));
    }
    return sorter;
  }

  void noteOf(const RowWriter& writer) {
    for (const std::string& note : writer.notes()) {
      if (told_.insert(note).second) progress_.note(fmt::format("{}: {}", result_path_, note));
    }
  }

  const std::string &receivers_path_, &result_path_;
  GatherOptions options_;
  const std::string temporary_directory_;
  Progress& progress_;
  GatherStats stats_;
  std::set<std::string> told_;
};

}  // namespace

Result<GatherStats> gatherCloud(const std::string& scene_path, const std::string& receivers_path,
                                const std::string& result_path, const GatherOptions& given,
                                Progress& progress) {
  return guarded(result_path, [&]() -> Result<GatherStats> {
    SURFEIT_RETURN_IF_ERROR(checkGatherOptions(given));
    if (result_path == scene_path) {
      return Status::invalidArgument(
          fmt::format("{}: the result would replace the scene", scene_path));
    }
    const GatherOptions options = withDefaults(given);
    SURFEIT_ASSIGN_OR_RETURN(SceneFile scene, SceneFile::open(scene_path, sceneAccess(options)));
    SURFEIT_RETURN_IF_ERROR(checkGroups(scene, options.groups));
    return CloudGather(receivers_path, result_path, options, progress).run(std::move(scene));
  });
}

}  // namespace surfeit
