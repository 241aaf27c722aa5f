// Surfels that a caller provides, as rows of a cloud: they are checked and filled in by the same
// rules as those of files.
#pragma once

#include <memory>

#include "cloud/rows/row_reader.h"
#include "surfeit/surfel_source.h"

namespace surfeit {

// `provider` must outlive the reader.
std::unique_ptr<RowReader> readProvidedSurfels(SurfelProvider& provider);

}  // namespace surfeit
