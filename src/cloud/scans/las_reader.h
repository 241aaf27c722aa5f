// Reads LAS, the format of laser scans (ASPRS): versions 1.0 to 1.5, point formats 0 to 10, not
// compressed.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cloud/rows/row_reader.h"
#include "cloud/rows/row_reader_options.h"
#include "cloud/scans/las_format.h"

namespace surfeit {

// Also LAZ, its compressed form, so that openLas can say what to do.
bool recognisesLas(std::string_view first_bytes);

// Rows have x y z as doubles, scaled and moved as the header says, since coordinates of maps need
// more than a float; then all that a point has (docs/files.md, "Laser scans"), extra bytes under
// the names that the file gives them. Colors are ushort, as they stand. exclusions() are withheld
// points and noise. Comments tell of the coordinate reference system. LAZ is kCorruption.
Result<std::unique_ptr<RowReader>> openLas(const std::string& path,
                                           const RowReaderOptions& options);

// The header of a reader of LAS, which lives as long as it; nullptr for any other.
const LasHeader* lasHeaderOf(const RowReader* reader);

// What the values of a field are called in rows (cloud/rows/channels.h).
std::vector<std::string> lasPropertyNames(const LasField& field,
                                          std::span<const ChannelRename> renames);

}  // namespace surfeit
