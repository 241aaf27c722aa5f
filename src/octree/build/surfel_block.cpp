// A packed block:
//
//   [ checksum : 8 | count : 4 | widths : 17 x 1 | shared : 17 x 4 | rows | 4 zeros ]
//
// A surfel is 17 words of 32 bits. Word w of a row takes widths[w] bytes, its low ones; the high
// ones are those of shared[w]. The zeros let the last word be read as four bytes.
#include "octree/build/surfel_block.h"

#include <fmt/format.h>
#include <xxhash.h>

#include <array>
#include <bit>
#include <cstring>

namespace surfeit {
namespace {

constexpr std::size_t kWords = sizeof(Surfel) / 4;
constexpr std::size_t kCountOffset = 8;
constexpr std::size_t kWidthsOffset = 12;
constexpr std::size_t kSharedOffset = kWidthsOffset + kWords;
constexpr std::size_t kRowsOffset = kSharedOffset + 4 * kWords;
constexpr std::size_t kPaddingBytes = 4;

using Row = std::array<std::uint32_t, kWords>;

// A word that differs between the surfels of a block.
struct Column {
  std::uint32_t word = 0;
  std::uint32_t width = 0;
  std::uint32_t mask = 0;
};

// The words with a width, and the bytes of a row.
struct Layout {
  std::array<Column, kWords> columns;
  std::size_t column_count = 0;
  std::size_t row_bytes = 0;

  explicit Layout(const std::uint8_t* widths) {
    for (std::uint32_t w = 0; w < kWords; ++w) {
      const std::uint32_t width = widths[w];
      if (width == 0) continue;
      columns[column_count++] = {w, width, width == 4 ? ~0u : (1u << 8 * width) - 1};
      row_bytes += width;
    }
  }
};

Row loadRow(const Surfel& surfel) {
  Row row;
  std::memcpy(row.data(), &surfel, sizeof row);
  return row;
}

std::uint64_t checksumOf(Bytes packed) {
  return XXH3_64bits(packed.data() + kCountOffset, packed.size() - kCountOffset);
}

}  // namespace

void packSurfels(std::span<const Surfel> surfels, std::vector<std::byte>& packed) {
  // The bits in which the surfels differ, word by word
  const Row first = surfels.empty() ? Row() : loadRow(surfels.front());
  Row differing{};
  for (const Surfel& surfel : surfels) {
    const Row row = loadRow(surfel);
    for (std::size_t w = 0; w < kWords; ++w) differing[w] |= row[w] ^ first[w];
  }
  std::uint8_t widths[kWords];
  for (std::size_t w = 0; w < kWords; ++w) {
    widths[w] = static_cast<std::uint8_t>((std::bit_width(differing[w]) + 7) / 8);
  }

  const Layout layout(widths);
  packed.resize(kRowsOffset + surfels.size() * layout.row_bytes + kPaddingBytes);
  const std::uint32_t count = static_cast<std::uint32_t>(surfels.size());
  std::memcpy(&packed[kCountOffset], &count, sizeof count);
  std::memcpy(&packed[kWidthsOffset], widths, sizeof widths);
  std::memcpy(&packed[kSharedOffset], first.data(), sizeof first);
  // Every word is stored whole; the next one overwrites what it has too much
  std::byte* out = packed.data() + kRowsOffset;
  for (const Surfel& surfel : surfels) {
    const Row row = loadRow(surfel);
    for (std::size_t c = 0; c < layout.column_count; ++c) {
      std::memcpy(out, &row[layout.columns[c].word], 4);
      out += layout.columns[c].width;
    }
  }
  std::memset(out, 0, kPaddingBytes);
  const std::uint64_t checksum = checksumOf(packed);
  std::memcpy(packed.data(), &checksum, sizeof checksum);
}

std::uint32_t packedCount(Bytes packed) {
  std::uint32_t count = 0;
  std::memcpy(&count, packed.data() + kCountOffset, sizeof count);
  return count;
}

Status unpackSurfels(Bytes packed, std::span<Surfel> surfels) {
  std::uint64_t checksum = 0;
  if (packed.size() >= kRowsOffset) std::memcpy(&checksum, packed.data(), sizeof checksum);
  if (packed.size() < kRowsOffset || checksum != checksumOf(packed)) {
    return Status::corruption(
        fmt::format("block of {} surfels: checksum mismatch", surfels.size()));
  }
  std::uint8_t widths[kWords];
  std::memcpy(widths, &packed[kWidthsOffset], sizeof widths);
  const Layout layout(widths);
  if (packedCount(packed) != surfels.size() ||
      packed.size() != kRowsOffset + surfels.size() * layout.row_bytes + kPaddingBytes) {
    return Status::corruption(fmt::format("block of {} surfels in {} bytes, expected {} surfels",
                                          packedCount(packed), packed.size(), surfels.size()));
  }
  Row row;
  std::memcpy(row.data(), &packed[kSharedOffset], sizeof row);
  Row shared = row;
  for (std::size_t c = 0; c < layout.column_count; ++c) {
    shared[layout.columns[c].word] &= ~layout.columns[c].mask;
  }
  const std::byte* in = packed.data() + kRowsOffset;
  for (Surfel& surfel : surfels) {
    for (std::size_t c = 0; c < layout.column_count; ++c) {
      const Column& column = layout.columns[c];
      std::uint32_t word;
      std::memcpy(&word, in, 4);
      row[column.word] = shared[column.word] | (word & column.mask);
      in += column.width;
    }
    std::memcpy(static_cast<void*>(&surfel), row.data(), sizeof surfel);
  }
  return {};
}

}  // namespace surfeit
