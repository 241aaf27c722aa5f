// Conditions on the values of a row, as users write them: "classification != 7 and return == 1".
// docs/files.md, "Filters", has the language.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "cloud/rows/row_expression.h"
#include "cloud/rows/row_layout.h"
#include "surfeit/status.h"

namespace surfeit {

// Immutable; safe from any thread, each with a Workspace of its own.
class RowFilter {
 public:
  using Workspace = RowExpression::Workspace;

  // `properties` are those of a row, with their offsets. kInvalidArgument names the place in `text`
  // that is no condition, and the names that exist when one does not.
  static Result<RowFilter> create(std::string_view text, std::span<const RowProperty> properties) {
    SURFEIT_ASSIGN_OR_RETURN(RowExpression condition,
                             RowExpression::create({"filter", text}, {properties}));
    return RowFilter(std::move(condition));
  }

  // Whether it holds for all rows, whatever their values.
  bool isTrue() const { return condition_.constant().value_or(0) != 0; }

  // For each of `count` rows, at most kFilterRows, 1 where the condition holds and 0 where not.
  void test(const std::byte* rows, std::size_t row_bytes, std::size_t count, Workspace& workspace,
            std::uint8_t* holds) const {
    const std::span<const double> values = condition_.evaluate(rows, row_bytes, count, workspace);
    for (std::size_t i = 0; i < count; ++i) holds[i] = values[i] != 0;
  }

 private:
  explicit RowFilter(RowExpression condition) : condition_(std::move(condition)) {}

  RowExpression condition_;
};

}  // namespace surfeit
