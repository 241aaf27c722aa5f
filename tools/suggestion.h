// The nearest option or command to a mistyped one.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace surfeit {

// "; did you mean --memory?" for the first word that is no command, option or value of `app`; empty
// when nothing is close.
std::string suggestOption(const CLI::App& app, const std::vector<std::string>& words);

}  // namespace surfeit
