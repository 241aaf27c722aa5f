// Comments in formats that have no place for them.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace surfeit {

// What is to be told of comments that are not kept, but for that of the axis that is up: names of
// object groups, and the coordinate reference system, unless the format keeps it.
std::vector<std::string> notesOfLostComments(std::string_view format,
                                             std::span<const std::string> comments,
                                             bool keeps_crs = false);

}  // namespace surfeit
