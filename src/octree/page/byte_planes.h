// Payloads of pages, and integers in them as byte planes: all low bytes, then all next ones. Where
// neighbours are alike, the planes of their differences are mostly small numbers, which zstd
// compresses well; those that are not are kept away from it. docs/format.md, "Columns", has the
// bytes.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <type_traits>
#include <vector>

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

#include "core/thread_scratch.h"
#include "storage/byte_coding.h"

namespace surfeit {

// A payload has two parts: the packed part, which is worth compressing, and the plain part with
// planes that look like noise:
//
//   [ records : 4 | bytes of the packed part, these 8 included : 4 | columns | plain planes ]
class PayloadWriter {
 public:
  // Replaces what `payload` holds. One writer per thread at a time.
  PayloadWriter(std::vector<std::byte>& payload, std::uint32_t record_count)
      : payload_(payload), plain_(threadPlainPart()) {
    payload_.clear();
    plain_.clear();
    put(record_count);
    put(std::uint32_t{0});
  }

  // To the packed part.
  template <typename T>
  void put(const T& value) {
    ByteWriter(payload_).put(value);
  }
  // Room for `count` bytes, to be filled before the next call.
  std::byte* addPacked(std::size_t count) { return grow(payload_, count); }
  std::byte* addPlain(std::size_t count) { return grow(plain_, count); }

  // Joins the parts; returns the bytes of the packed one.
  std::size_t finish() {
    const std::size_t packed_bytes = payload_.size();
    const auto stored = static_cast<std::uint32_t>(packed_bytes);
    std::memcpy(payload_.data() + sizeof stored, &stored, sizeof stored);
    payload_.insert(payload_.end(), plain_.begin(), plain_.end());
    return packed_bytes;
  }

 private:
  static std::byte* grow(std::vector<std::byte>& bytes, std::size_t count) {
    bytes.resize(bytes.size() + count);
    return bytes.data() + (bytes.size() - count);
  }
  static std::vector<std::byte>& threadPlainPart() {
    std::vector<std::byte>& bytes = threadScratch<std::vector<std::byte>>([] {});
    return bytes;
  }

  std::vector<std::byte>& payload_;
  std::vector<std::byte>& plain_;  // the thread's own
};

// Takes from the front of both parts. Like a ByteReader it turns bad at the end and returns zeros.
class PayloadReader {
 public:
  explicit PayloadReader(std::span<const std::byte> payload) : packed(payload), plain({}) {
    record_count_ = packed.get<std::uint32_t>();
    const std::uint32_t packed_bytes = packed.get<std::uint32_t>();
    if (!packed.ok()) return;
    constexpr std::size_t kHeaderBytes = 2 * sizeof(std::uint32_t);
    if (packed_bytes < kHeaderBytes || packed_bytes > payload.size()) {
      packed.take(payload.size());  // turns it bad
      return;
    }
    packed = ByteReader(payload.first(packed_bytes).subspan(kHeaderBytes));
    plain = ByteReader(payload.subspan(packed_bytes));
  }

  bool ok() const { return packed.ok() && plain.ok(); }
  std::uint32_t recordCount() const { return record_count_; }
  std::size_t remaining() const { return packed.remaining() + plain.remaining(); }

  ByteReader packed, plain;

