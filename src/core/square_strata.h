// Jittered stratification of the unit square: n cells that cover it without gap or overlap, in rows
// that run back and forth, any cell computed from its number alone. It turns the number of a surfel
// into the small piece of surface that the surfel stands for (surfels/generated/scene_generator.h).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace surfeit {

// A hash of 64 bits, two multiplications: every bit of the input moves every bit of the result.
inline std::uint64_t mixBits(std::uint64_t bits) {
  bits ^= bits >> 32;
  bits *= 0xD6E8FEB86659FD93u;
  bits ^= bits >> 32;
  bits *= 0xD6E8FEB86659FD93u;
  return bits ^ (bits >> 32);
}

// The hash of a number in the sequence of a key.
inline std::uint64_t hashOf(std::uint64_t key, std::uint64_t number) {
  return mixBits(key + number * 0x9E3779B97F4A7C15u);
}

// 16 bits of a hash from bit `shift` on, as the middle of one of 65536 parts of 0..1.
inline double unitFromBits(std::uint64_t hash, int shift) {
  return (double((hash >> shift) & 0xFFFFu) + 0.5) * (1.0 / 65536);
}

// A cell: the middle (with a little jitter across the row) and the size, in 0..1.
struct Stratum {
  double u = 0, v = 0;
  double du = 0, dv = 0;
};

// The share of part `part` when `count` things are dealt to `parts` parts in order, as evenly as
// whole numbers allow.
struct Share {
  std::uint64_t part = 0;
  std::uint64_t begin = 0, end = 0;  // the things of the part, half-open
};

// The part that thing `index` of `count` belongs to; index < count, 0 < parts <= count, and
// count * parts fits 64 bits. Part k gets the things from floor(k count / parts) on.
inline Share shareOf(std::uint64_t index, std::uint64_t count, std::uint64_t parts) {
  Share share;
  share.part = ((index + 1) * parts - 1) / count;
  share.begin = share.part * count / parts;
  share.end = (share.part + 1) * count / parts;
  return share;
}

// Rows for `count` cells that are about square on a surface `aspect` times as high as wide.
inline std::uint64_t stratumRows(std::uint64_t count, double aspect) {
  const double rows = std::floor(std::sqrt(double(count) * aspect) + 0.5);
  return std::min(count, std::uint64_t(std::max(1.0, rows)));
}

// Bits of hashOf(key, index) that squareStratum uses; 32 to 63 are free for the caller.
inline constexpr int kStratumHashBits = 32;

// The middle of a cell moves across its row by up to this part of the row's height.
inline constexpr double kRowJitter = 0.15;

// Cell `index` of `count` in rows whose shares `row` is one of. Neighbours in a row share a border
// that the hash of the second one moves; rows are as high as they have cells, so that areas average
// 1 / count. `hash` is hashOf(key, index).
inline Stratum squareStratum(const Share& row, std::uint64_t index, std::uint64_t count,
                             std::uint64_t key, std::uint64_t hash) {
  constexpr double kBorderJitter = 0.6;  // in all: a border moves by 0.3 of a cell to either side
  const std::uint64_t cells = row.end - row.begin;
  const std::uint64_t column = index - row.begin;
  const double cell_width = 1.0 / double(cells);

  // Borders; those of the square itself stay
  double left = double(column), right = double(column + 1);
  if (column > 0) left += kBorderJitter * (unitFromBits(hash, 0) - 0.5);
  if (column + 1 < cells) {
    right += kBorderJitter * (unitFromBits(hashOf(key, index + 1), 0) - 0.5);
  }

  Stratum stratum;
  const double row_unit = 1.0 / double(count);
  stratum.du = (right - left) * cell_width;
  stratum.dv = double(cells) * row_unit;
  stratum.u = 0.5 * (left + right) * cell_width;
  stratum.v = (0.5 * double(row.begin + row.end)) * row_unit +
              2 * kRowJitter * (unitFromBits(hash, 16) - 0.5) * stratum.dv;
  if (row.part % 2 == 1) stratum.u = 1 - stratum.u;  // every second row runs back
  return stratum;
}

}  // namespace surfeit
