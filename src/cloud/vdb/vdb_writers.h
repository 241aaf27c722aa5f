// The two writers behind cloud/vdb/vdb_writer.h.
#pragma once

#include <memory>
#include <string>

#include "cloud/rows/row_writer.h"
#include "cloud/vdb/vdb_volume_reader.h"
#include "surfeit/status.h"

namespace surfeit {

// `element` holds the rows' properties, packed; with those that each kind of file needs.
Result<std::unique_ptr<RowWriter>> createVdbPoints(const std::string& path, RowLayout element,
                                                   const RowWriterOptions& options);
Result<std::unique_ptr<RowWriter>> createVdbVolumes(const std::string& path, RowLayout element,
                                                    const VdbVolumeReader& like,
                                                    const RowWriterOptions& options);

// Letters, digits and _ | : are what OpenVDB's names may have; others become _.
std::string vdbName(std::string_view name);

}  // namespace surfeit
