// Reads Pixar's point clouds (cloud/particles/ptc_format.h).
#pragma once

#include <memory>
#include <string>

#include "cloud/particles/ptc_format.h"
#include "cloud/rows/row_reader.h"
#include "cloud/rows/row_reader_options.h"

namespace surfeit {

// Rows have P, N and radius of each record, then its variables, all as floats under the names of
// cloud/rows/channels.h; a name that is taken becomes name_2, name_3 and so on. Normals that say
// "none" are zero. Bytes behind the last record are left alone, and noted.
Result<std::unique_ptr<RowReader>> openPtc(const std::string& path,
                                           const RowReaderOptions& options);

// The camera of a cloud that openPtc opened; nullptr when it is of another format.
const PtcCamera* ptcCameraOf(const RowReader& reader);

}  // namespace surfeit
