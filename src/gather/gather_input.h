// The receivers of a cloud: read once to be sorted along the curve, and once more to be written
// with their results. Nothing of them is held that grows with their number.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "core/bounds.h"
#include "gather/gather_rules.h"
#include "gather/receiver_rows.h"
#include "gather/receiver_sorter.h"
#include "gather/result_store.h"
#include "io/ply_reader.h"
#include "io/ply_writer.h"
#include "surfeit/gather.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

// One thread at a time.
class GatherInput {
 public:
  // Opens the cloud and finds its receivers. Errors as of PlyReader::open and ReceiverMapping.
  static Result<GatherInput> open(const std::string& path);

  std::uint64_t receiverCount() const { return receivers().count; }
  const PlyElement& receivers() const { return reader_.header().elements[element_]; }

  // kCorruption when receivers lack what the mode needs.
  Status check(const GatherRules& rules) const;

  // Tells what of the input the result does not keep, and what the gather makes of the rest.
  void note(Progress& progress) const;

  // Gives all valid receivers to the sorter, with keys of `order` in `cube`. Invalid ones are
  // counted; kCorruption with `strict`.
  Status sort(ReceiverOrder order, const RootCube& cube, bool strict, ReceiverSorter& sorter,
              Progress& progress);
  // Of the last sort.
  const SurfelDefects& defects() const { return defects_; }

  // Writes all receivers with their results, in the order of the input.
  Status write(const ResultRows& rows, ResultStore& results, PlyWriter& writer, Progress& progress);

  // The comments of the input that a result keeps.
  std::vector<std::string> comments() const;

 private:
  GatherInput(PlyReader reader, std::size_t element, ReceiverMapping mapping);

  // Reads the next rows, up to kSliceRows; 0 at the end.
  Result<std::size_t> readSlice(Progress& progress);

  PlyReader reader_;
  std::size_t element_;
  ReceiverMapping mapping_;
  std::vector<std::byte> slice_;
  SurfelDefects defects_;
};

}  // namespace surfeit
