// Channels of rows as attributes of OpenVDB points.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "cloud/rows/channels.h"
#include "cloud/rows/row_layout.h"

namespace surfeit {

// A channel as an attribute: its type, and how values of rows become those of that type.
struct VdbWrittenAttribute {
  enum class Kind { kPosition, kCopy, kInt16, kInt32, kInt64, kFloat };
  RowChannel channel;
  std::string name, value_type;
  Kind kind = Kind::kCopy;
  std::size_t component_bytes = 4;
  std::uint32_t stride = 1;  // values per point, where there is no type for so many components

  std::size_t pointBytes() const { return component_bytes * channel.properties.size(); }
};

// By the names and types of cloud/vdb/vdb_writer.h.
VdbWrittenAttribute vdbWrittenAttribute(const RowChannel& channel, const RowLayout& element);

// Writes the values of a row's channel, all but positions, pointBytes() at `out`.
void encodeVdbPoint(const VdbWrittenAttribute& attribute, const RowLayout& element,
                    const std::byte* row, std::byte* out);

}  // namespace surfeit
