// Rows of floats become surfels, block by block: values are copied property by property, then each
// surfel is held against the limits of all its values at once. No record is refused here: what is
// not plainly valid is left to the general decode of SurfelMapping, which tells why.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "surfeit/surfel.h"

namespace surfeit {

// Set up by SurfelMapping, then immutable and safe from any thread. A place is the offset of a
// float in a Surfel; what no row fills is 0.
class FloatRowDecoder {
 public:
  static constexpr std::size_t kBlockRows = 64;

  explicit FloatRowDecoder(std::size_t row_bytes) : row_bytes_(row_bytes) {}

  // The float at `offset` of a row goes to `place`; it is valid from `least` to `most`.
  void addFloat(std::size_t offset, std::size_t place, float least, float most);
  // The byte at `offset` of a row stands for a valid float. `floats` must outlive the decoder.
  void addByte(std::size_t offset, std::size_t place, const std::array<float, 256>& floats);
  // The byte at `offset` of a row is not zero when the surfel is two-sided.
  void setTwoSided(std::size_t offset);
  // The integer of 1, 2 or 4 bytes at `offset` of a row is the group; it is valid below kMaxGroups,
  // and a negative one never.
  void setGroup(std::size_t offset, std::size_t bytes);
  // Radii are multiplied by this before they are held against their limits.
  void setRadiusScale(float scale) { radius_scale_ = scale; }

  // Decodes `count` rows, at most kBlockRows, to `surfels`. Bit i of the result is 0 when surfel i
  // is done; when it is 1, surfel i is unspecified and the general decode must look at the row.
  std::uint64_t decode(const std::byte* rows, std::size_t count, Surfel* surfels) const;

 private:
  static constexpr std::size_t kFloats = 16;  // of a surfel; what follows stays 0

  struct FloatCopy {  // neighbours in row and surfel
    std::size_t offset = 0, place = 0;
    std::size_t floats = 0;  // 1 to 3
  };
  struct ByteCopy {
    std::size_t offset = 0, place = 0;
    const std::array<float, 256>* floats = nullptr;
  };

  std::uint64_t copyGroups(const std::byte* rows, std::size_t count, Surfel* surfels) const;
  void copyValues(const std::byte* rows, std::size_t count, Surfel* surfels) const;

  std::size_t row_bytes_;
  std::vector<FloatCopy> float_copies_;
  std::vector<ByteCopy> byte_copies_;
  float radius_scale_ = 1;
  std::size_t two_sided_offset_ = 0;
  bool has_two_sided_ = false;
  std::size_t group_offset_ = 0, group_bytes_ = 0;  // no bytes: no groups
  // Of the floats of a surfel before its flags are set; the others are 0
  alignas(16) std::array<float, kFloats> least_{}, most_{};
};

}  // namespace surfeit
