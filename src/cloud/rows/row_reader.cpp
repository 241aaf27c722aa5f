#include "cloud/rows/row_reader.h"

#include <fmt/format.h>

namespace surfeit {

Status RowReader::seekRow(std::uint64_t row) {
  return Status::invalidArgument(fmt::format(
      "{}: seek to row {}, but {} can only be read from its start", path(), row, formatName()));
}

Status checkChannelsLeft(const RowLayout& element, const std::string& path) {
  if (!element.properties.empty()) return {};
  return Status::invalidArgument(fmt::format("{}: every channel is dropped", path));
}

}  // namespace surfeit
