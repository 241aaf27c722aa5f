#include "cloud/vdb/vdb_coding.h"

#include <blosc.h>
#include <fmt/format.h>
#include <half.h>

#include <algorithm>
#include <bit>

#include "cloud/parts/zlib_stream.h"

namespace surfeit {
namespace {

// OpenVDB pads smaller frames to this.
constexpr std::size_t kBloscPadding = 128;

// What is said of the inactive values of a node, the byte in front of them. "Selected": a mask
// tells which of two values each inactive voxel has.
enum NodeValues : std::int8_t {
  kInactiveIsBackground = 0,
  kInactiveIsMinusBackground = 1,
  kInactiveIsOneValue = 2,
  kSelectedBackground = 3,
  kSelectedOneValue = 4,
  kSelectedTwoValues = 5,
  kAllValues = 6
};

}  // namespace

bool unpackBlosc(Bytes frame, std::span<std::byte> bytes) {
  std::size_t size = 0;
  if (frame.size() < BLOSC_MIN_HEADER_LENGTH) return false;
  if (blosc_cbuffer_validate(frame.data(), frame.size(), &size) < 0) return false;
  if (size == bytes.size()) {
    const int unpacked = blosc_decompress_ctx(frame.data(), bytes.data(), bytes.size(), 1);
    return unpacked >= 0 && static_cast<std::size_t>(unpacked) == bytes.size();
  }
  if (size < bytes.size() || size > kBloscPadding) return false;
  std::byte padded[kBloscPadding];
  if (blosc_decompress_ctx(frame.data(), padded, size, 1) != static_cast<int>(size)) return false;
  std::copy_n(padded, bytes.size(), bytes.data());
  return true;
}

std::size_t packBlosc(Bytes bytes, std::size_t value_bytes, std::vector<std::byte>& frame) {
  // Blosc shuffles the bytes of values of up to 255 bytes, and stores what does not shrink as it is
  const std::size_t begin = frame.size();
  frame.resize(begin + bytes.size() + BLOSC_MAX_OVERHEAD);
  const int packed = blosc_compress_ctx(5, BLOSC_SHUFFLE, value_bytes, bytes.size(), bytes.data(),
                                        frame.data() + begin, frame.size() - begin, "lz4", 0, 1);
  frame.resize(begin + static_cast<std::size_t>(std::max(packed, 0)));
  return frame.size() - begin;
}

Status readVdbData(VdbCursor& cursor, std::uint32_t compression, std::span<std::byte> bytes) {
  if ((compression & (kVdbZip | kVdbBlosc)) != 0) {
    // The size of the frame, or the negative size of what is stored as it is
    std::int64_t size = 0;
    SURFEIT_RETURN_IF_ERROR(cursor.read(size));
    if (size > 0) {
      const std::uint64_t most = bytes.size() + bytes.size() / 8 + 1024;
      if (static_cast<std::uint64_t>(size) > most) {
        return cursor.corrupt(fmt::format("{} bytes are packed into {}", bytes.size(), size));
      }
      SURFEIT_ASSIGN_OR_RETURN(const Bytes packed, cursor.take(static_cast<std::uint64_t>(size)));
      const bool ok =
          (compression & kVdbBlosc) != 0 ? unpackBlosc(packed, bytes) : inflateWhole(packed, bytes);
      return ok ? Status() : cursor.corrupt("compressed values do not unpack");
    }
    if (size != -static_cast<std::int64_t>(bytes.size())) {
      return cursor.corrupt(fmt::format("values of size {}, expected -{}", size, bytes.size()));
    }
  }
  SURFEIT_ASSIGN_OR_RETURN(const Bytes stored, cursor.take(bytes.size()));
  std::copy(stored.begin(), stored.end(), bytes.begin());
  return {};
}

void expandHalves(const std::byte* halves, std::size_t count, ValueType type, std::byte* values) {
  for (std::size_t i = 0; i < count; ++i) {
    std::uint16_t bits = 0;
    std::memcpy(&bits, halves + 2 * i, 2);
    const float value = imath_half_to_float(bits);
    if (type == ValueType::kFloat64) {
      const double wide = value;
      std::memcpy(values + 8 * i, &wide, 8);
    } else {
      std::memcpy(values + 4 * i, &value, 4);
    }
  }
}

Status readVdbActiveValues(VdbCursor& cursor, std::uint32_t compression, const VdbValueType& type,
                           std::span<const std::uint64_t> mask, std::vector<std::byte>& values) {
  const std::size_t total = mask.size() * 64;
  std::size_t active = 0;
  for (const std::uint64_t word : mask) active += static_cast<std::size_t>(std::popcount(word));

  // Skip what tells of inactive values
  std::int8_t kind = 0;
  SURFEIT_RETURN_IF_ERROR(cursor.read(kind));
  if (kind < kInactiveIsBackground || kind > kAllValues) {
    return cursor.corrupt(fmt::format("node values of kind {}, expected 0 to 6", kind));
  }
  if (kind == kInactiveIsOneValue || kind == kSelectedOneValue || kind == kSelectedTwoValues) {
    SURFEIT_RETURN_IF_ERROR(cursor.skip(type.bytes * (kind == kSelectedTwoValues ? 2 : 1)));
  }
  if (kind >= kSelectedBackground && kind <= kSelectedTwoValues) {
    SURFEIT_RETURN_IF_ERROR(cursor.skip(total / 8));
  }

  // Unpack; half floats that are none have no size either
  const bool only_active = (compression & kVdbActiveMask) != 0 && kind != kAllValues;
  const std::size_t count = only_active ? active : total;
  const std::size_t stored_bytes = count * type.stored_bytes;
  values.resize(count * type.bytes + (type.is_half ? stored_bytes : 0));
  const std::span<std::byte> stored(values.data() + values.size() - stored_bytes, stored_bytes);
  if (!type.is_half || count > 0) {
    SURFEIT_RETURN_IF_ERROR(readVdbData(cursor, compression, stored));
  }
  if (type.is_half) {
    expandHalves(stored.data(), count * type.components, type.type, values.data());
  }
  if (only_active) return {};

  // Keep the active ones
  std::size_t kept = 0;
  for (std::size_t word = 0; word < mask.size(); ++word) {
    for (std::uint64_t bits = mask[word]; bits != 0; bits &= bits - 1) {
      const std::size_t index = word * 64 + static_cast<std::size_t>(std::countr_zero(bits));
      std::memmove(values.data() + kept * type.bytes, values.data() + index * type.bytes,
                   type.bytes);
      ++kept;
    }
  }
  return {};
}

}  // namespace surfeit
