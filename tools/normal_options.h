// --orient and --thin, of `normals` and `index --normals estimate`.
#pragma once

#include <CLI/CLI.hpp>

#include "surfeit/normal_estimation.h"

namespace surfeit {

// Parsing fills `estimation`, which must outlive `command`.
void addNormalOptions(CLI::App& command, NormalEstimation& estimation);

}  // namespace surfeit
