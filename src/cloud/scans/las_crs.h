// The coordinate reference system of a LAS file, as text that clouds of any format carry along:
// "crs PROJCS[...]" for well-known text, "crs EPSG:2992" for GeoTIFF keys.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "storage/byte_input.h"

namespace surfeit {

// Gathers what the records of LASF_Projection say. Damaged ones say nothing.
class LasCrs {
 public:
  void add(std::uint16_t record_number, Bytes data);
  // At most one for the text and one for the keys.
  std::vector<std::string> comments() const;

 private:
  std::string keysComment() const;

  std::string text_;
  std::vector<std::uint16_t> keys_;
  std::string key_text_;
};

// The data of a record of LASF_Projection.
struct LasCrsRecord {
  std::uint16_t number = 0;
  std::vector<std::byte> data;
};
// What the first of the comments that tells of coordinates becomes in a file; nothing when none
// does, or not in a way that LAS knows.
std::optional<LasCrsRecord> lasCrsRecord(std::span<const std::string> comments);

}  // namespace surfeit
