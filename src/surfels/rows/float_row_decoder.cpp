#include "surfels/rows/float_row_decoder.h"

#include <algorithm>
#include <cstring>

#include "core/assert.h"
#include "core/surfel_normal.h"

namespace surfeit {
namespace {

// Four lanes on every machine that gcc and clang know; SSE2 on x86-64.
using Float4 = float __attribute__((vector_size(16)));
using Int4 = std::int32_t __attribute__((vector_size(16)));
constexpr std::size_t kVectors = 4;  // of the floats that are held against limits

// Copies `Floats` floats per row. A constant size makes each copy a move or two.
template <std::size_t Floats>
void copyFloats(const std::byte* row, std::size_t row_bytes, std::size_t count, std::byte* out) {
  for (std::size_t i = 0; i < count; ++i, row += row_bytes, out += sizeof(Surfel)) {
    std::memcpy(out, row, Floats * sizeof(float));
  }
}

template <typename T>
T loadAs(const std::byte* bytes) {
  T value;
  std::memcpy(&value, bytes, sizeof value);
  return value;
}

bool isAllOnes(const Int4& lanes) {
  std::int64_t halves[2];
  std::memcpy(halves, &lanes, sizeof halves);
  return (halves[0] & halves[1]) == -1;
}

}  // namespace

void FloatRowDecoder::addFloat(std::size_t offset, std::size_t place, float least, float most) {
  SURFEIT_CHECK(place % sizeof(float) == 0 && place < kFloats * sizeof(float));
  least_[place / sizeof(float)] = least;
  most_[place / sizeof(float)] = most;

  // Triples stand together in row and surfel: they travel together
  if (!float_copies_.empty()) {
    FloatCopy& last = float_copies_.back();
    const std::size_t bytes = last.floats * sizeof(float);
    if (last.floats < 3 && last.offset + bytes == offset && last.place + bytes == place) {
      ++last.floats;
      return;
    }
  }
  float_copies_.push_back({offset, place, 1});
}

void FloatRowDecoder::addByte(std::size_t offset, std::size_t place,
                              const std::array<float, 256>& floats) {
  SURFEIT_CHECK(place % sizeof(float) == 0 && place < kFloats * sizeof(float));
  const auto [least, most] = std::minmax_element(floats.begin(), floats.end());
  least_[place / sizeof(float)] = *least;
  most_[place / sizeof(float)] = *most;
  byte_copies_.push_back({offset, place, &floats});
}

void FloatRowDecoder::setTwoSided(std::size_t offset) {
  two_sided_offset_ = offset;
  has_two_sided_ = true;
}

void FloatRowDecoder::setGroup(std::size_t offset, std::size_t bytes) {
  SURFEIT_CHECK(bytes == 1 || bytes == 2 || bytes == 4);
  group_offset_ = offset;
  group_bytes_ = bytes;
}

void FloatRowDecoder::copyValues(const std::byte* rows, std::size_t count, Surfel* surfels) const {
  std::fill_n(surfels, count, Surfel{});
  std::byte* const out = reinterpret_cast<std::byte*>(surfels);
  for (const FloatCopy& copy : float_copies_) {
    const auto copyAll = copy.floats == 3   ? copyFloats<3>
                         : copy.floats == 2 ? copyFloats<2>
                                            : copyFloats<1>;
    copyAll(rows + copy.offset, row_bytes_, count, out + copy.place);
  }
  for (const ByteCopy& copy : byte_copies_) {
    const std::byte* byte = rows + copy.offset;
    std::byte* to = out + copy.place;
    for (std::size_t i = 0; i < count; ++i, byte += row_bytes_, to += sizeof(Surfel)) {
      std::memcpy(to, &(*copy.floats)[std::to_integer<std::size_t>(*byte)], sizeof(float));
    }
  }
  if (radius_scale_ != 1) {
    for (std::size_t i = 0; i < count; ++i) surfels[i].radius *= radius_scale_;
  }
}

std::uint64_t FloatRowDecoder::decode(const std::byte* rows, std::size_t count,
                                      Surfel* surfels) const {
  SURFEIT_ASSERT(count <= kBlockRows);
  copyValues(rows, count, surfels);

  Float4 least[kVectors], most[kVectors];
  std::memcpy(least, least_.data(), sizeof least);
  std::memcpy(most, most_.data(), sizeof most);
  std::uint64_t left_over = 0;
  for (std::size_t i = 0; i < count; ++i) {
    // Comparisons with a NaN are false
    Surfel& surfel = surfels[i];
    Float4 values[kVectors];
    std::memcpy(values, &surfel, sizeof values);
    Int4 is_inside = (values[0] >= least[0]) & (values[0] <= most[0]);
    for (std::size_t k = 1; k < kVectors; ++k) {
      is_inside &= (values[k] >= least[k]) & (values[k] <= most[k]);
    }

    const glm::vec3 normal = surfel.normal;
    const NormalKind kind =
        normalise(double{normal.x}, double{normal.y}, double{normal.z}, surfel.normal);
    if (kind == NormalKind::kNone) surfel.flags |= kSurfelSphere;
    const bool is_left_over = !isAllOnes(is_inside) || kind == NormalKind::kTooShort;
    left_over |= std::uint64_t{is_left_over} << i;
  }

  if (has_two_sided_) {
    const std::byte* two_sided = rows + two_sided_offset_;
    for (std::size_t i = 0; i < count; ++i, two_sided += row_bytes_) {
      surfels[i].flags |= *two_sided != std::byte{0} ? kSurfelTwoSided : 0u;
    }
  }
  if (group_bytes_ > 0) left_over |= copyGroups(rows, count, surfels);
  return left_over;
}

// Bit i of the result is 1 where group i is not valid. As unsigned numbers negative ones are large.
std::uint64_t FloatRowDecoder::copyGroups(const std::byte* rows, std::size_t count,
                                          Surfel* surfels) const {
  std::uint64_t left_over = 0;
  const std::byte* row = rows + group_offset_;
  for (std::size_t i = 0; i < count; ++i, row += row_bytes_) {
    std::uint32_t group = std::to_integer<std::uint32_t>(*row);
    if (group_bytes_ == 2) group = loadAs<std::uint16_t>(row);
    if (group_bytes_ == 4) group = loadAs<std::uint32_t>(row);
    surfels[i].group = static_cast<std::uint8_t>(group);
    left_over |= std::uint64_t{group >= kMaxGroups} << i;
  }
  return left_over;
}

}  // namespace surfeit
