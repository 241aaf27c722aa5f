// Values of rows to and from columns anywhere in memory.
#pragma once

#include <cstddef>
#include <vector>

#include "cloud/rows/row_layout.h"
#include "surfeit/cloud_rows.h"
#include "surfeit/status.h"

namespace surfeit {

// The properties of such columns, packed. kInvalidArgument, beginning with `subject`, without a
// column, for names that are none or that occur twice.
Result<RowLayout> layoutOf(const std::vector<CloudColumn>& columns, const std::string& subject);

// `count` values of `size` bytes from one place to another.
void copyColumn(const std::byte* from, std::ptrdiff_t from_stride, std::byte* to,
                std::ptrdiff_t to_stride, std::size_t size, std::size_t count);

// Packs rows `first` to `first` + `count` - 1.
void packRows(const RowLayout& layout, const ColumnValues* values, std::size_t first,
              std::size_t count, std::byte* rows);

}  // namespace surfeit
