// Expressions over the values of a row, as users write them: the conditions of --filter and the
// values of --set. docs/files.md, "Filters", has the language.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "cloud/rows/channels.h"
#include "cloud/rows/row_layout.h"
#include "surfeit/status.h"

namespace surfeit {

// Rows that are looked at together: their values stay in the first-level cache.
inline constexpr std::size_t kFilterRows = 512;

// A text, or a part of one: messages begin with `subject`, and count places from the whole text's
// beginning, `first` characters before.
struct ExpressionText {
  std::string_view subject, text;
  std::size_t first = 0;
};

// What names stand for: the properties of a row, with their offsets; and in an expression for one
// component of a channel, the same component of the `groups` (channelsOf those properties). A group
// that has none of that number is refused.
struct ExpressionNames {
  std::span<const RowProperty> properties;
  std::span<const RowChannel> groups{};
  std::size_t component = ~std::size_t{0};
};

// Immutable; safe from any thread, each with a Workspace of its own.
class RowExpression {
 public:
  // Values of kFilterRows rows for each step.
  using Workspace = std::vector<double>;

  // kInvalidArgument names the place in the text that is no expression, and the names that exist
  // when one does not.
  static Result<RowExpression> create(const ExpressionText& text, const ExpressionNames& names);

  // The value, where it is a number by itself.
  std::optional<double> constant() const;

  // The values of `count` rows, at most kFilterRows; they last as long as the workspace is not used
  // again.
  std::span<const double> evaluate(const std::byte* rows, std::size_t row_bytes, std::size_t count,
                                   Workspace& workspace) const;

  enum class Operation : std::uint8_t {
    kNumber,
    kProperty,
    kNot,
    kNegate,
    kAdd,
    kSubtract,
    kMultiply,
    kDivide,
    kMin,
    kMax,
    kPower,
    kAbs,
    kRoot,
    kEqual,
    kNotEqual,
    kLess,
    kLessEqual,
    kGreater,
    kGreaterEqual,
    kAnd,
    kOr
  };

 private:
  friend class ExpressionParser;

  // A value by itself, or of one or two steps before it
  struct Step {
    Operation operation = Operation::kNumber;
    std::size_t left = 0, right = 0;
    double number = 0;
    RowProperty property{};
  };

  std::vector<Step> steps_;  // the last one is the whole expression
};

}  // namespace surfeit
