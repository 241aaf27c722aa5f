// Rows in memory until all have come: what an OpenVDB tree is sorted from.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cloud/rows/row_writer.h"
#include "surfeit/status.h"

namespace surfeit {

// One thread at a time. Takes the bytes of the rows and `extra_bytes` for each of them, which its
// user will need.
class VdbHeldRows {
 public:
  VdbHeldRows(std::string path, std::size_t row_bytes, std::size_t extra_bytes,
              const RowWriterOptions& options);

  // kBudgetTooSmall when `count` rows need more memory than there may be, with the budget that
  // would do.
  Status checkRoom(std::uint64_t count) const;
  // Appends whole rows; kBudgetTooSmall as above, kInvalidArgument for parts of rows.
  Status append(std::span<const std::byte> rows);

  std::uint64_t count() const { return count_; }
  const std::byte* row(std::uint64_t index) const {
    return chunks_[index / kChunkRows].get() + index % kChunkRows * row_bytes_;
  }

 private:
  static constexpr std::uint64_t kChunkRows = 16384;

  std::string path_;
  std::size_t row_bytes_, extra_bytes_;
  std::uint64_t memory_bytes_, memory_parts_, memory_beside_bytes_, count_ = 0;
  std::vector<std::unique_ptr<std::byte[]>> chunks_;
};

}  // namespace surfeit
