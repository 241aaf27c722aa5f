#include "index/shards/index_shard_pieces.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/first_failure.h"
#include "core/parallel.h"
#include "core/thread_scratch.h"
#include "octree/build/surfel_block.h"

namespace surfeit {
namespace {

constexpr std::uint32_t kMostBlockSurfels = 1 << 16;

std::uint64_t tablesChecksum(const std::vector<ShardPiece>& pieces,
                             const std::vector<RangeCount>& counts) {
  const std::uint64_t checksums[] = {checksumOf(std::as_bytes(std::span(pieces))),
                                     checksumOf(std::as_bytes(std::span(counts)))};
  return checksumOf(std::as_bytes(std::span(checksums)));
}

Status pieceError(const IndexShardReader& reader, std::uint64_t offset, const std::string& what) {
  return Status::corruption(fmt::format("{}: surfels at {}: {}", reader.path(), offset, what));
}

}  // namespace

Status appendTables(std::span<const ShardPiece> pieces, std::span<const RangeCount> counts,
                    IndexShardWriter& writer, nlohmann::json& facts) {
  facts["tables_offset"] = writer.payloadBytes();
  facts["tables_checksum"] =
      tablesChecksum({pieces.begin(), pieces.end()}, {counts.begin(), counts.end()});
  SURFEIT_RETURN_IF_ERROR(writer.append(std::as_bytes(pieces)));
  return writer.append(std::as_bytes(counts));
}

Result<PieceTables> readTables(const IndexShardReader& reader, std::size_t ranges,
                               std::size_t counts) {
  PieceTables tables;
  tables.pieces.resize(ranges);
  tables.counts.resize(counts);
  const auto offset = reader.facts().value("tables_offset", std::uint64_t{0});
  SURFEIT_RETURN_IF_ERROR(reader.readAt(offset, std::as_writable_bytes(std::span(tables.pieces))));
  SURFEIT_RETURN_IF_ERROR(reader.readAt(offset + ranges * sizeof(ShardPiece),
                                        std::as_writable_bytes(std::span(tables.counts))));
  const std::uint64_t found = tablesChecksum(tables.pieces, tables.counts);
  const auto expected = reader.facts().value("tables_checksum", std::uint64_t{0});
  if (found == expected) return tables;
  return Status::corruption(fmt::format("{}: tables at {}: checksum {:016x}, expected {:016x}",
                                        reader.path(), offset, found, expected));
}

Status readPiece(const IndexShardReader& reader, const ShardPiece& piece, std::size_t read_bytes,
                 const SurfelTaker& take, Progress& progress) {
  if (piece.blocks > piece.bytes / sizeof(PieceBlock)) {
    return pieceError(reader, piece.offset, fmt::format("{} blocks", piece.blocks));
  }
  std::vector<PieceBlock> blocks(static_cast<std::size_t>(piece.blocks));
  SURFEIT_RETURN_IF_ERROR(reader.readAt(piece.offset, std::as_writable_bytes(std::span(blocks))));
  std::uint64_t at = piece.offset + blocks.size() * sizeof(PieceBlock);
  std::vector<std::byte> bytes;
  for (std::size_t begin = 0, end = 0; begin < blocks.size(); begin = end) {
    if (progress.isCancelled()) return Status::interrupted();
    // As many blocks as fit, and at least one
    std::vector<std::size_t> offsets;
    std::size_t size = 0;
    while (end < blocks.size() && (end == begin || size + blocks[end].bytes <= read_bytes)) {
      if (blocks[end].surfels > kMostBlockSurfels ||
          blocks[end].bytes > maxPackedBytes(blocks[end].surfels)) {
        return pieceError(reader, at + size, fmt::format("block of {} bytes", blocks[end].bytes));
      }
      offsets.push_back(size);
      size += blocks[end++].bytes;
    }
    bytes.resize(size);
    SURFEIT_RETURN_IF_ERROR(reader.readAt(at, bytes));
    FirstFailure failure;
    parallelFor(offsets.size(), [&](std::size_t i) {
      if (failure.happened()) return;
      const PieceBlock& block = blocks[begin + i];
      std::vector<Surfel>& surfels = threadScratch<std::vector<Surfel>>([] {});
      surfels.resize(block.surfels);
      const Status status = unpackSurfels(Bytes(bytes).subspan(offsets[i], block.bytes), surfels);
      failure.note(
          status.ok() ? take(surfels) : pieceError(reader, at + offsets[i], status.message()), i);
      progress.advance(block.surfels);
    });
    SURFEIT_RETURN_IF_ERROR(failure.status());
    at += size;
  }
  return {};
}

}  // namespace surfeit
