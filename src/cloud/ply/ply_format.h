// The PLY header: element and property declarations, shared by reader and writer.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "cloud/rows/ply_encoding.h"
#include "cloud/rows/row_layout.h"
#include "storage/byte_input.h"
#include "surfeit/status.h"

namespace surfeit {

struct PlyHeader {
  PlyEncoding encoding = PlyEncoding::kBinaryLittleEndian;
  std::vector<std::string> comments;
  std::vector<RowLayout> elements;
  std::uint64_t data_offset = 0;  // first byte after "end_header\n"

  // Index of the element of that name, or nothing.
  std::optional<std::size_t> findElement(std::string_view element) const;
};

// Index of the element that holds surfels or receivers: the first of vertex, point, points, surfel.
// kCorruption when there is none.
Result<std::size_t> findSurfelElement(const PlyHeader& header, const std::string& path);

// The longest header that is read; real ones stay far below a page of text.
inline constexpr std::size_t kMaxPlyHeaderBytes = 1 << 20;

// Parses the header at the start of a file. `path` only names the file in messages; kCorruption
// messages name the line, what was found and what was expected. `text` holds the first bytes of
// the file, at least up to the end of the header; nothing is allocated from declared counts.
// Element names are unique, and so are the property names of an element; an element that has rows
// has properties. "obj_info" lines are dropped, and so are comments without text.
Result<PlyHeader> parsePlyHeader(std::string_view text, const std::string& path);
// The same from the file itself.
Result<PlyHeader> readPlyHeader(ByteInput& file);

// The header as it stands in a file, up to and including "end_header\n". Line ends in comments
// become spaces.
std::string formatPlyHeader(const PlyHeader& header);

// Whether the values of a binary file stand in the other byte order than this machine's.
bool needsByteSwap(PlyEncoding encoding);
}  // namespace surfeit
