// Rows of a cloud that stand for all of it: its beginning, its end, and places at equal steps
// between.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "cloud/rows/row_reader.h"

namespace surfeit {

struct RowSampling {
  std::uint64_t places, rows_of_place;
};

// Calls see(rows) for rows at `sampling.places`, or for all where there are no more, or none can be
// sought. Ends where see returns false, or no more can be read; then rewinds.
template <typename See>
Status sampleRows(RowReader& reader, const RowSampling& sampling, const See& see) {
  constexpr std::size_t kMostBytes = 256 << 10;  // rows may be long: hostile ones a MiB
  const std::uint64_t row_count = reader.element().count;
  const auto [places, rows_of_place] = sampling;
  const bool takes_places = reader.isSeekable() && row_count > places * rows_of_place;
  const std::uint64_t step = takes_places ? (row_count - rows_of_place) / (places - 1) : 0;
  const std::size_t most = std::max<std::size_t>(1, kMostBytes / reader.element().row_bytes);
  const std::size_t at_once = takes_places ? std::min<std::size_t>(rows_of_place, most) : most;
  AlignedBuffer buffer;
  for (std::uint64_t place = 0; !takes_places || place < places; ++place) {
    if (takes_places && !reader.seekRow(place * step).ok()) break;
    const Result<Bytes> rows = reader.readRows(at_once, buffer);
    if (!rows.ok() || rows->empty() || !see(*rows)) break;
  }
  return reader.rewind();
}

}  // namespace surfeit
