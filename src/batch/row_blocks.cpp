#include "batch/row_blocks.h"

#include <xxhash.h>

#include <algorithm>

#include "batch/gather_memory.h"

namespace surfeit {
namespace {

constexpr std::uint64_t kMostBlocks = 4096;
constexpr int kBits = 64;

}  // namespace

std::uint64_t RowBlocks::checksum() const {
  return XXH3_64bits(checksums.data(), checksums.size() * sizeof(std::uint64_t));
}

std::uint64_t blockRows(std::uint64_t rows) {
  const std::uint64_t slices = rows / kSliceRows + 1;
  return kSliceRows * ((slices + kMostBlocks - 1) / kMostBlocks);
}

std::size_t blockCount(std::uint64_t rows) {
  const std::uint64_t block = blockRows(rows);
  return static_cast<std::size_t>((rows + block - 1) / block);
}

std::uint64_t shardBits(int first, int last, int count) {
  const int groups = std::min(count, kBits);
  const auto groupOf = [&](int shard) {
    return static_cast<int>(std::int64_t{shard - 1} * groups / count);
  };
  std::uint64_t bits = 0;
  for (int group = groupOf(first); group <= groupOf(last); ++group)
    bits |= std::uint64_t{1} << group;
  return bits;
}

}  // namespace surfeit
