// The headers of an OpenEXR file, read with doubt. OpenEXR allocates by what they say, so what they
// say is held against the size of the file first.
#pragma once

#include <OpenEXR/ImfForward.h>

#include <cstdint>
#include <string>
#include <vector>

#include "cloud/exr/exr_stream.h"
#include "surfeit/status.h"

namespace surfeit {

// All headers together may take this.
inline constexpr std::uint64_t kMaxExrHeaderBytes = 16 << 20;

// The headers of all parts. When it succeeds, OpenEXR may open the file: attributes end within it,
// and it has room for the offset tables of all parts. kCorruption otherwise, also for a flat part
// with more pixels than its compression can put into a file of this size.
// The stream is behind them then.
Result<std::vector<Imf::Header>> readExrHeaders(ExrInputStream& stream);

// How many blocks of scan lines or tiles a part has, those of its smaller levels too.
std::uint64_t exrChunkCount(const Imf::Header& header);
// Bytes behind the pixels of a file whose headers those are; 0 when its offset tables were never
// completed. Takes the stream anywhere; may throw what OpenEXR throws.
std::uint64_t exrBytesBehind(ExrInputStream& stream, const std::vector<Imf::Header>& headers);

// Whether pixels hold lists of samples. All parts that readExrHeaders returns have a type.
bool isDeepExr(const Imf::Header& header);
// The part's name for people, "" when it has none.
std::string exrPartName(const Imf::Header& header);
// Whether what decodes together, a block of scan lines or a row of tiles, takes `most_bytes` at
// most; kInvalidArgument says how to save it instead. `tile_pixel_bytes` more are counted for a
// pixel of tiles, of which OpenEXR keeps rows as they are asked for.
Status checkExrBlocks(const Imf::Header& header, std::uint64_t most_bytes,
                      std::size_t tile_pixel_bytes, const std::string& path);

}  // namespace surfeit
