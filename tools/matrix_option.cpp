#include "tools/matrix_option.h"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <string_view>

#include "tools/number_list.h"

namespace surfeit {
namespace {

// More than any 16 numbers take.
constexpr std::size_t kMostText = 4096;

// What a file holds, in one line; the text itself where it is no name of a file.
std::string textOf(const std::string& text) {
  if (text.find_first_not_of("+-.0123456789eE, \t") == std::string::npos) return text;
  std::ifstream file(text);
  if (!file) return text;
  std::string content(kMostText, ' ');
  file.read(content.data(), static_cast<std::streamsize>(content.size()));
  content.resize(static_cast<std::size_t>(file.gcount()));
  for (char& c : content) {
    if (c == '\n' || c == '\r' || c == '[' || c == ']') c = ' ';
  }
  return content;
}

}  // namespace

OptionMatrix parseMatrix(const std::string& option, const std::string& given) {
  constexpr const char* kExpected = "12 or 16 numbers, the matrix row by row, or a file of these";
  const std::string text = textOf(given);
  const std::string_view separators = " ,\t";
  std::size_t words = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const bool begins = i == 0 || separators.find(text[i - 1]) != std::string_view::npos;
    words += begins && separators.find(text[i]) == std::string_view::npos ? 1 : 0;
  }
  if (words <= 12) return parseNumberList<12>(option, text, kExpected);
  const auto all = parseNumberList<16>(option, text, kExpected);
  if (all[12] != 0 || all[13] != 0 || all[14] != 0 || all[15] != 1) {
    throw CLI::ValidationError(
        option,
        fmt::format("found a last row {} {} {} {}, expected 0 0 0 1 (what moves stands in the last "
                    "column; transpose matrices that have it in the last row)",
                    all[12], all[13], all[14], all[15]));
  }
  OptionMatrix matrix;
  std::copy_n(all.begin(), matrix.size(), matrix.begin());
  return matrix;
}

}  // namespace surfeit
