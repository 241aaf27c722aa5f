// Options that say what a gather looks for: outputs, weights of directions, environment.
#pragma once

#include <CLI/CLI.hpp>

#include "surfeit/bake.h"

namespace surfeit {

// Parsing fills `options`, which must outlive `command`.
void addLightOptions(CLI::App& command, GatherOptions& options);

// A part of it: weights of directions, and falloff.
void addDirectionOptions(CLI::App& command, GatherOptions& options);

}  // namespace surfeit
