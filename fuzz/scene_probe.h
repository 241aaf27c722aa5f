// Holds what reads scenes, their pages and the small languages of the program to its contract, on
// bytes from anywhere.
#pragma once

#include <string>

namespace surfeit {

// A scene whose checksums are made right first, so that what stands behind them is probed: verified
// from end to end, and told by info. (A gather would need the kernels, which take half an hour to
// compile with sanitizers; HostileScene of gather_test gathers in hostile scenes.)
void probeScene(const std::string& path);

// Payloads of pages: the first byte is the form, PageForm; the rest is decoded, and again with
// other radiosities.
void probeSurfelPage(const std::string& path);
void probeNodePage(const std::string& path);

// Recipes of generated scenes.
void probeRecipe(const std::string& path);

// Conditions of --filter.
void probeExpression(const std::string& path);

}  // namespace surfeit
