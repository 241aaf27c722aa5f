#include "cloud/edits/channel_assignment.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstring>
#include <limits>
#include <string_view>
#include <utility>

#include "cloud/rows/channels.h"
#include "cloud/rows/surfel_names.h"

namespace surfeit {
namespace {

constexpr std::size_t kMostChannelsTold = 40;

// Channels that may be set where a cloud has none: a name that is none of these, nor one of the
// cloud, is a slip of the pen.
constexpr std::string_view kNewNumbers[] = {"group", "two_sided", "radius",    "area",
                                            "width", "coverage",  "occlusion", "alpha"};
constexpr std::string_view kNewColors[] = {"radiosity", "albedo", "irradiance"};

// The parts of an assignment, with their places in the text.
struct AssignmentParts {
  std::string_view target, value, condition;
  std::size_t target_at = 0, value_at = 0, condition_at = 0;
  char operation = '=';
  bool has_condition = false;
};

Status wrongAt(std::size_t at, std::string_view found, std::string_view expected) {
  return Status::invalidArgument(
      fmt::format("set: at {}: found {}, expected {}", at + 1, found, expected));
}

std::string foundAt(std::string_view text, std::size_t at) {
  return at < text.size() ? quoteText(text.substr(at)) : "the end";
}

bool isBlank(char c) { return std::isspace(static_cast<unsigned char>(c)) != 0; }
bool isWordPart(char c) {
  return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '.';
}

std::size_t skipBlanks(std::string_view text, std::size_t at) {
  while (at < text.size() && isBlank(text[at])) ++at;
  return at;
}

// Where the word `where` begins, outside of quotes; npos without one.
std::size_t findWhere(std::string_view text, std::size_t at) {
  char quote = 0;
  for (; at < text.size(); ++at) {
    const char c = text[at];
    if (quote != 0) {
      if (c == quote) quote = 0;
    } else if (c == '"' || c == '\'') {
      quote = c;
    } else if (text.substr(at).starts_with("where") && (at == 0 || !isWordPart(text[at - 1])) &&
               (at + 5 == text.size() || !isWordPart(text[at + 5]))) {
      return at;
    }
  }
  return std::string_view::npos;
}

Result<AssignmentParts> partsOf(std::string_view text) {
  AssignmentParts parts;
  std::size_t at = skipBlanks(text, 0);
  parts.target_at = at;
  if (at < text.size() && (text[at] == '"' || text[at] == '\'')) {
    const std::size_t end = text.find(text[at], at + 1);
    if (end == std::string_view::npos || end == at + 1) {
      return wrongAt(at, foundAt(text, at), "a name between quotes");
    }
    parts.target = text.substr(at + 1, end - at - 1);
    at = end + 1;
  } else {
    std::size_t end = at;
    while (end < text.size() && isWordPart(text[end])) ++end;
    if (end == at) return wrongAt(at, foundAt(text, at), "the name of a channel or property");
    parts.target = text.substr(at, end - at);
    at = end;
  }
  at = skipBlanks(text, at);
  const std::string_view rest = text.substr(std::min(at, text.size()));
  if (rest.starts_with("=") && !rest.starts_with("==")) {
    at += 1;
  } else if (rest.size() > 1 && rest[1] == '=' &&
             std::string_view("*+-/").find(rest[0]) != std::string_view::npos) {
    parts.operation = rest[0];
    at += 2;
  } else {
    return wrongAt(at, foundAt(text, at), "=, *=, /=, += or -=");
  }
  parts.value_at = at;
  const std::size_t where = findWhere(text, at);
  parts.value = text.substr(at, where == std::string_view::npos ? where : where - at);
  parts.has_condition = where != std::string_view::npos;
  if (parts.has_condition) {
    parts.condition_at = where + 5;
    parts.condition = text.substr(parts.condition_at);
  }
  return parts;
}

RowLayout packedLayout(const std::vector<RowProperty>& properties) {
  RowLayout element;
  element.properties = properties;
  packRow(element);
  return element;
}

// The properties that a name stands for: a property, or those of a channel; none.
std::vector<RowProperty> targetsOf(std::string_view name, const RowLayout& element,
                                   const std::vector<RowChannel>& channels) {
  const RowProperty* const single = element.find(name);
  if (single != nullptr && !single->is_list) return {*single};
  for (const RowChannel& channel : channels) {
    if (channel.name != name) continue;
    std::vector<RowProperty> targets;
    for (const std::size_t i : channel.properties) targets.push_back(element.properties[i]);
    return targets;
  }
  return {};
}

bool isPosition(const RowProperty& property) {
  return std::find(std::begin(kPositionNames), std::end(kPositionNames), property.name) !=
         std::end(kPositionNames);
}

// Floats would lose digits where they come to lie far from 0.
void widenPositions(std::vector<RowProperty>& properties) {
  for (RowProperty& property : properties) {
    if (isPosition(property) && property.type == ValueType::kFloat32) {
      property.type = ValueType::kFloat64;
    }
  }
}

Status unknownTarget(const AssignmentParts& parts, const std::vector<RowChannel>& channels) {
  std::string names;
  for (std::size_t i = 0; i < std::min(channels.size(), kMostChannelsTold); ++i) {
    names += " " + channels[i].name;
  }
  return wrongAt(parts.target_at, quoteText(parts.target),
                 fmt::format("one of{}, or one of their properties", names));
}

template <std::size_t N>
bool contains(const std::string_view (&names)[N], std::string_view name) {
  return std::find(std::begin(names), std::end(names), name) != std::end(names);
}

}  // namespace

Status ChannelAssignment::declare(const std::string& text, std::vector<RowProperty>& properties) {
  SURFEIT_ASSIGN_OR_RETURN(const AssignmentParts parts, partsOf(text));
  const RowLayout element = packedLayout(properties);
  const std::vector<RowChannel> channels = channelsOf(element);
  const std::vector<RowProperty> targets = targetsOf(parts.target, element, channels);
  if (std::any_of(targets.begin(), targets.end(), isPosition)) widenPositions(properties);
  if (!targets.empty()) return {};
  std::vector<std::string> names;
  if (contains(kNewNumbers, parts.target)) names = {std::string(parts.target)};
  for (const char* const component : {"_r", "_g", "_b"}) {
    if (contains(kNewColors, parts.target)) names.push_back(std::string(parts.target) + component);
  }
  if (names.empty() || parts.operation != '=') return unknownTarget(parts, channels);
  for (const std::string& name : names) {
    RowProperty property;
    property.name = name;
    if (name == "group" || name == "two_sided") property.type = ValueType::kUint8;
    properties.push_back(property);
  }
  return {};
}

Result<std::vector<ChannelAssignment>> ChannelAssignment::createAll(
    const std::vector<std::string>& texts, const std::vector<RowProperty>& properties) {
  RowLayout element;
  element.properties = properties;
  packRow(element);
  std::vector<ChannelAssignment> all;
  for (const std::string& text : texts) {
    SURFEIT_ASSIGN_OR_RETURN(ChannelAssignment made, create(text, element));
    all.push_back(std::move(made));
  }
  return all;
}

Result<ChannelAssignment> ChannelAssignment::create(const std::string& text,
                                                    const RowLayout& element) {
  SURFEIT_ASSIGN_OR_RETURN(const AssignmentParts parts, partsOf(text));
  const std::vector<RowChannel> channels = channelsOf(element);
  ChannelAssignment made(text);
  made.operation_ = parts.operation;
  made.row_bytes_ = element.row_bytes;
  made.targets_ = targetsOf(parts.target, element, channels);
  if (made.targets_.empty()) return unknownTarget(parts, channels);
  ExpressionNames names{element.properties, channels};
  for (std::size_t i = 0; i < made.targets_.size(); ++i) {
    if (made.targets_.size() > 1) names.component = i;
    SURFEIT_ASSIGN_OR_RETURN(RowExpression value,
                             RowExpression::create({"set", parts.value, parts.value_at}, names));
    made.values_.push_back(std::move(value));
  }
  if (parts.has_condition) {
    SURFEIT_ASSIGN_OR_RETURN(made.condition_,
                             RowExpression::create({"set", parts.condition, parts.condition_at},
                                                   {element.properties, channels}));
  }
  made.results_.resize(made.targets_.size());
  return made;
}

bool ChannelAssignment::movesRows() const {
  return std::any_of(targets_.begin(), targets_.end(), isPosition);
}

void ChannelAssignment::apply(std::byte* rows, std::size_t count) {
  for (std::size_t begin = 0; begin < count; begin += kFilterRows) {
    applyBlock(rows + begin * row_bytes_, std::min(kFilterRows, count - begin));
  }
}

void ChannelAssignment::applyBlock(std::byte* rows, std::size_t count) {
  std::array<bool, kFilterRows> holds;
  holds.fill(true);
  if (condition_) {
    const std::span<const double> values =
        condition_->evaluate(rows, row_bytes_, count, workspace_);
    for (std::size_t i = 0; i < count; ++i) holds[i] = values[i] != 0;
  }
  for (std::size_t k = 0; k < targets_.size(); ++k) {
    const std::span<const double> values = values_[k].evaluate(rows, row_bytes_, count, workspace_);
    std::copy(values.begin(), values.end(), results_[k].begin());
  }
  for (std::size_t i = 0; i < count; ++i) {
    if (!holds[i]) continue;
    for (std::size_t k = 0; k < targets_.size(); ++k) {
      store(targets_[k], results_[k][i], rows + i * row_bytes_);
    }
    ++changed_;
  }
  seen_ += count;
}

// Integers take the nearest number that they can hold; where there is none they stay.
void ChannelAssignment::store(const RowProperty& property, double operand, std::byte* row) {
  std::byte* const to = row + property.offset;
  const double old = rowValue(to, property.type);
  double value = operand;
  if (operation_ == '*') value = old * operand;
  if (operation_ == '/') value = old / operand;
  if (operation_ == '+') value = old + operand;
  if (operation_ == '-') value = old - operand;
  visitValueType(property.type, [&]<typename T>(std::type_identity<T>) {
    T stored;
    if constexpr (std::is_integral_v<T>) {
      const double nearest =
          std::clamp(std::nearbyint(value), double(std::numeric_limits<T>::min()),
                     double(std::numeric_limits<T>::max()));
      if (nearest != std::nearbyint(value)) ++clamped_;
      if (std::isnan(value)) return;
      stored = static_cast<T>(nearest);
    } else {
      stored = static_cast<T>(value);
      if (!std::isfinite(stored)) ++not_finite_;
    }
    std::memcpy(to, &stored, sizeof stored);
  });
}

std::string ChannelAssignment::describe() const {
  return fmt::format("set {}: {} of {} records", quoteText(text_), changed_, seen_);
}

std::string ChannelAssignment::loss() const {
  std::string text;
  if (clamped_ > 0) {
    text = fmt::format(
        "{} values do not fit the type of {}: the nearest that do are taken (NaN: "
        "the old one)",
        clamped_, targets_[0].name);
  }
  if (not_finite_ > 0) {
    text += fmt::format("{}{} values are not finite", text.empty() ? "" : "; ", not_finite_);
  }
  return text.empty() ? text : fmt::format("set {}: {}", quoteText(text_), text);
}

}  // namespace surfeit
