// Numbers that files have where there is no value: -9999, -32768, 1e30, the lowest float.
#pragma once

#include <string>

#include "cloud/rows/row_reader.h"
#include "surfeit/status.h"

namespace surfeit {

// One sentence for such numbers, with the properties that have them, how many records, and the
// filter that leaves these out; empty where there are none. A number counts where it lies off all
// others of its property: farther than these lie apart, or below 0 where none of these does; so do
// places at 0 0 0. Looks at rows (a sample of the cloud; all of one that cannot be sought in) and
// goes back to the first.
Result<std::string> noteOfNoData(RowReader& reader);

}  // namespace surfeit
