// PDB, the particles of Maya and Houdini, in the layout of 32-bit machines, attribute by attribute:
//
//   header, 60 bytes:  magic i32, 670 | u16 1 | 2 bytes | version f32 | time f32 | particles u32
//                      | attributes u32 | 36 bytes
//   attribute: 10 bytes | type u32 | 4 bytes | first particle u32 | last particle u32 | 16 bytes
//              | name, ending with 0 | type u32 | bytes per particle u32 | particles per block u32
//              | blocks u32 | 4 bytes | values
//
// in either byte order. Types: 1 vector (three float32), 2 real (float32, of which there may be
// several), 3 integer (int32). The bytes that have no name are what programs had in their memory
// (pointers), and are not looked at. Characters and pointers (types 4, 5) are not read, nor files
// whose attributes come in several blocks.
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "cloud/rows/row_reader.h"
#include "cloud/rows/row_reader_options.h"
#include "surfeit/status.h"

namespace surfeit {

bool recognisesPdb(std::string_view first_bytes);

// Rows, one per particle, one thread at a time. Seekable; a compressed file is decompressed to a
// temporary one first.
Result<std::unique_ptr<RowReader>> openPdb(const std::string& path,
                                           const RowReaderOptions& options);

}  // namespace surfeit
