// Which channels of an OpenEXR picture are what: from their names to the rows of
// cloud/exr/exr_reader.h. Names alone; no file is touched.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cloud/rows/channels.h"
#include "cloud/rows/row_layout.h"
#include "surfeit/status.h"

namespace surfeit {

// A channel of the file.
struct ExrSource {
  std::size_t part = 0;
  std::string channel;  // as the part calls it
  std::string name;     // with the layer that the part is: "P.X" for X of the part P
  bool is_integer = false;
  bool is_half = false;
};

// A channel that is decoded.
struct ExrColumn {
  std::size_t source = 0;
  bool is_integer = false;              // decoded as uint32, else as float
  std::optional<std::size_t> property;  // of the rows; nothing: only the mask needs it
};

struct ExrLayout {
  RowLayout element;  // without a count: x y z, nx ny nz, pixel_x pixel_y, the others
  std::vector<ExrColumn> columns;
  // Indices of columns
  std::array<std::size_t, 3> position{};
  bool is_position_half = false;  // of one coordinate at least
  std::optional<std::array<std::size_t, 3>> normal;
  std::optional<std::size_t> alpha, depth;
  // Properties pixel_x and pixel_y
  std::size_t pixel = 0;
  std::vector<std::string> notes;
};

// The name of a channel in a part: where a file keeps every layer in a part of its own, bare
// channels (R, X, x, ...) take the part's name for their layer. The first part keeps them bare
// unless its name is that of a position or a normal.
std::string exrLayerName(const std::string& channel, const std::string& part, bool is_first_part,
                         std::span<const ChannelRename> renames);

// kCorruption when there is no position, with the channels there are. R, G and B are left out when
// `main_layer` names a layer that is there: they are a copy of it.
Result<ExrLayout> layOutExr(std::span<const ExrSource> sources,
                            std::span<const ChannelRename> renames, const std::string& main_layer,
                            const std::string& path);

// Whether layOutExr would find a position.
bool hasExrPosition(std::span<const ExrSource> sources, std::span<const ChannelRename> renames);

}  // namespace surfeit
