// Names of channels across formats. Formats with typed channels (PTC, PRT, Houdini's, OpenVDB, EXR)
// call the same things by different names and group values in vectors; rows have scalar properties
// under the names of docs/files.md. Here one becomes the other, for every format alike.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cloud/rows/row_layout.h"
#include "surfeit/job.h"
#include "surfeit/status.h"

namespace surfeit {

enum class ChannelKind { kFloat, kPoint, kVector, kNormal, kColor, kMatrix };

// What a user says with --channels: the channel `from` of a file is read as `to`, which is a
// channel's name as we write it: position, normal, radius, area, radiosity, albedo, color, view,
// occlusion, ... or any other; "-" drops the channel.
struct ChannelRename {
  std::string from, to;
};
// Parses "from=to,from=to", where kTextChannel (surfeit/job.h) may stand in place of a channel;
// kInvalidArgument naming the part that is not of that form.
Result<std::vector<ChannelRename>> parseChannelRenames(std::string_view text);

// Properties of a channel named `name` in a file, `components` values each, after the renames and
// the table of well-known names (P, N, pscale, Cd, _area, _radiosity, Position, ...; exact case
// first, then any case): x y z for a position, nx ny nz, radius, red green blue, radiosity_r _g _b,
// velocity_x _y _z. Unknown names keep their letters, made fit for a property; three values get _r
// _g _b when `kind` is a color, else _x _y _z; other numbers _0, _1, ... Empty when the channel is
// dropped.
std::vector<std::string> propertyNames(std::string_view name, std::size_t components,
                                       ChannelKind kind, std::span<const ChannelRename> renames);

// Whether a channel of our name means something to us (docs/files.md, "Channels").
bool isKnownChannel(std::string_view name);

// Appends the properties of such a channel to an element, all of one type, and packs them after
// what is there (offsets and row_bytes). kCorruption when a name is taken twice, naming `path` and
// the channel.
Status addChannel(std::string_view name, std::size_t components, ChannelKind kind, ValueType type,
                  std::span<const ChannelRename> renames, const std::string& path,
                  RowLayout& element);

// What FROM of `--channels FROM=TO` must be for a channel (normal) or a property (alpha) of rows:
// their names, unless the file or the user calls them otherwise. Several where the properties of a
// channel have names of their own.
std::vector<std::string> typedNames(const RowLayout& element, std::string_view name);
// The same as one that drops them: "normal=-", "NormalX=-,NormalY=-,NormalZ=-". Empty where they
// are made of others, so that none does.
std::string dropsOf(const RowLayout& element, std::string_view name);
// The same as one that reads a channel of three values as another such channel: "Cd=radiosity",
// "r=radiosity_r,g=radiosity_g,b=radiosity_b".
std::string renamingOf(const RowLayout& element, std::string_view name, std::string_view to);

// Values of a row that belong together.
struct RowChannel {
  std::string name;  // position, normal, radius, radiosity, color, velocity, anything_else
  ChannelKind kind = ChannelKind::kFloat;
  std::vector<std::size_t> properties;   // indices into the element's, in order of components
  ValueType type = ValueType::kFloat32;  // the widest of its properties
};
// The channels of a row, in order of their first property: the inverse of addChannel. Triples that
// are not complete are single values.
std::vector<RowChannel> channelsOf(const RowLayout& element);

// Whether the values are integers of 8 or 16 bits that code sRGB: a color, radiosity or albedo
// (docs/format.md).
bool isCodedColor(const RowChannel& channel);

// A value of a row as a double; those of coded colors as scene-linear values from 0 to 1.
double channelValue(const RowLayout& element, const RowChannel& channel, std::size_t component,
                    const std::byte* row);

}  // namespace surfeit
