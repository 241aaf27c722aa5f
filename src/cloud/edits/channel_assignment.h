// Channel arithmetic, as users write it: "radiosity *= 0.5 where group == 3". docs/files.md,
// "Channel arithmetic", has the language.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "cloud/rows/row_expression.h"
#include "cloud/rows/row_layout.h"
#include "surfeit/status.h"

namespace surfeit {

// One assignment. One thread at a time: it counts what it changes.
class ChannelAssignment {
 public:
  // Adds the properties of a well-known channel that a text sets with "=" and rows lack; positions
  // that it sets become doubles. Errors as of create, of the part before the value.
  static Status declare(const std::string& text, std::vector<RowProperty>& properties);
  // Rows will be those of `element`. kInvalidArgument names the place in the text, what was found
  // there and what was expected.
  static Result<ChannelAssignment> create(const std::string& text, const RowLayout& element);
  // Of packed rows of these properties.
  static Result<std::vector<ChannelAssignment>> createAll(
      const std::vector<std::string>& texts, const std::vector<RowProperty>& properties);

  // The name and whether a channel of positions changes.
  const std::string& text() const { return text_; }
  bool movesRows() const;

  // Sets the values of `count` packed rows in place, one block after the other. Values of all
  // components are computed before any is stored.
  void apply(std::byte* rows, std::size_t count);

  // What was done, a sentence; and what was lost on the way, or nothing.
  std::string describe() const;
  std::string loss() const;
  // Begins to count anew.
  void forget() { seen_ = changed_ = clamped_ = not_finite_ = 0; }

 private:
  explicit ChannelAssignment(std::string text) : text_(std::move(text)) {}
  void applyBlock(std::byte* rows, std::size_t count);
  void store(const RowProperty& property, double value, std::byte* row);

  std::string text_;
  char operation_ = '=';  // or the sign before it
  std::vector<RowProperty> targets_;
  std::vector<RowExpression> values_;  // of each target
  std::optional<RowExpression> condition_;
  std::size_t row_bytes_ = 0;
  RowExpression::Workspace workspace_;
  std::vector<std::array<double, kFilterRows>> results_;
  std::uint64_t seen_ = 0, changed_ = 0;        // records
  std::uint64_t clamped_ = 0, not_finite_ = 0;  // values
};

}  // namespace surfeit
