#include "cloud/edits/color_sample.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <type_traits>

#include "cloud/rows/number_change.h"

namespace surfeit {
namespace {

constexpr std::size_t kPlaces = 1024, kRowsOfPlace = 64;
// Larger numbers need more than 12 bits.
constexpr double kMostOfCameras = 4095;
constexpr std::size_t kPassBytes = 256 << 10;

void addValues(const std::byte* rows, std::size_t count, std::size_t row_bytes,
               const RowProperty& property, ColorSample& sample) {
  visitValueType(property.type, [&]<typename T>(std::type_identity<T>) {
    const std::byte* at = rows + property.offset;
    for (std::size_t i = 0; i < count; ++i, at += row_bytes) {
      T stored;
      std::memcpy(&stored, at, sizeof stored);
      const double value = static_cast<double>(stored);
      ++sample.seen;
      if constexpr (std::is_floating_point_v<T>) {
        const auto bits = std::bit_cast<std::uint32_t>(static_cast<float>(stored));
        sample.no_colors += bits == kNoPackedColor ? 1 : 0;
        if (!std::isfinite(value)) {
          sample.has_non_finite = true;
          continue;
        }
        sample.are_wholes = sample.are_wholes && value == std::floor(value);
        sample.digits.add(value);
      }
      sample.least = std::min(sample.least, value);
      sample.largest = std::max(sample.largest, value);
      if (value > 0) {
        sample.sum_of_positive += value;
        ++sample.positive;
      }
    }
  });
}

bool isSettled(const ColorSample& sample) {
  if (sample.is_decided) return true;
  if (sample.ends_with_light) return sample.largest > (sample.type == ValueType::kUint8 ? 1 : 0);
  if (isFloatType(sample.type)) return !sample.are_wholes;
  return sample.largest > (valueTypeBytes(sample.type) <= 2 ? kMostOfCameras : 65535);
}

void addRows(const RowReader& reader, Bytes rows, std::vector<ColorSample>& samples) {
  const RowLayout& element = reader.element();
  for (ColorSample& sample : samples) {
    for (const std::size_t i : sample.properties) {
      addValues(rows.data(), rows.size() / element.row_bytes, element.row_bytes,
                element.properties[i], sample);
    }
    if (sample.alpha == nullptr) continue;
    ColorSample alpha;
    addValues(rows.data(), rows.size() / element.row_bytes, element.row_bytes, *sample.alpha,
              alpha);
    sample.largest_alpha = std::max(sample.largest_alpha, alpha.largest);
  }
}

}  // namespace

Result<bool> sampleColors(RowReader& reader, std::vector<ColorSample>& samples) {
  const std::uint64_t count = reader.element().count;
  const bool takes_places = reader.isSeekable() && count > kPlaces * kRowsOfPlace;
  const std::uint64_t step = takes_places ? (count - kRowsOfPlace) / (kPlaces - 1) : 0;
  // Rows may be long: hostile ones a MiB
  const std::size_t most_rows =
      std::max<std::size_t>(1, kPassBytes / std::max<std::size_t>(1, reader.element().row_bytes));
  const std::size_t rows_at_once = takes_places ? std::min(kRowsOfPlace, most_rows) : most_rows;
  AlignedBuffer buffer;
  bool is_whole = !takes_places;
  for (std::uint64_t place = 0; !takes_places || place < kPlaces; ++place) {
    if (takes_places && !reader.seekRow(place * step).ok()) break;
    const Result<Bytes> rows = reader.readRows(rows_at_once, buffer);
    if (!rows.ok() || rows->empty()) break;
    addRows(reader, *rows, samples);
    if (std::all_of(samples.begin(), samples.end(), isSettled)) {
      is_whole = false;
      break;
    }
  }
  SURFEIT_RETURN_IF_ERROR(reader.rewind());
  return is_whole;
}

}  // namespace surfeit
