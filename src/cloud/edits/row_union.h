// Rows of several clouds as rows of one: the properties of all, by name, and how the rows of each
// become such rows.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "cloud/rows/row_layout.h"

namespace surfeit {

// The properties of all elements that were added: in the order in which they first come, each of
// the widest of its types. Lists are left out. One thread at a time.
class RowUnion {
 public:
  void add(const RowLayout& element);
  const std::vector<RowProperty>& properties() const { return properties_; }

 private:
  std::vector<RowProperty> properties_;
};

// Copies rows of one layout to another, by the names of properties. Bytes that keep their type stay
// as they are. Integers of 8 and 16 bits of a color (cloud/rows/channels.h) code sRGB: as floats
// they become scene-linear values from 0 to 1, and 8 bits as 16 the same shade. Immutable; safe
// from any thread.
class RowCopier {
 public:
  // Properties that `to` lacks are left out. Those that only `to` has become what their absence
  // means: opacity (of a color: the one of all colors), coverage and alpha are full, radiosity and
  // albedo are the color where `from` has one, all others are 0. Those that both have must be of a
  // type in `to` that holds the values.
  RowCopier(const RowLayout& from, const RowLayout& to);

  // Properties that become 0, that are full, and that are the color.
  const std::vector<std::string>& absent() const { return absent_; }
  const std::vector<std::string>& full() const { return full_; }
  const std::vector<std::string>& colored() const { return colored_; }
  // Whether the rows are the same bytes either way.
  bool keepsRows() const;

  // Copies `count` rows, `step` rows apart from each other, one behind the other.
  void copy(const std::byte* from, std::size_t step, std::size_t count, std::byte* to) const;

 private:
  struct Run {  // bytes that stay as they are
    std::size_t from = 0, to = 0, bytes = 0;
  };
  struct Conversion {
    RowProperty from, to;
    std::vector<double> codes;  // of a color, by code; empty: numbers stay numbers
  };

  void addRun(const Run& run);
  void addCopy(const RowProperty& source, const RowProperty& target, bool is_color);
  bool addFull(const RowProperty& target);

  std::size_t from_bytes_, to_bytes_;
  std::vector<Run> runs_;
  std::vector<Conversion> conversions_;
  std::vector<RowProperty> filled_;  // with the value of full
  std::vector<std::string> absent_, full_, colored_;
};

}  // namespace surfeit
