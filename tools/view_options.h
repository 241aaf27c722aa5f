// Options of `surfeit view` and `surfeit composite`.
#pragma once

#include <CLI/CLI.hpp>

#include "surfeit/composite.h"
#include "surfeit/view.h"

namespace surfeit {

// Adds everything that says how the picture looks: camera, mode, channel, quality. Parsing fills
// `options`, which must outlive `app`; threads and memory are left to the program's own options.
// A malformed value is a usage error that names the option and what it expects.
void addViewOptions(CLI::App& app, ViewOptions& options);

// The same for what `surfeit composite` makes of a picture.
void addCompositeOptions(CLI::App& app, CompositeOptions& options);

}  // namespace surfeit
