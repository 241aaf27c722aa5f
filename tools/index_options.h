// Options that say which scene an index makes, of which clouds; `index` and `plan --index` share
// them.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "surfeit/index.h"
#include "surfeit/status.h"
#include "tools/command.h"

namespace surfeit {

struct IndexSettings {
  std::vector<std::string> inputs;
  std::string output;
  std::string precision = "quantized";
  std::string normals = "none";
  std::string cube_like;
  NormalEstimation estimation;
  IndexOptions options;
};

// Adds the clouds, -o and all options that describe the scene. Parsing fills `settings`, which must
// outlive `command`; the options are complete after completeIndexOptions.
void addIndexOptions(CLI::App& command, IndexSettings& settings);

// Takes over what the command line says of the cube, normals, precision, threads and memory.
// Errors: those of reading the scene of --cube.
Status completeIndexOptions(IndexSettings& settings, const CommonOptions& common);

}  // namespace surfeit
