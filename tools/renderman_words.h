// Command lines of RenderMan's ptfilter and brickmake as this program parses them.
#pragma once

#include <string>
#include <vector>

namespace surfeit {

// The words behind the program's name. `ptfilter` and `brickmake` have options with one dash and
// the output as the last word: "-maxdist 2 in.ptc out.ptc" becomes "--maxdist 2 in.ptc --output
// out.ptc". Words of other commands stay.
std::vector<std::string> wordsOf(int argc, const char* const* argv);

}  // namespace surfeit
