// How OpenVDB packs bytes: blosc or zlib frames, and the values of a node with or without those
// that are inactive.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cloud/rows/row_layout.h"
#include "cloud/vdb/vdb_cursor.h"
#include "surfeit/status.h"

namespace surfeit {

// Flags of a grid's compression word.
inline constexpr std::uint32_t kVdbZip = 1, kVdbActiveMask = 2, kVdbBlosc = 4;

// The identifier of a file, which nobody reads.
inline constexpr std::size_t kVdbUuidBytes = 36;

// Flags of the array of an attribute, and of how it is written.
inline constexpr std::uint8_t kVdbConstantStride = 0x8;
inline constexpr std::uint8_t kVdbStrided = 0x1, kVdbUniform = 0x2, kVdbPackedInMemory = 0x4,
                              kVdbPaged = 0x8;

// The array of an attribute in a leaf may take this, read or written: 44 million positions. The
// format has it packed and unpacked as a whole.
inline constexpr std::uint64_t kVdbMaxArrayBytes = std::uint64_t{1} << 29;

// The value of a voxel.
struct VdbValueType {
  ValueType type = ValueType::kFloat32;  // of a component, decoded
  std::size_t components = 1;
  std::size_t bytes = 4;         // of a value, decoded
  std::size_t stored_bytes = 4;  // in the buffers of nodes; less than `bytes` for half floats
  bool is_half = false;          // stored as half floats
};

// Unpacks a blosc frame into `bytes`. Frames of less than 128 bytes may be padded to that. False
// when the frame is damaged or of another size.
bool unpackBlosc(Bytes frame, std::span<std::byte> bytes);
// Packs bytes as a blosc frame of values of `value_bytes` bytes, at the end of `frame`; returns the
// size of the frame, at most 16 bytes more than that of the bytes. The same for the same bytes.
std::size_t packBlosc(Bytes bytes, std::size_t value_bytes, std::vector<std::byte>& frame);

// Reads `bytes`, packed as `compression` says.
Status readVdbData(VdbCursor& cursor, std::uint32_t compression, std::span<std::byte> bytes);

// Reads the values of a node of 64 * mask.size() of them: those that are active by `mask`, in
// order, to the front of `values`, which grows to hold `type.bytes` for each.
Status readVdbActiveValues(VdbCursor& cursor, std::uint32_t compression, const VdbValueType& type,
                           std::span<const std::uint64_t> mask, std::vector<std::byte>& values);

// Turns half floats at `halves` into floats or doubles.
void expandHalves(const std::byte* halves, std::size_t count, ValueType type, std::byte* values);

}  // namespace surfeit
