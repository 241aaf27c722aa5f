// What comments of a cloud say about its places that programs do not agree upon.
#pragma once

#include <span>
#include <string>
#include <vector>

namespace surfeit {

// One sentence for each comment that names a unit other than metres ("units: mm", or the well-known
// text of a coordinate reference system), or a shift of three numbers ("offset 500000 5400000 0"):
// neither is applied.
std::vector<std::string> notesOfComments(std::span<const std::string> comments);

}  // namespace surfeit
