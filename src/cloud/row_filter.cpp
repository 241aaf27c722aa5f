#include "cloud/row_filter.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>
#include <utility>

#include "cloud/channels.h"

namespace surfeit {
namespace {

// More than a person writes, few enough that neither the stack nor the workspace grows large
constexpr std::size_t kMaxSteps = 256;
constexpr int kMaxDepth = 64;
constexpr std::size_t kMostNamesTold = 60;

// What programs that read laser scans call properties, besides ways to write the same words.
struct FilterAlias {
  std::string_view alias, name;
};
constexpr FilterAlias kFilterAliases[] = {
    {"return", "return_number"},
    {"returnnum", "return_number"},
    {"returns", "number_of_returns"},
    {"numreturns", "number_of_returns"},
    {"numberreturns", "number_of_returns"},
    {"class", "classification"},
    {"scananglerank", "scan_angle"},
    {"angle", "scan_angle"},
    {"scanchannel", "scanner_channel"},
    {"sourceid", "point_source_id"},
    {"pointsource", "point_source_id"},
    {"time", "gps_time"},
    {"infrared", "nir"},
    {"nearinfrared", "nir"},
    {"edgeofflight", "edge_of_flight_line"},
    {"scandirection", "scan_direction_flag"},
    {"keypointflag", "key_point"},
};

// Letters and digits alone: ReturnNumber, return_number and RETURN-NUMBER are the same.
std::string plainName(std::string_view name) {
  std::string plain;
  for (const char c : name) {
    if (c != '_' && c != '-' && c != ' ') {
      plain += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    }
  }
  return plain;
}

bool isNameStart(char c) { return std::isalpha(static_cast<unsigned char>(c)) != 0 || c == '_'; }
bool isNamePart(char c) {
  return isNameStart(c) || std::isdigit(static_cast<unsigned char>(c)) != 0 || c == '.';
}

// What a text consists of: numbers, names and signs.
struct Token {
  enum class Kind : std::uint8_t { kEnd, kNumber, kName, kSign } kind = Kind::kEnd;
  std::size_t at = 0;     // of its first character
  std::string_view text;  // as written; of a quoted name what is inside
  double number = 0;
  bool is_quoted = false;

  bool is(std::string_view sign) const { return kind == Kind::kSign && text == sign; }
  bool isWord(std::string_view word) const {
    return kind == Kind::kName && !is_quoted && plainName(text) == word;
  }
};

// The properties of rows by the names that people have for them.
class PropertyNames {
 public:
  explicit PropertyNames(std::span<const RowProperty> properties) : properties_(properties) {}

  const RowProperty* find(std::string_view name) const {
    for (const RowProperty& property : properties_) {
      if (property.name == name) return &property;
    }
    if (const RowProperty* const found = findPlain(name)) return found;
    const std::string plain = plainName(name);
    for (const FilterAlias& row : kFilterAliases) {
      if (row.alias != plain) continue;
      if (const RowProperty* const found = findPlain(row.name)) return found;
    }
    const std::vector<std::string> ours = propertyNames(name, 1, ChannelKind::kFloat, {});
    return ours.size() == 1 ? findPlain(ours[0]) : nullptr;
  }

  std::string describe() const {
    std::string text;
    for (std::size_t i = 0; i < std::min(properties_.size(), kMostNamesTold); ++i) {
      text += " " + properties_[i].name;
    }
    return properties_.size() > kMostNamesTold ? text + " ..." : text;
  }

 private:
  // The only one whose letters and digits are the same.
  const RowProperty* findPlain(std::string_view name) const {
    const std::string plain = plainName(name);
    const RowProperty* found = nullptr;
    for (const RowProperty& property : properties_) {
      if (plainName(property.name) != plain) continue;
      if (found != nullptr) return nullptr;
      found = &property;
    }
    return found;
  }

  std::span<const RowProperty> properties_;
};

Status wrongAt(std::size_t at, std::string_view found, std::string_view expected) {
  return Status::invalidArgument(
      fmt::format("filter: at {}: found {}, expected {}", at + 1, found, expected));
}

}  // namespace

// Recursive descent, one function per level of precedence: or, and, not, comparison, sum, product,
// sign, value.
class FilterParser {
 public:
  FilterParser(std::string_view text, std::span<const RowProperty> properties)
      : text_(text), names_(properties) {}

