// Compression of pages: the front of the payload as one zstd frame, the rest as it is. There is no
// zstd checksum: every page has its XXH3 (storage/page_file.h).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "storage/file.h"
#include "surfeit/status.h"

namespace surfeit {

// Bytes of a stored page (docs/format.md, "Container"): no frame is shorter, and what cannot be
// compressed grows by no more than this beside a 256th.
inline constexpr std::uint64_t kLeastStoredBytes = 9;
inline constexpr std::uint64_t kStoredSurplus = 64;
std::uint64_t mostStoredBytes(std::uint64_t payload_bytes);

// Compresses the first `packed_bytes` of `payload` into `stored` (replaced); what follows looks
// like noise and is appended. Safe from any thread.
Status compressPage(Bytes payload, std::size_t packed_bytes, std::vector<std::byte>& stored);

// Compresses all of it.
inline Status compressPage(Bytes payload, std::vector<std::byte>& stored) {
  return compressPage(payload, payload.size(), stored);
}

// Decompresses into exactly payload.size() bytes. Safe on arbitrary bytes and from any thread.
// kCorruption says what was wrong, without naming the file.
Status decompressPage(Bytes stored, std::span<std::byte> payload);

}  // namespace surfeit
