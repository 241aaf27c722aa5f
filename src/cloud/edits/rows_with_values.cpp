#include "cloud/edits/rows_with_values.h"

#include <algorithm>
#include <cstring>
#include <utility>

namespace surfeit {

RowsWithValues::RowsWithValues(const RowLayout& input, const std::vector<std::string>& values) {
  std::vector<bool> is_placed(values.size(), false);
  for (RowProperty property : input.properties) {
    if (property.is_list) continue;
    const auto value = std::find(values.begin(), values.end(), property.name);
    if (value == values.end()) {
      addCopy({property.offset, row_bytes_, valueTypeBytes(property.type)});
    } else {
      const auto number = static_cast<std::size_t>(value - values.begin());
      is_placed[number] = true;
      inserts_.push_back({number, row_bytes_});
      property.type = ValueType::kFloat32;
    }
    add(std::move(property));
  }
  for (std::size_t number = 0; number < values.size(); ++number) {
    if (is_placed[number]) continue;
    inserts_.push_back({number, row_bytes_});
    RowProperty property;
    property.name = values[number];
    add(std::move(property));
  }
}

void RowsWithValues::add(RowProperty property) {
  property.offset = row_bytes_;
  row_bytes_ += valueTypeBytes(property.type);
  properties_.push_back(std::move(property));
}

// Values that are neighbours in input and output are copied at once.
void RowsWithValues::addCopy(const Copy& copy) {
  if (!copies_.empty()) {
    Copy& last = copies_.back();
    if (last.from + last.bytes == copy.from && last.to + last.bytes == copy.to) {
      last.bytes += copy.bytes;
      return;
    }
  }
  copies_.push_back(copy);
}

void RowsWithValues::make(const std::byte* input, const float* values, std::byte* output) const {
  for (const Copy& copy : copies_) std::memcpy(output + copy.to, input + copy.from, copy.bytes);
  for (const Insert& insert : inserts_) {
    std::memcpy(output + insert.to, &values[insert.value], sizeof(float));
  }
}

}  // namespace surfeit