  Result<RowFilter> parse() {
    SURFEIT_RETURN_IF_ERROR(advance());
    SURFEIT_ASSIGN_OR_RETURN([[maybe_unused]] const std::size_t root, parseOr());
    if (token_.kind != Token::Kind::kEnd) {
      return wrongAt(token_.at, found(), "and, or, or the end");
    }
    return std::move(filter_);
  }

 private:
  using Operation = RowFilter::Operation;
  using Step = RowFilter::Step;

  std::string found() const {
    return token_.kind == Token::Kind::kEnd ? "the end" : quoteText(token_.text);
  }

  Result<std::size_t> add(Step step) {
    if (filter_.steps_.size() == kMaxSteps) {
      return wrongAt(token_.at, "more", fmt::format("at most {} steps", kMaxSteps));
    }
    filter_.steps_.push_back(std::move(step));
    return filter_.steps_.size() - 1;
  }
  Result<std::size_t> add(Operation operation, std::size_t left, std::size_t right) {
    return add(Step{operation, left, right, 0, {}});
  }

  Result<std::size_t> parseOr() {
    if (++depth_ > kMaxDepth) {
      return wrongAt(token_.at, found(), fmt::format("at most {} parentheses", kMaxDepth));
    }
    SURFEIT_ASSIGN_OR_RETURN(std::size_t left, parseAnd());
    while (token_.isWord("or") || token_.is("||")) {
      SURFEIT_RETURN_IF_ERROR(advance());
      SURFEIT_ASSIGN_OR_RETURN(const std::size_t right, parseAnd());
      SURFEIT_ASSIGN_OR_RETURN(left, add(Operation::kOr, left, right));
    }
    --depth_;
    return left;
  }

  Result<std::size_t> parseAnd() {
    SURFEIT_ASSIGN_OR_RETURN(std::size_t left, parseNot());
    while (token_.isWord("and") || token_.is("&&")) {
      SURFEIT_RETURN_IF_ERROR(advance());
      SURFEIT_ASSIGN_OR_RETURN(const std::size_t right, parseNot());
      SURFEIT_ASSIGN_OR_RETURN(left, add(Operation::kAnd, left, right));
    }
    return left;
  }

  Result<std::size_t> parseNot() {
    bool is_negated = false;
    std::size_t count = 0;
    for (; token_.isWord("not") || token_.is("!"); ++count) {
      SURFEIT_RETURN_IF_ERROR(advance());
      is_negated = !is_negated;
    }
    SURFEIT_ASSIGN_OR_RETURN(const std::size_t value, parseComparison());
    if (count == 0) return value;
    SURFEIT_ASSIGN_OR_RETURN(const std::size_t negated, add(Operation::kNot, value, value));
    return is_negated ? negated : add(Operation::kNot, negated, negated);
  }

  std::optional<Operation> comparison() const {
    constexpr std::pair<std::string_view, Operation> kSigns[] = {
        {"==", Operation::kEqual},  {"!=", Operation::kNotEqual},
        {"<", Operation::kLess},    {"<=", Operation::kLessEqual},
        {">", Operation::kGreater}, {">=", Operation::kGreaterEqual}};
    for (const auto& [sign, operation] : kSigns) {
      if (token_.is(sign)) return operation;
    }
    return {};
  }

  Result<std::size_t> parseComparison() {
    SURFEIT_ASSIGN_OR_RETURN(const std::size_t left, parseSum());
    const std::optional<Operation> operation = comparison();
    if (!operation) return left;
    SURFEIT_RETURN_IF_ERROR(advance());
    SURFEIT_ASSIGN_OR_RETURN(const std::size_t right, parseSum());
    if (comparison()) {
      return wrongAt(token_.at, found(), "and: two comparisons are written \"0 < x and x < 1\"");
    }
    roundToFloat(left, right);
    roundToFloat(right, left);
    return add(*operation, left, right);
  }

  // The number nearest to .1 that a float holds is what a file of floats calls .1.
  void roundToFloat(std::size_t property, std::size_t number) {
    Step& other = filter_.steps_[number];
    if (filter_.steps_[property].operation == Operation::kProperty &&
        filter_.steps_[property].property.type == ValueType::kFloat32 &&
        other.operation == Operation::kNumber &&
        std::abs(other.number) <= std::numeric_limits<float>::max()) {
      other.number = static_cast<float>(other.number);
    }
  }

