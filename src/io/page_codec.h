// Compression of pages: one zstd frame per page, without zstd's own checksum (every page has its
// XXH3, io/page_file.h).
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "io/file.h"
#include "surfeit/status.h"

namespace surfeit {

// Compresses `payload` into `stored` (replaced). Safe from any thread.
Status compressPage(Bytes payload, std::vector<std::byte>& stored);

// Decompresses into exactly payload.size() bytes. Safe on arbitrary bytes and from any thread.
// kCorruption says what was wrong, without naming the file.
Status decompressPage(Bytes stored, std::span<std::byte> payload);

}  // namespace surfeit
