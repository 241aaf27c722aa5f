// The indexer, wherever surfels come from.
#pragma once

#include <string>
#include <vector>

#include "index/steps/cloud_reader.h"
#include "surfeit/index.h"

namespace surfeit {

// As indexClouds; `opener` opens the inputs, or is absent for files.
Result<IndexStats> indexFrom(const std::vector<std::string>& inputs, const SourceOpener& opener,
                             const std::string& output, const IndexOptions& options,
                             Progress& progress);

}  // namespace surfeit