  Result<std::size_t> parseSum() {
    SURFEIT_ASSIGN_OR_RETURN(std::size_t left, parseProduct());
    while (token_.is("+") || token_.is("-")) {
      const Operation operation = token_.is("+") ? Operation::kAdd : Operation::kSubtract;
      SURFEIT_RETURN_IF_ERROR(advance());
      SURFEIT_ASSIGN_OR_RETURN(const std::size_t right, parseProduct());
      SURFEIT_ASSIGN_OR_RETURN(left, add(operation, left, right));
    }
    return left;
  }

  Result<std::size_t> parseProduct() {
    SURFEIT_ASSIGN_OR_RETURN(std::size_t left, parseSign());
    while (token_.is("*") || token_.is("/")) {
      const Operation operation = token_.is("*") ? Operation::kMultiply : Operation::kDivide;
      SURFEIT_RETURN_IF_ERROR(advance());
      SURFEIT_ASSIGN_OR_RETURN(const std::size_t right, parseSign());
      SURFEIT_ASSIGN_OR_RETURN(left, add(operation, left, right));
    }
    return left;
  }

  Result<std::size_t> parseSign() {
    bool is_negative = false;
    while (token_.is("-") || token_.is("+")) {
      is_negative = is_negative != token_.is("-");
      SURFEIT_RETURN_IF_ERROR(advance());
    }
    SURFEIT_ASSIGN_OR_RETURN(const std::size_t value, parseValue());
    if (!is_negative) return value;
    Step& step = filter_.steps_[value];
    if (step.operation != Operation::kNumber) return add(Operation::kNegate, value, value);
    step.number = -step.number;
    return value;
  }

  Result<std::size_t> parseValue() {
    const Token token = token_;
    if (token.kind == Token::Kind::kNumber) {
      SURFEIT_RETURN_IF_ERROR(advance());
      return add(Step{Operation::kNumber, 0, 0, token.number, {}});
    }
    if (token.is("(")) {
      SURFEIT_RETURN_IF_ERROR(advance());
      SURFEIT_ASSIGN_OR_RETURN(const std::size_t value, parseOr());
      if (!token_.is(")")) return wrongAt(token_.at, found(), "and, or, or )");
      SURFEIT_RETURN_IF_ERROR(advance());
      return value;
    }
    if (token.kind != Token::Kind::kName || token.isWord("and") || token.isWord("or") ||
        token.isWord("not")) {
      return wrongAt(token.at, found(), "a number, a name or (");
    }
    SURFEIT_RETURN_IF_ERROR(advance());
    if (const RowProperty* const property = names_.find(token.text)) {
      return add(Step{Operation::kProperty, 0, 0, 0, *property});
    }
    if (token.isWord("true") || token.isWord("false")) {
      return add(Step{Operation::kNumber, 0, 0, token.isWord("true") ? 1.0 : 0.0, {}});
    }
    return wrongAt(token.at, quoteText(token.text),
                   fmt::format("true, false or one of{}", names_.describe()));
  }

  // Takes the next token.
  Status advance() {
    while (at_ < text_.size() && std::isspace(static_cast<unsigned char>(text_[at_])) != 0) ++at_;
    token_ = {};
    token_.at = at_;
    if (at_ == text_.size()) return {};
    const char c = text_[at_];
    if (c == '"' || c == '\'') return takeQuoted(c);
    if (isNameStart(c)) {
      std::size_t end = at_;
      while (end < text_.size() && isNamePart(text_[end])) ++end;
      take(Token::Kind::kName, end);
      return {};
    }
    if (std::isdigit(static_cast<unsigned char>(c)) != 0 || c == '.') return takeNumber();
    for (const std::string_view sign :
         {"==", "!=", "<=", ">=", "&&", "||", "<", ">", "(", ")", "+", "-", "*", "/", "!"}) {
      if (!text_.substr(at_).starts_with(sign)) continue;
      take(Token::Kind::kSign, at_ + sign.size());
      return {};
    }
    if (c == '=') return wrongAt(at_, "'='", "'==' to compare");
    return wrongAt(at_, quoteText(text_.substr(at_, 1)),
                   "a number, a name, a comparison (== != < <= > >=), and, or, not or parentheses");
  }

  void take(Token::Kind kind, std::size_t end) {
    token_.kind = kind;
    token_.text = text_.substr(at_, end - at_);
    at_ = end;
  }

