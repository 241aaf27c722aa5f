// The receivers of a cloud: read once to be sorted along the curve, and once more to be written
// with their results. Nothing of them is held that grows with their number.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

#include "batch/receiver_rows.h"
#include "batch/result_store.h"
#include "batch/sorted_receiver.h"
#include "cloud/row_reader.h"
#include "cloud/row_writer.h"
#include "gather/rules/gather_rules.h"
#include "octree/read/scene_file.h"
#include "surfeit/bake.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

// One thread at a time.
class GatherInput {
 public:
  // Opens the cloud and finds its receivers. `channels`, `part`, `filter` and `color_range` as in
  // GatherOptions. Errors as of parseChannelRenames, openRowReader and ReceiverMapping.
  static Result<GatherInput> open(const std::string& path, const std::string& channels = {},
                                  const std::string& part = {}, const std::string& filter = {},
                                  std::optional<ColorRange> color_range = ColorRange::kAuto);

  std::uint64_t receiverCount() const { return receivers().count; }
  const RowLayout& receivers() const { return reader_->element(); }
  const RowReader& reader() const { return *reader_; }

  // kCorruption when receivers lack what the mode needs.
  Status check(const GatherRules& rules) const;

  // Tells what of the input the result does not keep, and what the gather makes of the rest.
  void note(Progress& progress) const;

  // Gives all valid receivers to the sorter, about the scene's origin and with keys of `order` in
  // its cube. Invalid ones are counted; kCorruption with `strict`.
  Status sort(ReceiverOrder order, const SceneHeader& scene, bool strict, ExternalSorter& sorter,
              Progress& progress);
  // Of the last sort.
  const SurfelDefects& defects() const { return defects_; }

  // Writes all receivers with their results, in the order of the input.
  Status write(const ResultRows& rows, ResultStore& results, RowWriter& writer, Progress& progress);

 private:
  GatherInput(std::unique_ptr<RowReader> reader, ReceiverMapping mapping);

  // Reads the next rows, up to kSliceRows; none at the end.
  Result<Bytes> readSlice(Progress& progress);

  std::unique_ptr<RowReader> reader_;
  ReceiverMapping mapping_;
  AlignedBuffer slice_;
  SurfelDefects defects_;
};

}  // namespace surfeit
