#include "sample/meshes/obj_lines.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <span>
#include <utility>

#include "core/resident_limit.h"
#include "core/text_case.h"
#include "sample/meshes/mesh_builder.h"

namespace surfeit {
namespace {

constexpr std::size_t kReadBytes = 256 << 10;
constexpr std::size_t kLongestLine = 64 << 20;  // a face of millions of corners
constexpr std::string_view kBlanks = " \t\r\v\f";

std::string_view trimmed(std::string_view text) {
  const std::size_t begin = text.find_first_not_of(kBlanks);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(kBlanks) - begin + 1);
}

// By the mark at the front, or by the zero byte of an ASCII character.
bool isUtf16(std::string_view begin) {
  return begin.starts_with("\xff\xfe") || begin.starts_with("\xfe\xff") ||
         begin.substr(0, 2).find('\0') != std::string_view::npos;
}

// Takes the first word off.
std::string_view takeWord(std::string_view& text) {
  const std::size_t end = std::min(text.find_first_of(kBlanks), text.size());
  const std::string_view word = text.substr(0, end);
  text = trimmed(text.substr(end));
  return word;
}

template <std::size_t N>
bool isOneOf(std::string_view word, const std::string_view (&words)[N]) {
  return std::find(std::begin(words), std::end(words), word) != std::end(words);
}

bool isNumber(std::string_view word, double& value) {
  if (word.starts_with('+')) word.remove_prefix(1);
  value = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  // Too large or too small for a double is a number, too; the parser knows no nan and no inf
  return error != std::errc::invalid_argument && end == word.data() + word.size() &&
         std::isfinite(value);
}

bool isNumber(std::string_view word) {
  double value;
  return isNumber(word, value);
}

constexpr std::string_view kNumberStatements[] = {"v",  "vn", "vt", "Ka", "Kd",
                                                  "Ks", "Ke", "Tf", "d",  "Tr"};
constexpr std::string_view kIndexStatements[] = {"f", "l", "p"};
constexpr std::string_view kNameStatements[] = {"usemtl", "newmtl", "mtllib"};
constexpr std::string_view kColorStatements[] = {"Ka", "Kd", "Ks", "Ke", "Tf"};
constexpr std::string_view kPictureStatements[] = {"map_Kd", "map_Ke", "map_d"};
// Statements whose case does not matter.
constexpr std::string_view kSpelledStatements[] = {
    "Ka",     "Kd",     "Ks",     "Ke",    "Tf", "Tr", "Ni", "map_Kd", "map_Ke", "map_d",
    "newmtl", "usemtl", "mtllib", "illum", "v",  "vn", "vt", "f",      "l",      "Pm"};
constexpr std::string_view kFreeFormStatements[] = {"surf", "curv", "curv2"};

// An option of a picture, and the values that it may leave out.
struct PictureOption {
  std::string_view name;
  std::size_t values = 1;
  std::string_view missing;  // empty: all values are there
};
constexpr PictureOption kPictureOptions[] = {
    {"-o", 3, "0"},     {"-s", 3, "1"},     {"-t", 3, "0"},      {"-blendu", 1, {}},
    {"-blendv", 1, {}}, {"-boost", 1, {}},  {"-clamp", 1, {}},   {"-bm", 1, {}},
    {"-type", 1, {}},   {"-texres", 1, {}}, {"-imfchan", 1, {}}, {"-colorspace", 1, {}},
    {"-mm", 2, {}}};

// The name of a picture with its options. The parser takes the name for a value that is missing.
std::string withAllValues(std::string_view rest) {
  std::string text;
  while (rest.starts_with('-')) {
    std::string_view behind = rest;
    const std::string_view name = takeWord(behind);
    const auto option = std::find_if(std::begin(kPictureOptions), std::end(kPictureOptions),
                                     [&](const PictureOption& of) { return of.name == name; });
    if (option == std::end(kPictureOptions)) break;
    text.append(name) += ' ';
    for (std::size_t i = 0; i < option->values; ++i) {
      std::string_view after = behind;
      std::string_view value = takeWord(after);
      const bool is_there = option->missing.empty() || isNumber(value);
      if (is_there) behind = after;
      text.append(is_there ? value : option->missing) += ' ';
    }
    rest = behind;
  }
  return text.append(rest);
}

}  // namespace

