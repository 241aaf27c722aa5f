#include "cloud/parts/column_rows.h"

#include <algorithm>
#include <utility>

namespace surfeit {
namespace {

constexpr std::size_t kAllWindowsBytes = 4 << 20;
constexpr std::size_t kLeastWindowBytes = 16 << 10, kMostWindowBytes = 256 << 10;
constexpr std::size_t kBlockRows = 4096;

// Of the rows of a page.
bool isConstant(const ColumnPages& pages, std::size_t slice, std::uint64_t page) {
  return !pages.constant.empty() && !pages.constant[slice].empty() && pages.constant[slice][page];
}

std::uint64_t pageBytes(const Column& column, std::uint64_t page, std::uint64_t page_rows) {
  std::uint64_t values = 0;
  for (std::size_t slice = 0; slice < column.pages->slices.size(); ++slice) {
    values +=
        column.pages->slices[slice] * (isConstant(*column.pages, slice, page) ? 1 : page_rows);
  }
  return values * storedBytes(column.type);
}

}  // namespace

std::uint64_t Column::bytes(std::uint64_t rows) const {
  if (!pages || pages->constant.empty()) return rows * tupleBytes();
  std::uint64_t sum = 0;
  for (std::uint64_t page = 0, begin = 0; begin < rows; ++page, begin += pages->rows) {
    sum += pageBytes(*this, page, std::min(pages->rows, rows - begin));
  }
  return sum;
}

void ColumnRowReader::addColumn(Column column) {
  OpenColumn open;
  open.page_offset = column.offset;
  open.column = std::move(column);
  columns_.push_back(std::move(open));
}

Result<const std::byte*> ColumnRowReader::readBytes(OpenColumn& open, std::uint64_t offset,
                                                    std::size_t size) {
  if (offset >= open.window_begin && size <= open.window.size() &&
      offset - open.window_begin <= open.window.size() - size) {
    return open.window.data() + (offset - open.window_begin);
  }
  // Ahead, as far as there is anything
  const bool is_spooled = open.column.is_spooled;
  const std::uint64_t end = is_spooled ? spool_->size() : input_.size();
  const std::size_t ahead = std::clamp(kAllWindowsBytes / std::max<std::size_t>(1, columns_.size()),
                                       kLeastWindowBytes, kMostWindowBytes);
  const auto window = static_cast<std::size_t>(
      std::max<std::uint64_t>(size, std::min<std::uint64_t>(ahead, end - std::min(end, offset))));
  Result<Bytes> view = is_spooled ? spool_->readView(offset, window, open.buffer)
                                  : input_.readView(offset, window, open.buffer);
  open.window = {};
  SURFEIT_RETURN_IF_ERROR(view.status());
  open.window = *view;
  open.window_begin = offset;
  return open.window.data();
}

Status ColumnRowReader::decodeFixed(OpenColumn& open, std::uint64_t row, std::size_t count,
                                    std::byte* rows) {
  const Column& column = open.column;
  const std::size_t stride = column.tupleBytes();
  const std::size_t block = std::max<std::size_t>(1, kMostWindowBytes / 2 / stride);
  const StoredPlace place{column.type, column.is_swapped, column.used_components, stride};
  for (std::size_t done = 0; done < count;) {
    const std::size_t step = std::min(count - done, block);
    SURFEIT_ASSIGN_OR_RETURN(const std::byte* bytes,
                             readBytes(open, column.offset + (row + done) * stride, step * stride));
    decodeStored(place, bytes, step, rows + done * element_.row_bytes + column.to,
                 element_.row_bytes);
    done += step;
  }
  return {};
}

Status ColumnRowReader::decodePaged(OpenColumn& open, std::uint64_t row, std::size_t count,
                                    std::byte* rows) {
  const Column& column = open.column;
  const ColumnPages& pages = *column.pages;
  const std::size_t value_bytes = storedBytes(column.type);
  const std::size_t row_value_bytes = valueTypeBytes(plyTypeOf(column.type));
  for (std::size_t done = 0; done < count;) {
    // The page that has the row
    const std::uint64_t page = (row + done) / pages.rows;
    if (page < open.page) {
      open.page = 0;
      open.page_offset = column.offset;
    }
    for (; open.page < page; ++open.page) {
      open.page_offset += pageBytes(column, open.page, pages.rows);
    }
    const std::uint64_t page_begin = page * pages.rows;
    const std::uint64_t page_rows = std::min(pages.rows, element_.count - page_begin);
    const std::uint64_t in_page = row + done - page_begin;
    const auto step = static_cast<std::size_t>(
        std::min<std::uint64_t>({count - done, page_rows - in_page, kBlockRows}));

    // Its slices
    std::uint64_t offset = open.page_offset;
    std::size_t component = 0;
    for (std::size_t slice = 0; slice < pages.slices.size(); ++slice) {
      const std::size_t slice_bytes = pages.slices[slice] * value_bytes;
      const bool is_constant = isConstant(pages, slice, page);
      const std::size_t used =
          std::min(pages.slices[slice],
                   column.used_components - std::min(column.used_components, component));
      if (used > 0) {
        SURFEIT_ASSIGN_OR_RETURN(const std::byte* bytes,
                                 readBytes(open, offset + (is_constant ? 0 : in_page * slice_bytes),
                                           (is_constant ? 1 : step) * slice_bytes));
        const StoredPlace place{column.type, column.is_swapped, used,
                                is_constant ? 0 : slice_bytes};
        decodeStored(place, bytes, step,
                     rows + done * element_.row_bytes + column.to + component * row_value_bytes,
                     element_.row_bytes);
      }
      offset += (is_constant ? 1 : page_rows) * slice_bytes;
      component += pages.slices[slice];
    }
    done += step;
  }
  return {};
}

Status ColumnRowReader::decodeRows(std::size_t count, std::byte* rows) {
  // Blocks of rows stay in the second cache until all columns are in them
  const std::uint64_t first_row = row();
  for (std::size_t done = 0; done < count;) {
    const std::size_t step = std::min(count - done, kBlockRows);
    std::byte* const block = rows + done * element_.row_bytes;
    for (OpenColumn& open : columns_) {
      SURFEIT_RETURN_IF_ERROR(open.column.pages ? decodePaged(open, first_row + done, step, block)
                                                : decodeFixed(open, first_row + done, step, block));
    }
    done += step;
  }
  return {};
}

}  // namespace surfeit
