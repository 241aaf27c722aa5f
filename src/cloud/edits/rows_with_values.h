// Rows of a cloud with values behind them, as receivers get what was gathered or looked up.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "cloud/rows/row_layout.h"

namespace surfeit {

// The scalars of the input row, then the values as floats. A property that the input has under the
// name of a value is replaced where it stands. Immutable.
class RowsWithValues {
 public:
  RowsWithValues(const RowLayout& input, const std::vector<std::string>& values);

  const std::vector<RowProperty>& properties() const { return properties_; }
  std::size_t rowBytes() const { return row_bytes_; }
  // Makes one row of rowBytes() at `output`.
  void make(const std::byte* input, const float* values, std::byte* output) const;

 private:
  struct Copy {  // bytes of the input row that stay as they are
    std::size_t from, to, bytes;
  };
  struct Insert {
    std::size_t value, to;
  };
  void add(RowProperty property);
  void addCopy(const Copy& copy);

  std::vector<RowProperty> properties_;
  std::vector<Copy> copies_;
  std::vector<Insert> inserts_;
  std::size_t row_bytes_ = 0;
};

}  // namespace surfeit