 private:
  std::uint32_t record_count_ = 0;
};

// Appends what `after` has taken since it was as `before`: columns that pass unchanged from one
// payload to another. Both ok.
inline void copyTaken(const PayloadReader& before, const PayloadReader& after,
                      PayloadWriter& writer) {
  const auto copy = [](ByteReader from, const ByteReader& to, auto&& grow) {
    const std::size_t count = from.remaining() - to.remaining();
    if (count > 0) std::memcpy(grow(count), from.take(count).data(), count);
  };
  copy(before.packed, after.packed, [&](std::size_t count) { return writer.addPacked(count); });
  copy(before.plain, after.plain, [&](std::size_t count) { return writer.addPlain(count); });
}

// Scratch for one column, per thread so that no page allocates. A `Use` keeps apart what is alive
// at the same time.
enum class Use { kCodes, kDifferences, kPlanes };
template <typename T, Use use>
std::span<T> scratch(std::size_t count) {
  std::vector<T>& values = threadScratch<std::vector<T>>([] {});
  if (values.size() < count) values.resize(count);
  return std::span<T>(values).first(count);
}

// Whether zstd would make little of a plane: bytes below 16 are 1 in 16 of noise, and most of what
// differences of neighbours look like. Where they are fewer than 1 in 4, the bytes have 7 bits or
// more, and apart from them zstd finds a better code for the others: surfel pages become 2 %
// smaller and are compressed in 10 % less time. Eight bytes at a time.
inline bool looksLikeNoise(const std::byte* plane, std::size_t count) {
  constexpr std::uint64_t kLowBits = 0x0101010101010101;
  std::uint64_t large = 0;
  const std::size_t words = count / 8;
  for (std::size_t begin = 0; begin < words; begin += 255) {
    std::uint64_t sums = 0;  // eight of them, each below 256
    for (std::size_t i = begin; i < std::min(begin + 255, words); ++i) {
      std::uint64_t word;
      std::memcpy(&word, plane + 8 * i, sizeof word);
      sums += (((word >> 4 & 0x0f * kLowBits) + 0x0f * kLowBits) >> 4) & kLowBits;
    }
    constexpr std::uint64_t kEven = 0x00ff00ff00ff00ff;
    large += (((sums & kEven) + (sums >> 8 & kEven)) * 0x0001000100010001) >> 48;
  }
  return large * 4 > words * 8 * 3;
}

// Writes the low `Width` bytes of each value, plane by plane. Planes that look like noise go to the
// plain part; bit k of a byte before them tells that of plane k.
template <int Width, typename T>
void putPlanes(PayloadWriter& writer, std::span<const T> values) {
  const std::size_t count = values.size();
  const std::span<std::byte> planes = scratch<std::byte, Use::kPlanes>(Width * count);
  const T* const from = values.data();
  std::uint8_t plain = 0;
  for (int byte = 0; byte < Width; ++byte) {
    std::byte* const plane = planes.data() + static_cast<std::size_t>(byte) * count;
    for (std::size_t i = 0; i < count; ++i) {
      plane[i] = static_cast<std::byte>(from[i] >> (8 * byte) & 0xff);
    }
    if (looksLikeNoise(plane, count)) plain = static_cast<std::uint8_t>(plain | 1u << byte);
  }
  writer.put(plain);
  for (std::size_t byte = 0; byte < Width && count > 0; ++byte) {
    std::byte* const to =
        (plain >> byte & 1) != 0 ? writer.addPlain(count) : writer.addPacked(count);
    std::memcpy(to, planes.data() + byte * count, count);
  }
}

template <int Width, typename T>
bool getPlanes(PayloadReader& reader, std::span<T> values) {
  const std::size_t count = values.size();
  const std::uint8_t plain = reader.packed.get<std::uint8_t>();
  if (plain >> Width != 0) return false;
  std::array<const std::byte*, Width> planes;
  for (std::size_t byte = 0; byte < Width; ++byte) {
    planes[byte] = ((plain >> byte & 1) != 0 ? reader.plain : reader.packed).take(count).data();
  }
  if (!reader.ok()) return false;
  T* const to = values.data();
  for (std::size_t i = 0; i < count; ++i) {
    T value = 0;
    for (std::size_t byte = 0; byte < Width; ++byte) {
      value = static_cast<T>(value | static_cast<T>(planes[byte][i]) << (8 * byte));
    }
    to[i] = value;
  }
  return true;
}

// Folds the sign into the lowest bit, so that small numbers of either sign have zeros above:
// 0, -1, 1, -2 become 0, 1, 2, 3. Numbers of 8 * Width bits, in the low bits of T.
template <int Width, typename T>
T folded(T difference) {
  using Signed = std::make_signed_t<T>;
  constexpr int kUnused = static_cast<int>(8 * sizeof(T)) - 8 * Width;
  const auto number = static_cast<Signed>(static_cast<T>(difference << kUnused)) >> kUnused;
  const auto result =
      static_cast<T>(static_cast<T>(number) << 1) ^ static_cast<T>(number >> (8 * sizeof(T) - 1));
  return static_cast<T>(static_cast<T>(static_cast<T>(result) << kUnused) >> kUnused);
}

template <typename T>
T unfolded(T code) {
  return static_cast<T>((code >> 1) ^ (T{0} - (code & 1)));
}

// The differences of neighbours, folded.
template <int Width, typename T>
void putDifferences(PayloadWriter& writer, std::span<const T> codes) {
  const std::size_t count = codes.size();
  const std::span<T> differences = scratch<T, Use::kDifferences>(count);
  const T* const from = codes.data();
  T* const to = differences.data();
  if (count > 0) to[0] = folded<Width>(from[0]);
  for (std::size_t i = 1; i < count; ++i) {
    to[i] = folded<Width>(static_cast<T>(from[i] - from[i - 1]));
  }
  putPlanes<Width, T>(writer, differences);
}

#if defined(__SSE2__)
// From folded differences to codes, eight at a time; returns how many are done. The sums of the
// first 1, 2 .. 8 take three additions.
inline std::size_t sumEights(std::span<std::uint16_t> codes) {
  const std::size_t count = codes.size() / 8 * 8;
  __m128i before = _mm_setzero_si128();  // the sum so far, in all lanes
  for (std::size_t i = 0; i < count; i += 8) {
    __m128i* const at = reinterpret_cast<__m128i*>(&codes[i]);
    const __m128i code = _mm_loadu_si128(at);
    const __m128i sign = _mm_sub_epi16(_mm_setzero_si128(), _mm_and_si128(code, _mm_set1_epi16(1)));
    __m128i sum = _mm_xor_si128(_mm_srli_epi16(code, 1), sign);
    sum = _mm_add_epi16(sum, _mm_slli_si128(sum, 2));
    sum = _mm_add_epi16(sum, _mm_slli_si128(sum, 4));
    sum = _mm_add_epi16(sum, _mm_slli_si128(sum, 8));
    sum = _mm_add_epi16(sum, before);
    _mm_storeu_si128(at, sum);
    const __m128i high = _mm_shufflehi_epi16(sum, 0xff);
    before = _mm_unpackhi_epi64(high, high);
  }
  return count;
}
#endif

template <int Width, typename T>
bool getDifferences(PayloadReader& reader, std::span<T> codes) {
  if (!getPlanes<Width>(reader, codes)) return false;
  std::size_t i = 0;
#if defined(__SSE2__)
  if constexpr (std::is_same_v<T, std::uint16_t>) i = sumEights(codes);
#endif
  // In 64 bits, so that nothing but an addition is between one sum and the next
  std::uint64_t sum = i > 0 ? codes[i - 1] : 0;
  for (; i < codes.size(); ++i) {
    sum += unfolded(codes[i]);
    codes[i] = static_cast<T>(sum & (~std::uint64_t{0} >> (64 - 8 * Width)));
  }
  return true;
}

}  // namespace surfeit
