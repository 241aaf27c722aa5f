// How rows become points of a LAS file: the version, the point format, and where in a record each
// property goes; what no field of LAS holds goes into extra bytes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "cloud/rows/row_layout.h"
#include "cloud/scans/las_format.h"
#include "cloud/scans/las_values.h"
#include "surfeit/status.h"

namespace surfeit {

// A property and the number of a record that it becomes.
struct LasColumn {
  enum class Coding : std::uint8_t {
    kValue,   // the number itself
    kShade,   // a color of 8 bits, as the same shade of 16
    kLinear,  // scene-linear light, as a shade of 16 bits
  };
  LasValue value;
  std::string property;
  Coding coding = Coding::kValue;
};

// What rows and the file that they come from ask of a LAS file.
struct LasWish {
  const RowLayout* element = nullptr;  // of the rows
  const LasHeader* like = nullptr;
  // Of the reader of `like`: properties that have the same type there have values of LAS.
  const RowLayout* like_element = nullptr;
  std::optional<std::uint64_t> count;
  bool prefers_keys = false;  // the coordinates are told by GeoTIFF keys, which old formats have
  // Properties whose values were found not to fit the field that LAS has for them.
  std::vector<std::string> misfits;
};

struct LasPlan {
  unsigned minor = 4, point_format = 6;
  std::size_t record_bytes = 0;
  std::vector<LasColumn> columns;  // but for the position
  std::array<RowProperty, 3> position;
  std::vector<std::byte> descriptors;  // of extra bytes
  // Of the point format: what is filled in, or set where a position is none
  LasField return_number, number_of_returns, withheld;
  bool has_returns = false;  // rows have numbers of returns
  // Columns whose values may not fit their fields, which only the rows can tell
  std::vector<std::size_t> doubtful;
  std::vector<std::string> notes;
};

// kInvalidArgument when rows have no position, or more than records can hold.
Result<LasPlan> planLas(const LasWish& wish, const std::string& path);

}  // namespace surfeit
