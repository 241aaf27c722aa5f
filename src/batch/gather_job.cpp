#include "batch/gather_job.h"

#include <fmt/format.h>

#include <algorithm>
#include <span>
#include <utility>

#include "batch/bounce_look.h"
#include "batch/sorted_receiver.h"
#include "cloud/cloud_formats.h"
#include "core/parallel.h"
#include "core/program_memory.h"
#include "octree/read/scene_light.h"
#include "storage/output_target.h"

namespace surfeit {

Result<GatherJob> GatherJob::openReceivers(const std::string& receivers_path,
                                           const std::string& result_path,
                                           const GatherOptions& options, Progress& progress) {
  SURFEIT_ASSIGN_OR_RETURN(
      const std::optional<ColorRange> colors,
      colorRangeFor(std::span(&receivers_path, 1), result_path, options.color_range));
  SURFEIT_ASSIGN_OR_RETURN(
      GatherInput input,
      GatherInput::open(receivers_path, options.channels, options.part, options.filter, colors));
  return GatherJob(std::move(input), result_path, options, progress);
}

Result<GatherJob> GatherJob::open(const std::string& receivers_path, const std::string& result_path,
                                  const GatherOptions& options, const SceneFile& scene,
                                  Progress& progress) {
  SURFEIT_ASSIGN_OR_RETURN(GatherJob job,
                           openReceivers(receivers_path, result_path, options, progress));
  SURFEIT_RETURN_IF_ERROR(job.input_.check(GatherRules(options)));
  job.options_.eye -= scene.header().origin;
  job.options_.look = countedFrom(std::move(job.options_.look), scene.header().origin);
  SURFEIT_ASSIGN_OR_RETURN(job.environment_,
                           loadEnvironment(job.options_, scene.header().up, progress));
  SURFEIT_RETURN_IF_ERROR(job.plan(scene));
  return job;
}

Result<GatherJob> GatherJob::openToMerge(const std::string& receivers_path,
                                         const std::string& result_path,
                                         const GatherOptions& options, const SceneFile& scene,
                                         Progress& progress) {
  SURFEIT_ASSIGN_OR_RETURN(GatherJob job,
                           openReceivers(receivers_path, result_path, options, progress));
  SURFEIT_RETURN_IF_ERROR(job.plan(scene));
  return job;
}

Status GatherJob::plan(const SceneFile& scene) {
  GatherWork work = gatherWork(input_.receivers(), options_);
  if (environment_ != nullptr) work.held_bytes = environment_->memoryBytes();
  SURFEIT_ASSIGN_OR_RETURN(memory_, planGatherMemory(scene, options_.memory_bytes, work));
  return {};
}

GatherJob::GatherJob(GatherInput input, const std::string& result_path,
                     const GatherOptions& options, Progress& progress)
    : input_(std::move(input)),
      result_path_(result_path),
      options_(options),
      rows_(input_.receivers(), options.outputs, options.mode),
      temporary_directory_(surfeit::temporaryDirectory(options.temporary_directory, result_path)),
      progress_(&progress) {}

// Results are not there yet.
void GatherJob::sortBesideCaches() {
  memory_.sorter_bytes =
      std::min(memory_.sorter_bytes, memory_.sorter_reading_bytes + memory_.result_bytes);
}

GatherStats GatherJob::stats() const {
  GatherStats stats;
  stats.outputs = options_.outputs;
  stats.threads = options_.threads;
  stats.memory_bytes = options_.memory_bytes;
  stats.receivers = input_.receiverCount();
  return stats;
}

ResultStore::Options GatherJob::resultPlan() const {
  return {.count = input_.receiverCount(),
          .outputs = options_.outputs,
          .memory_bytes = memory_.result_bytes,
          .temporary_directory = temporary_directory_};
}

Status GatherJob::note(const SceneFile& scene) {
  input_.note(*progress_);
  if (options_.mode == GatherMode::kOcclusion || environment_ != nullptr) return {};
  return noteDarkness(scene, *progress_);
}

Result<std::unique_ptr<ExternalSorter>> GatherJob::sort(const SceneHeader& scene,
                                                        const OrderRange& range,
                                                        const RowBlocks* blocks,
                                                        std::uint64_t wanted) {
  progress_->beginPhase("sort", input_.receiverCount(), "receivers");
  auto sorter = std::make_unique<ExternalSorter>(
      ExternalSorter::Options{.record_bytes = sizeof(SortedReceiver),
                              .count = input_.receiverCount(),
                              .memory_bytes = memory_.sorter_bytes,
                              .reading_bytes = memory_.sorter_reading_bytes,
                              .temporary_directory = temporary_directory_});
  Status sorted;
  withThreads(options_.threads, [&] {
    sorted = input_.sort(options_.order, scene, options_.strict, *sorter, *progress_, range, blocks,
                         wanted);
  });
  SURFEIT_RETURN_IF_ERROR(sorted);
  if (input_.defects().total() > 0 && blocks == nullptr) {
    const std::string note = fmt::format("{}: no result (NaN) at invalid receivers: {}",
                                         input_.reader().path(), input_.defects().describe());
    if (told_.insert(note).second) progress_->note(note);
  }
  return sorter;
}

Status GatherJob::createResult() {
  RowWriterOptions writing;
  writing.properties = rows_.properties();
  writing.comments = input_.reader().comments();
  writing.count = input_.receiverCount();
  writing.like = &input_.reader();
  // Of what the caches give back before
  writing.memory_parts = 2;
  writing.memory_beside_bytes = programBytes(options_.threads);
  writing.memory_bytes =
      (options_.memory_bytes - std::min(options_.memory_bytes, writing.memory_beside_bytes)) / 2;
  writing.progress = progress_;
  SURFEIT_ASSIGN_OR_RETURN(writer_, createRowWriter(result_path_, writing));
  noteWriter();
  return {};
}

bool GatherJob::writerTakesCaches() const {
  return heldWriterBytes(result_path_, input_.receiverCount(), rows_.rowBytes()) != 0;
}

Status GatherJob::write(ResultStore& results, std::optional<std::uint64_t> checksum) {
  SURFEIT_RETURN_IF_ERROR(results.finish());
  progress_->beginPhase("write", input_.receiverCount(), "receivers");
  SURFEIT_RETURN_IF_ERROR(input_.write(rows_, results, *writer_, *progress_));
  if (checksum && input_.checksum() != *checksum) {
    return Status::corruption(fmt::format(
        "{}: rows with checksum {:016x}, expected {:016x} as the shards were gathered for: gather "
        "the shards again, or merge with the receivers they belong to",
        input_.reader().path(), input_.checksum(), *checksum));
  }
  SURFEIT_RETURN_IF_ERROR(writer_->finish());
  noteWriter();  // what it found out on the way
  return {};
}

void GatherJob::noteWriter() {
  for (const std::string& note : writer_->notes()) {
    if (told_.insert(note).second) progress_->note(fmt::format("{}: {}", result_path_, note));
  }
}

}  // namespace surfeit
