// Options that gathering and its tuning share.
#pragma once

#include <CLI/CLI.hpp>

#include "surfeit/gather.h"

namespace surfeit {

// Adds everything that says what is gathered and how pages are read: mode, quality, order of the
// receivers, caches. Parsing fills `options`, which must outlive `command`; threads and memory are
// left to the program's own options.
void addGatherOptions(CLI::App& command, GatherOptions& options);

// "occlusion" or "bleeding"
const char* modeName(GatherMode mode);

}  // namespace surfeit
