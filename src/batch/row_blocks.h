// The rows of receivers in blocks: a shard reads the blocks that hold some of its receivers alone.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace surfeit {

struct RowBlocks {
  std::vector<std::uint64_t> checksums;  // of the bytes of each block's rows
  std::vector<std::uint64_t> shards;     // that have receivers in it (shardBits); empty: unknown

  // Of all rows.
  std::uint64_t checksum() const;
};

// Rows of a block, of so many in all: a multiple of kSliceRows. The last block may have fewer.
std::uint64_t blockRows(std::uint64_t rows);
std::size_t blockCount(std::uint64_t rows);

// Bits of shards first to last (from 1 on) of `count`; where there are many, several have the same.
std::uint64_t shardBits(int first, int last, int count);

}  // namespace surfeit
