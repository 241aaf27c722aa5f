// What PRT files of all versions have in common: records of typed channels, and how they become
// rows.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "cloud/parts/stored_values.h"
#include "cloud/rows/row_layout.h"
#include "surfeit/status.h"

namespace surfeit {

struct PrtChannel {
  std::string name;
  StoredType type = StoredType::kFloat32;
  std::size_t arity = 1;   // values
  std::size_t offset = 0;  // in a record
};

// The longest record that is read; real ones have a few hundred bytes.
inline constexpr std::size_t kMaxPrtRecordBytes = 16 << 10;
// The most values of a channel.
inline constexpr std::size_t kMaxPrtArity = 256;

// A record as its channels describe it. Immutable once made.
class PrtLayout {
 public:
  // Channels may lie in any order, and need not fill the record. Adds their properties to
  // `element`, after `renames`, and to `notes` what they cannot keep. kCorruption, naming `path`,
  // when there is no channel, one has too many values, the record is longer than
  // kMaxPrtRecordBytes or a property comes twice.
  static Result<PrtLayout> create(std::span<const PrtChannel> channels,
                                  std::span<const ChannelRename> renames, const std::string& path,
                                  RowLayout& element, std::vector<std::string>& notes);

  // Of a record: up to the end of its last channel.
  std::size_t recordBytes() const { return record_bytes_; }
  // Decodes `count` records to rows.
  void decode(const std::byte* records, std::size_t count, std::byte* rows) const;

 private:
  struct Copy {
    StoredPlace place;
    std::size_t from = 0, to = 0;
  };

  std::size_t record_bytes_ = 0, row_bytes_ = 0;
  std::vector<Copy> copies_;
};

}  // namespace surfeit
