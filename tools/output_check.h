// Looks at what a command is to write, before it works: an output that is an input as well, or that
// cannot be written, costs no time and no file.
#pragma once

#include <CLI/CLI.hpp>

#include "surfeit/status.h"

namespace surfeit {

// Whether an option names a file that the command writes: --output, --passes,
// --caustic-photons, --plot, --stats or --cache-series.
bool isOutputOption(const CLI::Option& option);

// The files that a value of an option may name: FILE, NAME=FILE, or "trajectory FILE".
std::vector<std::string> filesIn(const std::string& value);

// Of a parsed command: all options but those of its outputs may name inputs, also behind another
// word (NAME=FILE, "trajectory FILE"); a mesh names its materials, and they their pictures.
// kInvalidArgument when an output is the same file as an input, by whatever name, or as another
// output, or is a directory; kIoError when it cannot be written. `works_in_place`: the file of
// --output may be one of the inputs given by position.
Status checkOutputs(const CLI::App& command, bool works_in_place);

}  // namespace surfeit
