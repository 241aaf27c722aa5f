#include "cloud/rows/row_expression.h"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace surfeit {
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

std::optional<double> RowExpression::constant() const {
  if (steps_.size() != 1 || steps_[0].operation != Operation::kNumber) return std::nullopt;
  return steps_[0].number;
}

std::span<const double> RowExpression::evaluate(const std::byte* rows, std::size_t row_bytes,
                                                std::size_t count, Workspace& workspace) const {
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
      case Operation::kMin:
        set([](double x, double y) { return y < x ? y : x; });
        break;
      case Operation::kMax:
        set([](double x, double y) { return y > x ? y : x; });
        break;
      case Operation::kPower:
        set([](double x, double y) { return std::pow(x, y); });
        break;
      case Operation::kAbs:
        set([](double x, double) { return std::abs(x); });
        break;
      case Operation::kRoot:
        set([](double x, double) { return std::sqrt(x); });
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
  return {workspace.data() + (steps_.size() - 1) * kFilterRows, count};
}

}  // namespace surfeit
