// Sorting along the curve: what moves is a ticket of 16 bytes, not the surfel.
#pragma once

#include <cstdint>
#include <span>

#include "core/curve_key.h"
#include "surfeit/surfel.h"

namespace surfeit {

// A surfel's place on the curve and where the surfel lies.
struct Ticket {
  CurveKey key = 0;
  std::uint64_t index = 0;
};

// Order of surfels with one key: by a finer key, then by their bytes, so that the order of the
// input does not show. The finer key takes the bits of the coordinates by turns, as floats rise,
// from the highest on: neighbours follow each other however many surfels lie in one cell, as all
// but a few do where a stray is far away.
bool contentLess(const Surfel& a, const Surfel& b);

// Words that compare as contentLess does, one after the other; `word` is below kContentWords.
inline constexpr int kFinerWords = 2;
inline constexpr int kContentWords = kFinerWords + int((sizeof(Surfel) + 7) / 8);
std::uint64_t contentWord(const Surfel& surfel, int word);

// Sorts tickets by key with all threads of the current arena; `scratch` has the same size. Within a
// key the order stays as it was. A pass from the top splits the tickets until they fit the
// second-level cache, where passes from the bottom sort them: 12 ns per key of 4 M shuffled
// surfels, against 14 for passes from the bottom alone and 54 for a comparison sort; in the order
// of a scanner 10, 15 and 24 (bench/sort_bench).
void sortByKey(std::span<Ticket> tickets, std::span<Ticket> scratch);

// The same, and within a key by content. `surfels` is what the indices point into.
void sortAlongCurve(std::span<Ticket> tickets, std::span<Ticket> scratch,
                    std::span<const Surfel> surfels);

}  // namespace surfeit
