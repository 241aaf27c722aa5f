#include "index/rows/column_copies.h"

#include <fmt/format.h>

#include <cstdint>
#include <cstring>
#include <string_view>
#include <unordered_set>
#include <utility>

namespace surfeit {
namespace {

static_assert(int(ColumnType::kFloat64) == int(ValueType::kFloat64) &&
              int(ColumnType::kUint16) == int(ValueType::kUint16));

// A constant length makes each copy one move.
template <std::size_t size>
void copyValues(const std::byte* from, std::ptrdiff_t from_stride, std::byte* to,
                std::ptrdiff_t to_stride, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) {
    std::memcpy(to, from, size);
    from += from_stride;
    to += to_stride;
  }
}

}  // namespace

Result<RowLayout> layoutOf(const std::vector<CloudColumn>& columns, const std::string& subject) {
  if (columns.empty()) {
    return Status::invalidArgument(fmt::format("{}: no columns, expected some", subject));
  }
  RowLayout layout;
  layout.name = "row";
  std::unordered_set<std::string_view> names;
  for (const CloudColumn& column : columns) {
    if (!isPropertyName(column.name)) {
      return Status::invalidArgument(fmt::format("{}: column {}, expected a word of 1 to 64 bytes",
                                                 subject, quoteText(column.name)));
    }
    if (!names.insert(column.name).second) {
      return Status::invalidArgument(
          fmt::format("{}: column {} is there twice", subject, quoteText(column.name)));
    }
    RowProperty property;
    property.name = column.name;
    property.type = static_cast<ValueType>(column.type);
    layout.properties.push_back(std::move(property));
  }
  packRow(layout);
  return layout;
}

void copyColumn(const std::byte* from, std::ptrdiff_t from_stride, std::byte* to,
                std::ptrdiff_t to_stride, std::size_t size, std::size_t count) {
  switch (size) {
    case 1:
      return copyValues<1>(from, from_stride, to, to_stride, count);
    case 2:
      return copyValues<2>(from, from_stride, to, to_stride, count);
    case 4:
      return copyValues<4>(from, from_stride, to, to_stride, count);
    default:
      return copyValues<8>(from, from_stride, to, to_stride, count);
  }
}

void packRows(const RowLayout& layout, const ColumnValues* values, std::size_t first,
              std::size_t count, std::byte* rows) {
  for (std::size_t i = 0; i < layout.properties.size(); ++i) {
    const RowProperty& property = layout.properties[i];
    const auto* const from = static_cast<const std::byte*>(values[i].data) +
                             static_cast<std::ptrdiff_t>(first) * values[i].stride;
    copyColumn(from, values[i].stride, rows + property.offset,
               static_cast<std::ptrdiff_t>(layout.row_bytes), valueTypeBytes(property.type), count);
  }
}

}  // namespace surfeit
