#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstring>
#include <iterator>
#include <limits>
#include <optional>
#include <utility>

#include "cloud/rows/channels.h"
#include "cloud/rows/row_expression.h"

namespace surfeit {
namespace {

// More than a person writes, few enough that neither the stack nor the workspace grows large
constexpr std::size_t kMaxSteps = 256;
constexpr int kMaxDepth = 64;
constexpr std::size_t kMostNamesTold = 60;

// What programs that read laser scans call properties, besides ways to write the same words.
struct PropertyAlias {
  std::string_view alias, name;
};
constexpr PropertyAlias kPropertyAliases[] = {
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
    for (const PropertyAlias& row : kPropertyAliases) {
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

  std::span<const RowProperty> properties() const { return properties_; }

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

// Functions, by their number of values.
struct Function {
  std::string_view name;
  RowExpression::Operation operation;
  bool has_two;
};
using Operation = RowExpression::Operation;
constexpr Function kFunctions[] = {{"min", Operation::kMin, true},
                                   {"max", Operation::kMax, true},
                                   {"pow", Operation::kPower, true},
                                   {"abs", Operation::kAbs, false},
                                   {"sqrt", Operation::kRoot, false}};

}  // namespace

// Recursive descent, one function per level of precedence: or, and, not, comparison, sum, product,
// sign, value.
class ExpressionParser {
 public:
  ExpressionParser(const ExpressionText& text, const ExpressionNames& names)
      : subject_(text.subject),
        first_(text.first),
        text_(text.text),
        names_(names.properties),
        groups_(names.groups),
        component_(names.component) {}

  Result<RowExpression> parse() {
    SURFEIT_RETURN_IF_ERROR(advance());
    SURFEIT_ASSIGN_OR_RETURN([[maybe_unused]] const std::size_t root, parseOr());
    if (token_.kind != Token::Kind::kEnd) {
      return wrongAt(token_.at, found(), "and, or, or the end");
    }
    return std::move(expression_);
  }

 private:
  using Step = RowExpression::Step;

  Status wrongAt(std::size_t at, std::string_view found, std::string_view expected) const {
    return Status::invalidArgument(fmt::format("{}: at {}: found {}, expected {}", subject_,
                                               first_ + at + 1, found, expected));
  }

  std::string found() const {
    return token_.kind == Token::Kind::kEnd ? "the end" : quoteText(token_.text);
  }

  Result<std::size_t> add(Step step) {
    if (expression_.steps_.size() == kMaxSteps) {
      return wrongAt(token_.at, "more", fmt::format("at most {} steps", kMaxSteps));
    }
    expression_.steps_.push_back(std::move(step));
    return expression_.steps_.size() - 1;
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
    Step& other = expression_.steps_[number];
    if (expression_.steps_[property].operation == Operation::kProperty &&
        expression_.steps_[property].property.type == ValueType::kFloat32 &&
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
    Step& step = expression_.steps_[value];
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
    if (token_.is("(") && !token.is_quoted) return parseCall(token);
    if (const RowChannel* const group = findGroup(token.text)) {
      if (component_ < group->properties.size()) {
        return add(Step{Operation::kProperty, 0, 0, 0,
                        names_.properties()[group->properties[component_]]});
      }
      return wrongAt(
          token.at,
          fmt::format("{} of {} numbers", quoteText(token.text), group->properties.size()),
          fmt::format("one number, such as {}", names_.properties()[group->properties[0]].name));
    }
    if (const RowProperty* const property = names_.find(token.text)) {
      return add(Step{Operation::kProperty, 0, 0, 0, *property});
    }
    if (token.isWord("true") || token.isWord("false")) {
      return add(Step{Operation::kNumber, 0, 0, token.isWord("true") ? 1.0 : 0.0, {}});
    }
    return wrongAt(token.at, quoteText(token.text),
                   fmt::format("true, false or one of{}", names_.describe()));
  }

  // The channel of several numbers with that name, unless a property has it.
  const RowChannel* findGroup(std::string_view name) const {
    for (const RowProperty& property : names_.properties()) {
      if (property.name == name) return nullptr;
    }
    for (const RowChannel& group : groups_) {
      if (group.name == name && group.properties.size() > 1) return &group;
    }
    return nullptr;
  }

  // What stands behind the name of a function.
  Result<std::size_t> parseCall(const Token& name) {
    const auto* const function =
        std::find_if(std::begin(kFunctions), std::end(kFunctions),
                     [&](const Function& known) { return known.name == name.text; });
    if (function == std::end(kFunctions)) {
      return wrongAt(name.at, quoteText(name.text), "min, max, pow, abs or sqrt before (");
    }
    SURFEIT_RETURN_IF_ERROR(advance());
    SURFEIT_ASSIGN_OR_RETURN(const std::size_t left, parseOr());
    std::size_t right = left;
    if (function->has_two) {
      if (!token_.is(",")) return wrongAt(token_.at, found(), "a comma and a second value");
      SURFEIT_RETURN_IF_ERROR(advance());
      SURFEIT_ASSIGN_OR_RETURN(right, parseOr());
    }
    if (!token_.is(")")) return wrongAt(token_.at, found(), ")");
    SURFEIT_RETURN_IF_ERROR(advance());
    return add(function->operation, left, right);
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
         {"==", "!=", "<=", ">=", "&&", "||", "<", ">", "(", ")", "+", "-", "*", "/", "!", ","}) {
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

  const std::string_view subject_;
  const std::size_t first_;
  const std::string_view text_;
  const PropertyNames names_;
  const std::span<const RowChannel> groups_;
  const std::size_t component_;
  std::size_t at_ = 0;
  Token token_;
  int depth_ = 0;
  RowExpression expression_;
};

Result<RowExpression> RowExpression::create(const ExpressionText& text,
                                            const ExpressionNames& names) {
  return ExpressionParser(text, names).parse();
}

}  // namespace surfeit
