#include "tools/renderman_words.h"

#include <algorithm>
#include <cctype>
#include <string_view>

namespace surfeit {
namespace {

bool isOption(std::string_view word) {
  return word.size() > 1 && word[0] == '-' &&
         (word[1] == '-' || std::isalpha(static_cast<unsigned char>(word[1])) != 0);
}

bool namesOutput(std::string_view word) {
  return word == "-o" || word.starts_with("-o=") || word.starts_with("--output");
}

// -progress 0, 1 or 2 is a level there, and a style here.
void takeProgress(std::vector<std::string>& words) {
  for (std::size_t i = 0; i + 1 < words.size(); ++i) {
    if (words[i] != "--progress") continue;
    if (words[i + 1] == "0") words[i + 1] = "none";
    if (words[i + 1] == "1" || words[i + 1] == "2") words[i + 1] = "percent";
  }
}

}  // namespace

std::vector<std::string> wordsOf(int argc, const char* const* argv) {
  std::vector<std::string> words(argv + 1, argv + argc);
  if (words.empty() || (words[0] != "ptfilter" && words[0] != "brickmake")) return words;
  const bool has_output = std::any_of(words.begin(), words.end(), namesOutput);
  for (std::string& word : words) {
    if (isOption(word) && word[1] != '-' && word.size() > 2 && word[2] != '=') word = "-" + word;
  }
  takeProgress(words);
  if (!has_output && words.size() > 2 && !isOption(words.back())) {
    words.insert(words.end() - 1, "--output");
  }
  return words;
}

}  // namespace surfeit
