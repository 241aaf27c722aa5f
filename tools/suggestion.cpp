#include "tools/suggestion.h"

#include <algorithm>
#include <numeric>

namespace surfeit {
namespace {

// Levenshtein distance.
std::size_t editDistance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i + 1;
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({row[j] + 1, diagonal + 1, replaced});
    }
  }
  return row[b.size()];
}

// The closest name within a third of the word's length; empty when none is, or the word is known.
std::string nearest(const std::string& word, const std::vector<std::string>& names) {
  std::string best;
  std::size_t best_distance = std::max<std::size_t>(2, word.size() / 3) + 1;
  for (const std::string& name : names) {
    const std::size_t distance = editDistance(word, name);
    if (distance == 0) return {};
    if (distance < best_distance) {
      best = name;
      best_distance = distance;
    }
  }
  return best;
}

std::vector<std::string> optionNames(const CLI::App& command) {
  std::vector<std::string> names;
  for (const CLI::Option* option : command.get_options()) {
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  }
  return names;
}

}  // namespace

std::string suggestOption(const CLI::App& app, const std::vector<std::string>& words) {
  if (words.empty()) return "; surfeit --help lists the commands";
  std::vector<std::string> commands;
  const CLI::App* chosen = nullptr;
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) {
    commands.push_back(command->get_name());
    if (command->get_name() == words.front()) chosen = command;
  }
  if (chosen == nullptr) {
    const std::string command = nearest(words.front(), commands);
    return command.empty() ? "" : "; did you mean " + command + "?";
  }
  const std::vector<std::string> names = optionNames(*chosen);
  for (const std::string& word : words) {
    if (word.rfind("--", 0) != 0) continue;
    const std::string name = nearest(word.substr(0, word.find('=')), names);
    if (!name.empty()) return "; did you mean " + name + "?";
  }
  return "; surfeit " + chosen->get_name() + " --help lists its options";
}

}  // namespace surfeit
