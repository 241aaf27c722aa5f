// Where a value stands in a packed row, and how it is read.
#pragma once

#include <cstddef>
#include <cstring>
#include <string_view>

#include "io/ply_format.h"

namespace surfeit {

// A scalar property of a row, or its absence. Immutable; safe from any thread.
struct RowField {
  std::ptrdiff_t offset = -1;
  PlyType type = PlyType::kFloat32;

  // The scalar property of that name; absent when there is none.
  static RowField find(const PlyElement& element, std::string_view name) {
    const PlyProperty* property = element.find(name);
    if (property == nullptr || property->is_list) return {};
    return {std::ptrdiff_t(property->offset), property->type};
  }

  bool exists() const { return offset >= 0; }

  // The value in a row; requires exists().
  double read(const std::byte* row) const {
    if (type == PlyType::kFloat32) {  // nearly every property of nearly every cloud
      float value;
      std::memcpy(&value, row + offset, sizeof(value));
      return double(value);
    }
    return plyValue(row + offset, type);
  }
};

}  // namespace surfeit
