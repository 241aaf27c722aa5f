// What index tells of a cloud.
#pragma once

#include "octree/cloud_reader.h"
#include "surfeit/progress.h"

namespace surfeit {

// One note for each rule by which something was made up (docs/format.md, "Rules for what is
// missing"), and for coarse positions.
void noteIndexRules(const CloudTotals& totals, const CloudReader& reader, float overlap,
                    Progress& progress);

}  // namespace surfeit
