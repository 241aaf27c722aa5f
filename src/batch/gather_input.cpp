#include "batch/gather_input.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <new>
#include <span>
#include <utility>

#include "batch/gather_memory.h"
#include "cloud/cloud_formats.h"
#include "cloud/rows/channels.h"
#include "cloud/rows/property_aliases.h"
#include "core/curve_key.h"

namespace surfeit {
namespace {

// The key along the Z curve through the same cells.
CurveKey mortonKey(CurveKey hilbert_key) {
  std::array<std::uint32_t, 3> cell;
  curveCell(hilbert_key, cell[0], cell[1], cell[2]);
  CurveKey key = 0;
  for (int bit = kCurveLevels - 1; bit >= 0; --bit) {
    for (const std::uint32_t axis : cell) key = key << 1 | (axis >> bit & 1);
  }
  return key;
}

CurveKey keyOf(const glm::vec3& position, std::uint64_t index, ReceiverOrder order,
               const RootCube& cube) {
  switch (order) {
    case ReceiverOrder::kInput:
      return index;
    case ReceiverOrder::kMorton:
      return mortonKey(curveKey(position, cube));
    case ReceiverOrder::kHilbert:
      break;
  }
  return curveKey(position, cube);
}

}  // namespace

Result<GatherInput> GatherInput::open(const std::string& path, const std::string& channels,
                                      const std::string& part, const std::string& filter,
                                      std::optional<ColorRange> color_range) {
  RowReaderOptions reading;
  SURFEIT_ASSIGN_OR_RETURN(reading.channels, parseChannelRenames(channels));
  reading.part = part;
  reading.filter = filter;
  reading.color_range = color_range;
  SURFEIT_ASSIGN_OR_RETURN(std::unique_ptr<RowReader> reader, openRowReader(path, reading));
  SURFEIT_ASSIGN_OR_RETURN(ReceiverMapping mapping,
                           ReceiverMapping::create(reader->element(), path));
  return GatherInput(std::move(reader), std::move(mapping));
}

GatherInput::GatherInput(std::unique_ptr<RowReader> reader, ReceiverMapping mapping)
    : reader_(std::move(reader)), mapping_(std::move(mapping)), rows_hash_(XXH3_createState()) {
  if (rows_hash_ == nullptr) throw std::bad_alloc();
  XXH3_64bits_reset(rows_hash_.get());
}

Status GatherInput::rewind() {
  XXH3_64bits_reset(rows_hash_.get());
  blocks_.checksums.clear();
  row_ = 0;
  return reader_->rewind();
}

void GatherInput::endBlock() {
  blocks_.checksums.push_back(XXH3_64bits_digest(rows_hash_.get()));
  XXH3_64bits_reset(rows_hash_.get());
}

Status GatherInput::check(const GatherRules& rules) const {
  if (!rules.isGlossy()) return {};
  if (!mapping_.hasNormals()) {
    return Status::corruption(fmt::format(
        "{}: no normals (nx ny nz), expected some to reflect the view at", reader_->path()));
  }
  if (mapping_.hasViews() || glm::length(rules.eye) >= 0) return {};
  return Status::corruption(
      fmt::format("{}: no view directions (view_x view_y view_z), expected these, or the position "
                  "of a camera (--camera X,Y,Z)",
                  reader_->path()));
}

void GatherInput::note(Progress& progress) const {
  if (!mapping_.hasNormals()) {
    progress.note(fmt::format("{}: no normals: gathering over the whole sphere", reader_->path()));
  }
  for (const std::string& note :
       notesOfLookalikes(receivers(), {.normal = !mapping_.hasNormals()})) {
    progress.note(fmt::format("{}: {}", reader_->path(), note));
  }
  for (const std::string& note : reader_->notes()) {
    progress.note(fmt::format("{}: {}", reader_->path(), note));
  }
}

Result<Bytes> GatherInput::readSlice(Progress& progress) {
  if (progress.isCancelled()) return Status::interrupted();
  SURFEIT_ASSIGN_OR_RETURN(const Bytes slice, reader_->readRows(kSliceRows, slice_));
  const std::size_t count = slice.size() / receivers().row_bytes;
  if (count == 0) return slice;
  XXH3_64bits_update(rows_hash_.get(), slice.data(), slice.size());
  row_ += count;
  if (row_ % blockRows(receiverCount()) == 0 || row_ == receiverCount()) endBlock();
  return slice;
}

Result<std::uint64_t> GatherInput::skipBlock(const RowBlocks& known, std::uint64_t wanted) {
  const std::uint64_t rows = blockRows(receiverCount());
  const std::size_t block = blocks_.checksums.size();
  if (row_ % rows != 0 || block >= known.shards.size() || (known.shards[block] & wanted) != 0) {
    return std::uint64_t{0};
  }
  const std::uint64_t end = std::min(row_ + rows, receiverCount());
  SURFEIT_RETURN_IF_ERROR(reader_->seekRow(end));
  blocks_.checksums.push_back(known.checksums[block]);
  return end - std::exchange(row_, end);
}

Status GatherInput::sort(ReceiverOrder order, const SceneHeader& scene, bool strict,
                         ExternalSorter& sorter, Progress& progress, const OrderRange& range,
                         const RowBlocks* blocks, std::uint64_t wanted) {
  SURFEIT_RETURN_IF_ERROR(rewind());
  defects_ = {};
  mapping_.setOrigin(scene.origin);
  if (!reader_->isSeekable()) blocks = nullptr;
  for (;;) {
    if (blocks != nullptr) {
      SURFEIT_ASSIGN_OR_RETURN(const std::uint64_t skipped, skipBlock(*blocks, wanted));
      progress.advance(skipped);
      if (skipped > 0) continue;
    }
    std::uint64_t record = row_;
    SURFEIT_ASSIGN_OR_RETURN(const Bytes slice, readSlice(progress));
    const std::size_t count = slice.size() / receivers().row_bytes;
    if (count == 0) return sorter.finish();
    for (std::size_t i = 0; i < count; ++i, ++record) {
      const std::byte* row = slice.data() + i * receivers().row_bytes;
      SortedReceiver receiver;
      if (mapping_.decode(row, record, receiver.receiver, defects_)) {
        receiver.index = record;
        receiver.key = keyOf(receiver.receiver.position, record, order, scene.cube);
        if (range.contains({receiver.key, record})) {
          SURFEIT_RETURN_IF_ERROR(sorter.add(receiver));
        }
      } else if (strict) {
        return Status::corruption(fmt::format("{}: record {}: {}", reader_->path(), record,
                                              mapping_.describeDefect(row)));
      }
    }
    progress.advance(count);
  }
}

Status GatherInput::write(const ResultRows& rows, ResultStore& results, RowWriter& writer,
                          Progress& progress) {
  SURFEIT_RETURN_IF_ERROR(rewind());
  std::vector<GatherResult> slice_results;
  std::vector<std::byte> output(kSliceRows * rows.rowBytes());
  for (;;) {
    SURFEIT_ASSIGN_OR_RETURN(const Bytes slice, readSlice(progress));
    const std::size_t count = slice.size() / receivers().row_bytes;
    if (count == 0) return {};
    slice_results.resize(count);
    SURFEIT_RETURN_IF_ERROR(results.take(slice_results));
    for (std::size_t i = 0; i < count; ++i) {
      rows.make(slice.data() + i * receivers().row_bytes, slice_results[i],
                output.data() + i * rows.rowBytes());
    }
    SURFEIT_RETURN_IF_ERROR(writer.writeRows({output.data(), count * rows.rowBytes()}));
    progress.advance(count);
  }
}

}  // namespace surfeit
