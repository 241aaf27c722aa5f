// Surfels on their way through the indexer: packed without loss into blocks that wait in memory or
// in a temporary file. A block lives within one run of the program; docs/format.md has nothing of
// it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "storage/file.h"
#include "surfeit/status.h"
#include "surfeit/surfel.h"

namespace surfeit {

// Most bytes that packSurfels makes of `count` surfels.
constexpr std::size_t maxPackedBytes(std::size_t count) { return count * sizeof(Surfel) + 128; }

// Packs surfels into `packed` (replaced). Of every property the high bytes that all surfels share
// are stored once, so that what a cloud does not have takes no room, and neighbours take less.
// Noise in normals and colors leaves zstd little: as pages have it, it would save 7 % and take 35
// ns per surfel, where packing takes 10 (bench/codec_bench).
void packSurfels(std::span<const Surfel> surfels, std::vector<std::byte>& packed);

// How many surfels a packed block holds, at its front.
std::uint32_t packedCount(Bytes packed);

// Unpacks into exactly surfels.size() surfels. kCorruption when the bytes are not what packSurfels
// wrote: they carry a checksum.
Status unpackSurfels(Bytes packed, std::span<Surfel> surfels);

}  // namespace surfeit
