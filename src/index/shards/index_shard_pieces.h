// The file of a distributed shard: for every range of the curve a piece, which holds the range's
// surfels in packed blocks.
//
//   payload: [ piece of range 0 | ... | pieces : 32 each | counts : 24 each ]
//   piece:   [ packed bytes and surfels of every block : 8 each | blocks ]
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "index/shards/index_shard_file.h"
#include "index/shards/index_shard_ranges.h"
#include "surfeit/surfel.h"

namespace surfeit {

struct ShardPiece {
  std::uint64_t offset = 0, bytes = 0, blocks = 0, surfels = 0;
};
struct PieceBlock {
  std::uint32_t bytes = 0, surfels = 0;
};

// The tables behind the pieces, and their facts.
Status appendTables(std::span<const ShardPiece> pieces, std::span<const RangeCount> counts,
                    IndexShardWriter& writer, nlohmann::json& facts);

struct PieceTables {
  std::vector<ShardPiece> pieces;
  std::vector<RangeCount> counts;
};
// kCorruption unless there are as many as expected, under their checksum.
Result<PieceTables> readTables(const IndexShardReader& reader, std::size_t ranges,
                               std::size_t counts);

// Hands the surfels of a piece to `take`, from several threads at once; about `read_bytes` are read
// at a time. kCorruption for bytes that are not what was packed.
using SurfelTaker = std::function<Status(std::span<const Surfel>)>;
Status readPiece(const IndexShardReader& reader, const ShardPiece& piece, std::size_t read_bytes,
                 const SurfelTaker& take, Progress& progress);

}  // namespace surfeit