  Status takeQuoted(char quote) {
    const std::size_t end = text_.find(quote, at_ + 1);
    if (end == std::string_view::npos || end == at_ + 1) {
      return wrongAt(at_, quoteText(text_.substr(at_)), "a name between quotes");
    }
    token_.kind = Token::Kind::kName;
    token_.text = text_.substr(at_ + 1, end - at_ - 1);
    token_.is_quoted = true;
    at_ = end + 1;
    return {};
  }

  Status takeNumber() {
    const char* const begin = text_.data() + at_;
    const char* const end = text_.data() + text_.size();
    const auto [stop, error] = std::from_chars(begin, end, token_.number);
    if (error != std::errc() || (stop != end && isNamePart(*stop))) {
      const std::size_t word = std::find_if_not(begin, end, isNamePart) - begin;
      return wrongAt(at_, quoteText(text_.substr(at_, word)), "a number");
    }
    take(Token::Kind::kNumber, static_cast<std::size_t>(stop - text_.data()));
    return {};
  }

  std::string_view text_;
  PropertyNames names_;
  std::size_t at_ = 0;
  Token token_;
  int depth_ = 0;
  RowFilter filter_;
};

namespace {

void loadValues(const RowProperty& property, const std::byte* rows, std::size_t row_bytes,
                std::size_t count, double* values) {
  visitValueType(property.type, [&]<typename T>(std::type_identity<T>) {
    const std::byte* from = rows + property.offset;
    for (std::size_t i = 0; i < count; ++i, from += row_bytes) {
      T value;
      std::memcpy(&value, from, sizeof value);
      values[i] = static_cast<double>(value);
    }
  });
}

template <typename Function>
void combine(const double* left, const double* right, std::size_t count, double* values,
             Function function) {
  for (std::size_t i = 0; i < count; ++i) {
    values[i] = static_cast<double>(function(left[i], right[i]));
  }
}

}  // namespace

Result<RowFilter> RowFilter::create(std::string_view text,
                                    std::span<const RowProperty> properties) {
  return FilterParser(text, properties).parse();
}

bool RowFilter::isTrue() const {
  return steps_.size() == 1 && steps_[0].operation == Operation::kNumber && steps_[0].number != 0;
}

void RowFilter::test(const std::byte* rows, std::size_t row_bytes, std::size_t count,
                     Workspace& workspace, std::uint8_t* holds) const {
  workspace.resize(steps_.size() * kFilterRows);
  for (std::size_t i = 0; i < steps_.size(); ++i) {
    const Step& step = steps_[i];
    double* const values = workspace.data() + i * kFilterRows;
    const double* const a = workspace.data() + step.left * kFilterRows;
    const double* const b = workspace.data() + step.right * kFilterRows;
    const auto set = [&](auto function) { combine(a, b, count, values, function); };
    switch (step.operation) {
      case Operation::kNumber:
        std::fill_n(values, count, step.number);
        break;
      case Operation::kProperty:
        loadValues(step.property, rows, row_bytes, count, values);
        break;
      case Operation::kNot:
        set([](double x, double) { return x == 0; });
        break;
      case Operation::kNegate:
        set([](double x, double) { return -x; });
        break;
      case Operation::kAdd:
        set([](double x, double y) { return x + y; });
        break;
      case Operation::kSubtract:
        set([](double x, double y) { return x - y; });
        break;
      case Operation::kMultiply:
        set([](double x, double y) { return x * y; });
        break;
      case Operation::kDivide:
        set([](double x, double y) { return x / y; });
        break;
      case Operation::kEqual:
        set([](double x, double y) { return x == y; });
        break;
      case Operation::kNotEqual:
        set([](double x, double y) { return x != y; });
        break;
      case Operation::kLess:
        set([](double x, double y) { return x < y; });
        break;
      case Operation::kLessEqual:
        set([](double x, double y) { return x <= y; });
        break;
      case Operation::kGreater:
        set([](double x, double y) { return x > y; });
        break;
      case Operation::kGreaterEqual:
        set([](double x, double y) { return x >= y; });
        break;
      case Operation::kAnd:
        set([](double x, double y) { return (x != 0) & (y != 0); });
        break;
      case Operation::kOr:
        set([](double x, double y) { return (x != 0) | (y != 0); });
        break;
    }
  }
  const double* const last = workspace.data() + (steps_.size() - 1) * kFilterRows;
  for (std::size_t i = 0; i < count; ++i) holds[i] = last[i] != 0;
}

}  // namespace surfeit
