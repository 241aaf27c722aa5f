// PRT 2, the particles of Sequoia and of later Krakatoas, SPRT files included:
//
//   [ magic 8 | revision u32, 3 | file chunks ]      file chunk = [ name 4 | length u64 | data ]
//   Chan: [ channels | per channel: name, type, bytes ]       the first chunk
//   Part: [ stream name | compression | particles u64 | particle chunks u64 | particle chunks ]
//     particle chunk = [ length u32 | particles u32 | data ]
//   Meta: [ name | type | value ]
//
// Numbers without a size are varints, 7 bits a byte, the low ones first; texts are a varint and so
// many bytes of UTF-8. A type is "float32" or "3 * float32". The data of a particle chunk are
// records, packed in the order of the channels: "uncompressed" as they stand, "transpose" byte 0 of
// all, then byte 1 of all, and so on, "zlib" and "transpose-zlib" the same as one zlib stream.
// Other chunks (indices, octrees) are passed over. Not read: "lz4", and the chunk PrtO, whose
// positions are relative to particle chunks.
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "cloud/rows/row_reader.h"
#include "cloud/rows/row_reader_options.h"
#include "surfeit/status.h"

namespace surfeit {

// The most bytes of records in a particle chunk, which is decoded as a whole; writers make about
// 2 MB.
inline constexpr std::size_t kMaxPrt2ChunkBytes = 64 << 20;

bool recognisesPrt2(std::string_view first_bytes);

// Rows of the stream called options.part, which is empty for the main one; other streams are
// subsets of it and told in notes. One thread at a time; takes as much memory as two particle
// chunks.
Result<std::unique_ptr<RowReader>> openPrt2(const std::string& path,
                                            const RowReaderOptions& options);

}  // namespace surfeit
