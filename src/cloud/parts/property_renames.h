// Renames of properties (ChannelRename) for formats whose channels are single values (PLY, PCD,
// xyz).
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include "cloud/rows/channels.h"
#include "cloud/rows/row_layout.h"
#include "surfeit/status.h"

namespace surfeit {

// The scalar properties of `element` after renames of whole channels (color=albedo) and of single
// properties (curvature=weight), with what the user typed; without names where they are lists or
// dropped. Names may come out twice.
std::vector<RowProperty> renamedProperties(const RowLayout& element,
                                           std::span<const ChannelRename> renames);

// The element with these names, without lists and what is dropped; places in a row stay the same.
// kCorruption when a name is taken twice.
Result<RowLayout> renamedElement(const RowLayout& original, std::span<const ChannelRename> renames,
                                 const std::string& path);

// Gives names that come again a number. In constant time each: a damaged header may name thousands
// of properties alike.
class DistinctNames {
 public:
  // `name`, or name_2, name_3, ... when it has been returned before; at most 64 characters, of
  // `name` as many where it is not changed.
  std::string add(const std::string& name);

 private:
  std::unordered_set<std::string> taken_;
  std::unordered_map<std::string, std::uint64_t> next_twin_;  // of what comes before the number
};

}  // namespace surfeit
