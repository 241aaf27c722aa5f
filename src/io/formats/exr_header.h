// The headers of an OpenEXR file, read with doubt. OpenEXR allocates by what they say, so what they
// say is held against the size of the file first.
#pragma once

#include <OpenEXR/ImfForward.h>

#include <cstdint>
#include <string>
#include <vector>

#include "io/formats/exr_stream.h"
#include "surfeit/status.h"

namespace surfeit {

// All headers together may take this.
inline constexpr std::uint64_t kMaxExrHeaderBytes = 16 << 20;
// What must be decoded at once, a block of scan lines or a row of tiles, may take this.
inline constexpr std::uint64_t kMaxExrBlockBytes = std::uint64_t{192} << 20;

// The headers of all parts. When it succeeds, OpenEXR may open the file: attributes end within it,
// and it has room for the offset tables of all parts. kCorruption otherwise, also for a flat part
// with more pixels than its compression can put into a file of this size.
Result<std::vector<Imf::Header>> readExrHeaders(ExrInputStream& stream);

// Whether the part is tiled, flat or deep. All parts that readExrHeaders returns have a type.
bool hasExrTiles(const Imf::Header& header);
// Whether pixels hold lists of samples.
bool isDeepExr(const Imf::Header& header);
// The part's name for people, "" when it has none.
std::string exrPartName(const Imf::Header& header);
// Rows that are decoded together.
std::uint64_t exrBlockRows(const Imf::Header& header);
// Whether the part decodes within kMaxExrBlockBytes; kInvalidArgument says how to save it instead.
Status checkExrBlocks(const Imf::Header& header, const std::string& path);

}  // namespace surfeit
