// Sorts records of a size known at run time where they lie.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

namespace surfeit {

// A record begins with two numbers of 64 bits, its keys. Other bytes follow, or none.
inline constexpr std::size_t kRecordKeyBytes = 16;

// Whether record `a` comes before `b`: by the keys, and by the other bytes where both are equal.
inline bool recordLess(const std::byte* a, const std::byte* b, std::size_t record_bytes) {
  std::uint64_t keys_a[2], keys_b[2];
  std::memcpy(keys_a, a, sizeof keys_a);
  std::memcpy(keys_b, b, sizeof keys_b);
  if (keys_a[0] != keys_b[0]) return keys_a[0] < keys_b[0];
  if (keys_a[1] != keys_b[1]) return keys_a[1] < keys_b[1];
  return std::memcmp(a + kRecordKeyBytes, b + kRecordKeyBytes, record_bytes - kRecordKeyBytes) < 0;
}

// Copies a record, faster than a call of memcpy.
inline void copyRecord(const std::byte* from, std::byte* to, std::size_t record_bytes) {
  const std::size_t last = record_bytes - kRecordKeyBytes;
  for (std::size_t at = 0; at < last; at += kRecordKeyBytes) {
    std::memcpy(to + at, from + at, kRecordKeyBytes);
  }
  std::memcpy(to + last, from + last, kRecordKeyBytes);
}

// Sorts by recordLess, with all threads of the current arena. record_bytes is a multiple of 4.
// Takes no memory but the stack and, for a moment, one record of each thread.
void sortRecords(std::byte* records, std::size_t count, std::size_t record_bytes);

}  // namespace surfeit
