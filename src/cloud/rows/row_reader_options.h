// How a cloud is opened, whatever its format.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cloud/rows/channels.h"
#include "cloud/rows/filtered_reader.h"
#include "storage/positional_file.h"
#include "surfeit/color_range.h"

namespace surfeit {

// First bytes of a file, by which formats are told apart.
inline constexpr std::size_t kMagicBytes = 4096;

struct RowReaderOptions {
  std::vector<ChannelRename> channels;
  // kDirect: raw records of fixed size go past the page cache, where format and system allow.
  Access access = Access::kCached;
  // For formats with several parts (grids of a .vdb, layers of an .exr, elements of a .ply): the
  // one to read, by name. Empty: the first that holds a cloud.
  std::string part;
  // Which rows are read (cloud/rows/row_filter.h), under the names that `channels` give. Empty: all
  // but those that the format marks as not to be used.
  std::string filter;
  // For files that are opened more than once with the same options, so that a filter counts once.
  std::shared_ptr<RowSelections> selections;
  // How colors are read (cloud/edits/color_reader.h); nothing: their numbers stay as the file has
  // them.
  std::optional<ColorRange> color_range = ColorRange::kAuto;
};

}  // namespace surfeit
