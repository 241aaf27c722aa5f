// Where a value stands in a packed row, and how it is read.
#pragma once

#include <cstddef>
#include <cstring>
#include <string_view>

#include "cloud/rows/row_layout.h"

namespace surfeit {

// A scalar property of a row, or its absence. Immutable; safe from any thread.
struct RowField {
  std::ptrdiff_t offset = -1;
  ValueType type = ValueType::kFloat32;

  // The scalar property of that name; absent when there is none.
  static RowField find(const RowLayout& element, std::string_view name) {
    const RowProperty* property = element.find(name);
    if (property == nullptr || property->is_list) return {};
    return {std::ptrdiff_t(property->offset), property->type};
  }

  bool exists() const { return offset >= 0; }

  // The value in a row; requires exists().
  double read(const std::byte* row) const {
    if (type == ValueType::kFloat32) {  // nearly every property of nearly every cloud
      float value;
      std::memcpy(&value, row + offset, sizeof(value));
      return double(value);
    }
    return rowValue(row + offset, type);
  }
};

}  // namespace surfeit
