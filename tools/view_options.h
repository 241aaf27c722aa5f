// Options of `surfeit view`.
#pragma once

#include <CLI/CLI.hpp>

#include "view/view.h"

namespace surfeit {

// Adds everything that says how the picture looks: camera, mode, channel, quality. Parsing fills
// `options`, which must outlive `app`; threads and memory are left to the program's own options.
// A malformed value is a usage error that names the option and what it expects.
void addViewOptions(CLI::App& app, ViewOptions& options);

}  // namespace surfeit
