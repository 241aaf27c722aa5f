#include "io/row_reader.h"

#include <fmt/format.h>

namespace surfeit {

Status RowReader::seekRow(std::uint64_t row) {
  return Status::invalidArgument(fmt::format(
      "{}: seek to row {}, but {} can only be read from its start", path(), row, formatName()));
}

}  // namespace surfeit
