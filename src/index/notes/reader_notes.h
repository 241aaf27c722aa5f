// What is to be told of an input whose rows become no surfels.
#pragma once

#include "cloud/rows/row_reader.h"
#include "surfeit/progress.h"

namespace surfeit {

// Tells the notes of a reader at its first row, and of numbers that stand for no value, each with
// its path. Goes back to the first row.
void tellNotes(RowReader& reader, Progress& progress);

}  // namespace surfeit
