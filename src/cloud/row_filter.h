// Conditions on the values of a row, as users write them: "classification != 7 and return == 1".
// docs/files.md, "Filters", has the language.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cloud/row_layout.h"
#include "surfeit/status.h"

namespace surfeit {

// Rows that are looked at together: their values stay in the first-level cache.
inline constexpr std::size_t kFilterRows = 512;

// Immutable; safe from any thread, each with a Workspace of its own.
class RowFilter {
 public:
  // Values of kFilterRows rows for each step of the condition.
  using Workspace = std::vector<double>;

  // `properties` are those of a row, with their offsets. kInvalidArgument names the place in `text`
  // that is no condition, and the names that exist when one does not.
  static Result<RowFilter> create(std::string_view text, std::span<const RowProperty> properties);

  // Whether it holds for all rows, whatever their values.
  bool isTrue() const;

  // For each of `count` rows, at most kFilterRows, 1 where the condition holds and 0 where not.
  void test(const std::byte* rows, std::size_t row_bytes, std::size_t count, Workspace& workspace,
            std::uint8_t* holds) const;

 private:
  friend class FilterParser;

  enum class Operation : std::uint8_t {
    kNumber,
    kProperty,
    kNot,
    kNegate,
    kAdd,
    kSubtract,
    kMultiply,
    kDivide,
    kEqual,
    kNotEqual,
    kLess,
    kLessEqual,
    kGreater,
    kGreaterEqual,
    kAnd,
    kOr
  };
  // A value by itself, or of one or two steps before it
  struct Step {
    Operation operation = Operation::kNumber;
    std::size_t left = 0, right = 0;
    double number = 0;
    RowProperty property{};
  };

  std::vector<Step> steps_;  // the last one is the whole condition
};

}  // namespace surfeit
