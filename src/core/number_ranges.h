// Numbers as people and job schedulers write them.
#pragma once

#include <string>
#include <vector>

namespace surfeit {

// "2, 5, 7-9", of rising numbers; without blanks as job schedulers want them.
std::string numberRanges(const std::vector<int>& numbers, const char* separator = ", ");

}  // namespace surfeit
