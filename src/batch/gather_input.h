// The receivers of a cloud: read once to be sorted along the curve, and once more to be written
// with their results. Nothing of them is held that grows with their number.
#pragma once

#include <xxhash.h>

#include <compare>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>

#include "batch/receiver_rows.h"
#include "batch/result_store.h"
#include "batch/row_blocks.h"
#include "batch/sorted_receiver.h"
#include "cloud/rows/row_reader.h"
#include "cloud/rows/row_writer.h"
#include "gather/rules/gather_rules.h"
#include "octree/read/scene_file.h"
#include "surfeit/bake.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

// A place in the order of the receivers, of the next receiver or beyond the last one.
struct OrderPlace {
  CurveKey key = 0;
  std::uint64_t index = 0;

  friend auto operator<=>(const OrderPlace&, const OrderPlace&) = default;
};

// The receivers from one place to another.
struct OrderRange {
  static constexpr OrderPlace kEnd = {std::numeric_limits<CurveKey>::max(),
                                      std::numeric_limits<std::uint64_t>::max()};
  OrderPlace begin, end = kEnd;

  bool contains(const OrderPlace& place) const { return begin <= place && place < end; }
};

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

  // Gives the valid receivers of a range to the sorter, about the scene's origin and with keys of
  // `order` in its cube. Invalid ones are counted; kCorruption with `strict`. With `blocks`, those
  // that have none of the `wanted` shards are passed over where the reader can.
  Status sort(ReceiverOrder order, const SceneHeader& scene, bool strict, ExternalSorter& sorter,
              Progress& progress, const OrderRange& range = {}, const RowBlocks* blocks = nullptr,
              std::uint64_t wanted = 0);
  // Of the last sort.
  const SurfelDefects& defects() const { return defects_; }

  // Of the rows, all of which the last sort or write has read, or knew of blocks passed over.
  std::uint64_t checksum() const { return blocks_.checksum(); }
  // Checksums of the same, without shards.
  const RowBlocks& blocks() const { return blocks_; }
  // Writes all receivers with their results, in the order of the input. The caller finishes the
  // writer.
  Status write(const ResultRows& rows, ResultStore& results, RowWriter& writer, Progress& progress);

 private:
  GatherInput(std::unique_ptr<RowReader> reader, ReceiverMapping mapping);

  Status rewind();
  // Reads the next rows, up to kSliceRows; none at the end.
  Result<Bytes> readSlice(Progress& progress);
  // Passes over the next block, if it has none of the wanted shards: the rows that it has.
  Result<std::uint64_t> skipBlock(const RowBlocks& known, std::uint64_t wanted);
  void endBlock();

  std::unique_ptr<RowReader> reader_;
  ReceiverMapping mapping_;
  AlignedBuffer slice_;
  SurfelDefects defects_;
  struct FreeHash {
    void operator()(XXH3_state_t* state) const { XXH3_freeState(state); }
  };
  std::unique_ptr<XXH3_state_t, FreeHash> rows_hash_;  // of the block
  RowBlocks blocks_;                                   // up to here
  std::uint64_t row_ = 0;                              // that comes next
};

}  // namespace surfeit