bool ObjLines::readPhysicalLine() {
  physical_.clear();
  if (is_at_end_ && begin_ == buffer_.size()) return false;
  for (;;) {
    const char* const begin = buffer_.data() + begin_;
    const char* const end = buffer_.data() + buffer_.size();
    const char* const stop =
        std::find_if(begin, end, [](char c) { return c == '\n' || c == '\r'; });
    physical_.append(begin, stop);
    if (stop != end) {
      begin_ = std::size_t(stop - buffer_.data()) + 1;
      // \r\n may lie across two reads; the parser does not mind an empty line
      if (*stop == '\r' && begin_ < buffer_.size() && buffer_[begin_] == '\n') ++begin_;
      break;
    }
    if (physical_.size() > kLongestLine) {
      status_ = Status::corruption(fmt::format("{}: line {} has more than {} bytes", input_.path(),
                                               number_ + 1, kLongestLine));
      return false;
    }
    // Vertices mostly come first, and take less than the faces
    const double read = input_.size() ? double(offset_) / double(*input_.size() + 1) : .5;
    const double part = std::pow(read, 1.5);
    status_ = checkResidentBytes(input_.path(), 0, part, kHeldTimesOfObj);
    if (!status_.ok()) return false;
    buffer_.resize(kReadBytes);
    begin_ = 0;
    const Result<std::size_t> count =
        input_.readSome(offset_, std::as_writable_bytes(std::span(buffer_)));
    if (!count.ok()) status_ = count.status();
    buffer_.resize(count.ok() ? *count : 0);
    if (offset_ == 0 && isUtf16({buffer_.data(), buffer_.size()})) {
      status_ =
          Status::corruption(fmt::format("{0}: found text in UTF-16, expected UTF-8 or ASCII: "
                                         "`iconv -f UTF-16 -t UTF-8 {0} > NEW` "
                                         "converts it",
                                         input_.path()));
    }
    offset_ += buffer_.size();
    if (!status_.ok()) return false;
    if (buffer_.empty()) {
      is_at_end_ = true;
      break;
    }
  }
  ++number_;
  constexpr std::string_view kByteOrderMark = "\xef\xbb\xbf";
  if (number_ == 1 && physical_.starts_with(kByteOrderMark)) physical_.erase(0, 3);
  return true;
}

bool ObjLines::readLine() {
  line_.clear();
  std::size_t joined = 0;
  for (;;) {
    if (!readPhysicalLine()) return joined > 0 && status_.ok();
    const std::string_view text = trimmed(physical_);
    const bool is_comment = joined == 0 && text.starts_with('#');
    if (is_comment) {
      takeComment(text);
    } else if (!text.empty()) {
      has_statement_ = true;
    }
    if (is_comment || !text.ends_with('\\')) {
      line_ += physical_;
      break;
    }
    line_.append(physical_, 0, physical_.rfind('\\'));
    line_ += ' ';
    if (line_.size() > kLongestLine) {
      status_ = Status::corruption(fmt::format("{}: the lines to {} are one of more than {} bytes",
                                               input_.path(), number_, kLongestLine));
      return false;
    }
    ++joined;
  }
  rewriteLine();
  // Whoever counts lines comes to the same number
  line_.append(joined + 1, '\n');
  return status_.ok();
}

void ObjLines::takeComment(std::string_view text) {
  constexpr std::size_t kMostComments = 64, kMostChars = 1024;
  if (text.starts_with("#MRGB")) {
    colors_.addZBrushLine();
    return;
  }
  while (text.starts_with('#')) text.remove_prefix(1);
  text = trimmed(text).substr(0, kMostChars);
  if (text.empty()) return;
  if (has_statement_ || comments_.size() == kMostComments) {
    ++other_comments_;
    return;
  }
  std::string& comment = comments_.emplace_back(text);
  std::replace_if(
      comment.begin(), comment.end(), [](char c) { return c < ' ' && c > '\0'; }, ' ');
}

void ObjLines::rewriteLine() {
  spellStatement();
  dropComment();
  std::string_view rest = trimmed(line_);
  const std::string_view word = takeWord(rest);
  if (isOneOf(word, kFreeFormStatements)) ++free_form_;
  if (isOneOf(word, kNameStatements)) {
    const bool is_quoted = rest.size() > 2 && rest.starts_with('"') && rest.ends_with('"');
    std::string name(is_quoted ? rest.substr(1, rest.size() - 2) : rest);
    for (char& c : name) {
      if (kBlanks.find(c) != std::string_view::npos) c = kNameBlank;
      if (c == '\\') c = '/';  // written on Windows
    }
    const bool is_material = word == "newmtl";
    line_ = std::string(word) + " " + name;
    if (is_material) noteMaterial("newmtl", name);
    if (word == "usemtl") has_early_use_ = has_early_use_ || !has_library_;
    if (word == "mtllib") {
      has_library_ = true;
      if (has_early_use_) late_libraries_ += line_ + "\n";
    }
  } else if (isOneOf(word, kPictureStatements)) {
    line_ = std::string(word) + " " + withAllValues(rest);
  } else if (word == "Pm") {
    double metal = 0;
    if (isNumber(takeWord(rest), metal) && metal > 0) ++metals_;
  } else if (word == "d" && rest.starts_with("-halo")) {
    takeWord(rest);
    line_ = "d " + std::string(rest);
    checkNumbers(std::string_view(line_).substr(2));
  } else if (isOneOf(word, kIndexStatements)) {
    dropSlashes();
  } else if (isOneOf(word, kNumberStatements) && checkNumbers(rest)) {
    if (word == "v" && values_.size() < 3) {
      status_ = Status::corruption(
          fmt::format("{}: line {}: found a vertex of {} numbers, expected three: flat ones have 0",
                      input_.path(), number_, values_.size()));
      return;
    }
    if (word == "v") keepPlace(rest);
    noteMaterial(word, rest);
    completeColor(word, rest);
  }
}

