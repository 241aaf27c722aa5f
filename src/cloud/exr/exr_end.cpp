#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfPartType.h>
#include <OpenEXR/ImfVersion.h>

#include <algorithm>
#include <cstdint>

#include "cloud/exr/exr_header.h"

namespace surfeit {
namespace {

template <typename T>
T readLittleEndian(ExrInputStream& stream) {
  char bytes[sizeof(T)];
  stream.read(bytes, sizeof bytes);
  T value = 0;
  for (std::size_t i = 0; i < sizeof(T); ++i) {
    value = T(value | T(T(static_cast<unsigned char>(bytes[i])) << (8 * i)));
  }
  return value;
}

// Where the chunk at `offset` ends: part, place and size stand in front of its samples. Beyond the
// file where there is no room for those.
std::uint64_t endOfChunk(ExrInputStream& stream, const Imf::Header& header, std::uint64_t offset,
                         bool is_multi_part) {
  const bool has_tiles = header.hasType() && Imf::isTiled(header.type());
  const std::uint64_t size_at = offset + (is_multi_part ? 4 : 0) + (has_tiles ? 16 : 4);
  const std::uint64_t begin = size_at + (isDeepExr(header) ? 24 : 4);
  if (begin > stream.file().size()) return begin;
  stream.seekg(size_at);
  std::uint64_t bytes = 0;
  if (isDeepExr(header)) {
    bytes = readLittleEndian<std::uint64_t>(stream) + readLittleEndian<std::uint64_t>(stream);
  } else {
    bytes = readLittleEndian<std::uint32_t>(stream);
  }
  return begin + std::min(bytes, stream.file().size());
}

}  // namespace

std::uint64_t exrBytesBehind(ExrInputStream& stream, const std::vector<Imf::Header>& headers) {
  // An offset of 8 bytes for each chunk, part by part; chunks may stand in any order
  const std::uint64_t size = stream.file().size();
  std::uint64_t table = stream.tellg(), end = 0;
  stream.seekg(4);
  const bool is_multi_part = Imf::isMultiPart(readLittleEndian<std::int32_t>(stream));
  for (const Imf::Header& header : headers) {
    const std::uint64_t chunks = exrChunkCount(header);
    if (chunks > (size - std::min(size, table)) / 8) return 0;
    std::uint64_t last = 0;
    stream.seekg(table);
    for (std::uint64_t i = 0; i < chunks; ++i) {
      const auto offset = readLittleEndian<std::uint64_t>(stream);
      if (offset == 0 || offset >= size) return 0;
      last = std::max(last, offset);
    }
    table += 8 * chunks;
    end = std::max(end, table);
    if (last > 0) end = std::max(end, endOfChunk(stream, header, last, is_multi_part));
  }
  return end > size ? 0 : size - end;
}

}  // namespace surfeit
