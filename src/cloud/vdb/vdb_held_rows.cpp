#include "cloud/vdb/vdb_held_rows.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <new>

namespace surfeit {

VdbHeldRows::VdbHeldRows(std::string path, std::size_t row_bytes, std::size_t extra_bytes,
                         const RowWriterOptions& options)
    : path_(std::move(path)),
      row_bytes_(row_bytes),
      extra_bytes_(extra_bytes),
      memory_bytes_(options.memory_bytes),
      memory_parts_(options.memory_parts),
      memory_beside_bytes_(options.memory_beside_bytes) {}

Status VdbHeldRows::checkRoom(std::uint64_t count) const {
  const std::uint64_t per_row = row_bytes_ + extra_bytes_;
  if (count <= memory_bytes_ / per_row) return {};
  const double needed = double(count) * double(per_row);  // a file may claim any count
  const double budget = needed * double(memory_parts_) + double(memory_beside_bytes_);
  return Status::budgetTooSmall(fmt::format(
      "{}: OpenVDB files are sorted in memory: {} rows need {:.0f} MiB, {} MiB may be taken: a "
      "memory budget of {:.0f} MiB would do",
      path_, count, std::ceil(needed / (1 << 20)), memory_bytes_ >> 20,
      std::floor(budget / (1 << 20)) + 1));
}

Status VdbHeldRows::append(std::span<const std::byte> rows) {
  if (rows.size() % row_bytes_ != 0) {
    return Status::invalidArgument(
        fmt::format("{}: {} bytes are no whole rows of {}", path_, rows.size(), row_bytes_));
  }
  std::uint64_t left = rows.size() / row_bytes_;
  SURFEIT_RETURN_IF_ERROR(checkRoom(count_ + left));
  const std::byte* next = rows.data();
  while (left > 0) {
    const std::uint64_t filled = count_ % kChunkRows;
    if (filled == 0) {
      std::unique_ptr<std::byte[]> chunk(new (std::nothrow) std::byte[kChunkRows * row_bytes_]);
      if (chunk == nullptr) return Status::failed(fmt::format("{}: out of memory", path_));
      chunks_.push_back(std::move(chunk));
    }
    const std::uint64_t part = std::min(left, kChunkRows - filled);
    std::memcpy(chunks_.back().get() + filled * row_bytes_, next, part * row_bytes_);
    next += part * row_bytes_;
    count_ += part;
    left -= part;
  }
  return {};
}

}  // namespace surfeit
