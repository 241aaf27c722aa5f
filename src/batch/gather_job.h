// What a gather from file to file, its shards and their merge have in common: the receivers and
// their order, the environment, the memory, and the file of the result.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>

#include "batch/gather_input.h"
#include "batch/gather_memory.h"
#include "batch/gather_options.h"
#include "batch/receiver_rows.h"
#include "batch/result_store.h"
#include "batch/row_blocks.h"
#include "cloud/rows/row_writer.h"
#include "gather/light/environment_map.h"
#include "octree/read/scene_file.h"
#include "storage/external_sorter.h"
#include "surfeit/bake.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

// One thread at a time. Notes are told once.
class GatherJob {
 public:
  // Opens the receivers and the environment, and plans the memory. `options` with defaults filled
  // in; `progress` must outlive the job. Errors: as gatherCloud.
  static Result<GatherJob> open(const std::string& receivers_path, const std::string& result_path,
                                const GatherOptions& options, const SceneFile& scene,
                                Progress& progress);
  // For results that were gathered before: only mode, outputs, and how receivers are read count.
  static Result<GatherJob> openToMerge(const std::string& receivers_path,
                                       const std::string& result_path, const GatherOptions& options,
                                       const SceneFile& scene, Progress& progress);

  GatherInput& input() { return input_; }
  const GatherInput& input() const { return input_; }
  const GatherMemory& memory() const { return memory_; }
  const LoadedEnvironment* environment() const { return environment_.get(); }
  // About the scene's origin.
  const GatherOptions& options() const { return options_; }

  // Leaves the caches alone while receivers are sorted, where they hold pages already.
  void sortBesideCaches();

  // Statistics of a job that has gathered at nothing yet.
  GatherStats stats() const;
  // How its results are kept until they are written.
  ResultStore::Options resultPlan() const;

  // Tells what the gather makes of its input, and what stays dark.
  Status note(const SceneFile& scene);

  // The receivers of a range, along the order. Tells of the invalid ones, unless `blocks` say which
  // rows have none of the `wanted` shards: some may lie there.
  Result<std::unique_ptr<ExternalSorter>> sort(const SceneHeader& scene,
                                               const OrderRange& range = {},
                                               const RowBlocks* blocks = nullptr,
                                               std::uint64_t wanted = 0);

  // Creates the file of the result; before write().
  Status createResult();
  // Whether its writer holds all rows until the end, in the memory of the caches.
  bool writerTakesCaches() const;
  // Finishes the results, and writes the receivers with them as rows of the result. `checksum`: of
  // the receivers' rows, where it is known; kCorruption when they have changed since.
  Status write(ResultStore& results, std::optional<std::uint64_t> checksum = {});

 private:
  static Result<GatherJob> openReceivers(const std::string& receivers_path,
                                         const std::string& result_path,
                                         const GatherOptions& options, Progress& progress);
  Status plan(const SceneFile& scene);
  GatherJob(GatherInput input, const std::string& result_path, const GatherOptions& options,
            Progress& progress);
  void noteWriter();

  GatherInput input_;
  std::string result_path_;
  GatherOptions options_;
  ResultRows rows_;
  std::string temporary_directory_;
  Progress* progress_;
  std::unique_ptr<const LoadedEnvironment> environment_;
  GatherMemory memory_;
  std::unique_ptr<RowWriter> writer_;
  std::set<std::string> told_;
};

}  // namespace surfeit
