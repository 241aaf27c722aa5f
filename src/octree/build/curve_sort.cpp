#include "octree/build/curve_sort.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <utility>
#include <vector>

#include "core/parallel.h"

namespace surfeit {
namespace {

constexpr int kDigitBits = 8;
constexpr std::size_t kDigits = std::size_t{1} << kDigitBits;
// Tickets and scratch of this many fit half a second-level cache of 2 MiB.
constexpr std::size_t kCacheTickets = 32768;
// Below this a comparison sort beats counting digits.
constexpr std::size_t kFewTickets = 192;
// Pieces in which the threads count and move tickets.
constexpr std::size_t kPieceTickets = 65536;

using Histogram = std::array<std::size_t, kDigits>;

// The digit of a key at a shift.
std::size_t digitOf(CurveKey key, int shift) { return key >> shift & (kDigits - 1); }

// Bits in which the keys differ.
CurveKey differingBits(std::span<const Ticket> tickets) {
  CurveKey bits = 0;
  for (const Ticket& ticket : tickets) bits |= ticket.key ^ tickets.front().key;
  return bits;
}

// Bits that rise as the float does.
std::uint32_t risingBits(float value) {
  const auto bits = std::bit_cast<std::uint32_t>(value);
  return (bits >> 31) != 0 ? ~bits : bits | 0x80000000u;
}

void sortFew(std::span<Ticket> tickets) {
  std::stable_sort(tickets.begin(), tickets.end(),
                   [](const Ticket& a, const Ticket& b) { return a.key < b.key; });
}

// Passes from the bottom over the digits that differ; the result ends in `tickets`.
void sortInCache(std::span<Ticket> tickets, std::span<Ticket> scratch) {
  const CurveKey bits = differingBits(tickets);
  std::span<Ticket> from = tickets, to = scratch;
  for (int shift = 0; shift < 64 && bits >> shift != 0; shift += kDigitBits) {
    if ((bits >> shift & (kDigits - 1)) == 0) continue;
    std::array<std::uint32_t, kDigits> next{};
    for (const Ticket& ticket : from) ++next[digitOf(ticket.key, shift)];
    std::uint32_t sum = 0;
    for (std::uint32_t& n : next) sum += std::exchange(n, sum);
    for (const Ticket& ticket : from) to[next[digitOf(ticket.key, shift)]++] = ticket;
    std::swap(from, to);
  }
  if (from.data() != tickets.data()) std::copy(from.begin(), from.end(), tickets.begin());
}

void sortPart(std::span<Ticket> tickets, std::span<Ticket> scratch);

// One pass from the top, then every digit by itself. Threads count their pieces first, so that each
// knows where its tickets go: the order within a digit is that of the input.
void splitAndSort(std::span<Ticket> tickets, std::span<Ticket> scratch) {
  const CurveKey bits = differingBits(tickets);
  if (bits == 0) return;
  const int shift = std::max(0, static_cast<int>(std::bit_width(bits)) - kDigitBits);
  const std::size_t pieces = (tickets.size() + kPieceTickets - 1) / kPieceTickets;
  const auto piece = [&](std::size_t p) {
    const std::size_t begin = p * kPieceTickets;
    return tickets.subspan(begin, std::min(kPieceTickets, tickets.size() - begin));
  };
  std::vector<Histogram> next(pieces);
  parallelFor(pieces, [&](std::size_t p) {
    next[p].fill(0);
    for (const Ticket& ticket : piece(p)) ++next[p][digitOf(ticket.key, shift)];
  });
  std::array<std::size_t, kDigits + 1> begin{};
  std::size_t sum = 0;
  for (std::size_t digit = 0; digit < kDigits; ++digit) {
    begin[digit] = sum;
    for (Histogram& histogram : next) sum += std::exchange(histogram[digit], sum);
  }
  begin[kDigits] = sum;
  parallelFor(pieces, [&](std::size_t p) {
    for (const Ticket& ticket : piece(p)) scratch[next[p][digitOf(ticket.key, shift)]++] = ticket;
  });
  parallelFor(kDigits, [&](std::size_t digit) {
    const std::size_t size = begin[digit + 1] - begin[digit];
    if (size == 0) return;
    // What was moved to scratch is sorted there and comes back
    const std::span<Ticket> moved = scratch.subspan(begin[digit], size);
    const std::span<Ticket> home = tickets.subspan(begin[digit], size);
    if (shift > 0) sortPart(moved, home);
    std::copy(moved.begin(), moved.end(), home.begin());
  });
}

void sortPart(std::span<Ticket> tickets, std::span<Ticket> scratch) {
  if (tickets.size() <= kFewTickets) {
    sortFew(tickets);
  } else if (tickets.size() <= kCacheTickets) {
    sortInCache(tickets, scratch);
  } else {
    splitAndSort(tickets, scratch);
  }
}

}  // namespace

// Of two places, the highest bit in which they differ decides (T. Chan, Closest-point problems
// simplified on the RAM, 2002): the words of the finer key need not be made.
bool contentLess(const Surfel& a, const Surfel& b) {
  std::uint32_t highest = 0, bits_a = 0, bits_b = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const std::uint32_t at_a = risingBits(a.position[axis]), at_b = risingBits(b.position[axis]);
    const std::uint32_t differing = at_a ^ at_b;
    if (std::bit_width(differing) <= std::bit_width(highest)) continue;
    highest = differing;
    bits_a = at_a;
    bits_b = at_b;
  }
  return highest != 0 ? bits_a < bits_b : std::memcmp(&a, &b, sizeof(Surfel)) < 0;
}

std::uint64_t contentWord(const Surfel& surfel, int word) {
  if (word < kFinerWords) {
    // 21 bits of each axis, then 11
    const int end = word == 0 ? 32 : 11, begin = word == 0 ? 11 : 0;
    std::uint64_t bits = 0;
    for (int bit = end - 1; bit >= begin; --bit) {
      for (int axis = 0; axis < 3; ++axis) {
        bits = bits << 1 | (risingBits(surfel.position[axis]) >> bit & 1);
      }
    }
    return bits;
  }
  // Bytes compare from the front
  std::uint64_t content = 0;
  const std::size_t at = sizeof content * std::size_t(word - kFinerWords);
  std::memcpy(&content, reinterpret_cast<const std::byte*>(&surfel) + at,
              std::min(sizeof content, sizeof surfel - at));
  return __builtin_bswap64(content);
}

void sortByKey(std::span<Ticket> tickets, std::span<Ticket> scratch) { sortPart(tickets, scratch); }

void sortAlongCurve(std::span<Ticket> tickets, std::span<Ticket> scratch,
                    std::span<const Surfel> surfels) {
  sortByKey(tickets, scratch);
  // Equal keys are rare: two surfels within 2^-20 of the scene
  const auto less = [surfels](const Ticket& a, const Ticket& b) {
    return contentLess(surfels[a.index], surfels[b.index]);
  };
  for (std::size_t i = 1; i < tickets.size(); ++i) {
    if (tickets[i].key != tickets[i - 1].key) continue;
    const std::size_t first = i - 1;
    while (i < tickets.size() && tickets[i].key == tickets[first].key) ++i;
    // Small ranges are sorted here by this thread
    parallelSort(tickets.begin() + static_cast<std::ptrdiff_t>(first),
                 tickets.begin() + static_cast<std::ptrdiff_t>(i), less);
  }
}

}  // namespace surfeit
