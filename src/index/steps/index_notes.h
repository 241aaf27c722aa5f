// What index tells of a cloud.
#pragma once

#include "index/steps/cloud_reader.h"
#include "surfeit/index.h"
#include "surfeit/progress.h"

namespace surfeit {

// Strays, and what they cost the others. `is_origin_asked`: the user may choose the origin.
void noteStrays(const CloudTotals& totals, const glm::dvec3& origin, bool is_origin_asked,
                Progress& progress);

// One note for each rule by which something was made up (docs/format.md, "Rules for what is
// missing"), and for coarse positions.
void noteIndexRules(const CloudTotals& totals, const CloudReader& reader,
                    const IndexOptions& options, Progress& progress);

// How many surfels lie on no surface, of those that got normals.
void noteScatteredSurfels(const IndexStats& stats, Progress& progress);
void noteThinSurfels(const IndexStats& stats, const IndexOptions& options, Progress& progress);

// How many surfels repeat another; nothing where none does.
void noteRepeats(const IndexStats& stats, const IndexOptions& options, Progress& progress);

}  // namespace surfeit