void ObjLines::keepPlace(std::string_view rest) {
  colors_.addVertex(values_);
  if (values_.size() <= 3) return;
  for (int i = 0; i < 3; ++i) takeWord(rest);
  line_.resize(std::size_t(rest.data() - line_.data()));
}

// One value is that of all three colors.
void ObjLines::completeColor(std::string_view word, std::string_view rest) {
  const std::string_view value = takeWord(rest);
  if (!rest.empty() || !isOneOf(word, kColorStatements)) return;
  line_ = fmt::format("{0} {1} {1} {1}", word, value);
}

// The parser knows one spelling of a statement.
void ObjLines::spellStatement() {
  std::string_view rest = trimmed(line_);
  const std::string_view word = takeWord(rest);
  for (const std::string_view known : kSpelledStatements) {
    if (word == known || !isSameInAnyCase(word, known)) continue;
    line_.replace(std::size_t(word.data() - line_.data()), word.size(), known);
    return;
  }
}

void ObjLines::noteMaterial(std::string_view word, std::string_view rest) {
  if (word == "newmtl") {
    const auto [material, is_new] = materials_.try_emplace(std::string(rest), false);
    has_kd_ = is_new ? &material->second : nullptr;
    if (!is_new) repeated_.insert(material->first);
  } else if (word == "Kd" && has_kd_ != nullptr) {
    *has_kd_ = true;
  }
}

// The parser takes comments behind numbers for more of them. Names may have #.
void ObjLines::dropComment() {
  std::string_view rest = trimmed(line_);
  const std::string_view word = takeWord(rest);
  if (!isOneOf(word, kNumberStatements) && !isOneOf(word, kIndexStatements)) return;
  const std::size_t comment = line_.find('#');
  if (comment == line_.npos) return;
  ++other_comments_;
  line_.resize(comment);
}

// Corners without the rest of their indices: 1/ and 1// are 1.
void ObjLines::dropSlashes() {
  if (line_.find('/') == line_.npos) return;
  std::string line;
  for (std::size_t i = 0; i < line_.size(); ++i) {
    const std::size_t end = std::min(line_.find_first_not_of('/', i), line_.size());
    const bool ends_word = end == line_.size() || kBlanks.find(line_[end]) != kBlanks.npos;
    const bool has_index = !line.empty() && kBlanks.find(line.back()) == kBlanks.npos;
    if (line_[i] == '/' && ends_word && has_index) continue;
    line += line_[i];
  }
  line_ = std::move(line);
}

bool ObjLines::checkNumbers(std::string_view numbers) {
  values_.clear();
  while (!numbers.empty()) {
    const std::string_view word = takeWord(numbers);
    double value;
    if (isNumber(word, value)) {
      values_.push_back(value);
      continue;
    }
    std::string_view advice;
    if (word.find(',') != std::string_view::npos) {
      advice = " with a decimal point: replace commas by points";
    } else if (values_.empty() && (word == "spectral" || word == "xyz")) {
      advice = ": spectra and CIE XYZ are not read, replace them by red, green and blue";
    }
    status_ = Status::corruption(fmt::format("{}: line {}: found \"{}\", expected a number{}",
                                             input_.path(), number_, word.substr(0, 40), advice));
    return false;
  }
  return true;
}

ObjLines::int_type ObjLines::underflow() {
  if (!first_lines_.empty()) {
    line_ = std::exchange(first_lines_, {});
    setg(line_.data(), line_.data(), line_.data() + line_.size());
    return traits_type::to_int_type(line_[0]);
  }
  if (!status_.ok() || !readLine()) return traits_type::eof();
  setg(line_.data(), line_.data(), line_.data() + line_.size());
  return traits_type::to_int_type(line_[0]);
}

}  // namespace surfeit
