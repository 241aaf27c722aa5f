// --channels and --part, which say what of a cloud's file is read, and under which names.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace surfeit {

// The library parses `channels`: a text that is no list of FROM=TO is a usage error of its own.
void addChannelOptions(CLI::App& command, std::string& channels, std::string& part);

}  // namespace surfeit
