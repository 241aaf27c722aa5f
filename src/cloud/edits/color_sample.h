// What the numbers of a color are like, by a sample of the whole cloud.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "cloud/rows/packed_colors.h"
#include "cloud/rows/row_layout.h"
#include "cloud/rows/row_reader.h"
#include "surfeit/status.h"

namespace surfeit {

inline constexpr const char* kOpacity = "opacity";

// The properties of a color or the like, and what was seen of their values.
struct ColorSample {
  std::string channel;  // color, radiosity, albedo, normal, opacity; else of one property: packed
  std::vector<std::size_t> properties;  // indices into the element's
  ValueType type = ValueType::kUint8;   // the widest of them
  bool is_decided = false;              // whatever its values are
  bool ends_with_light = false;         // at a value above 0, of bytes above 1
  const RowProperty* alpha = nullptr;   // beside it, whose white is that of the color

  double least = std::numeric_limits<double>::infinity();
  double largest = -std::numeric_limits<double>::infinity();
  double sum_of_positive = 0;
  std::uint64_t positive = 0;
  bool are_wholes = true;
  bool has_non_finite = false;
  std::uint64_t seen = 0, no_colors = 0;  // values; reals among them whose bits are kNoPackedColor
  double largest_alpha = 0;
  LostDigits digits = {};  // of one packed number

  bool isOpacity() const { return channel == kOpacity; }
  bool isPacked() const { return properties.size() == 1 && !isOpacity(); }
  bool hasLight() const { return positive > 0 || least < 0; }
  double meanOfPositive() const { return positive > 0 ? sum_of_positive / double(positive) : 0; }
  bool areBytes() const { return are_wholes && least >= 0 && largest <= 255; }
};

// Looks at the rows and goes back to the first. Returns whether all rows were seen: of long clouds
// a sample of many places is enough, and reading ends when nothing is left to find out (reals that
// are no whole numbers, integers that need all their bits). What cannot be read counts as the end:
// whoever reads the rows is told.
Result<bool> sampleColors(RowReader& reader, std::vector<ColorSample>& samples);

}  // namespace surfeit
