// Little-endian values in byte buffers. The reader never goes past its end: it turns bad and
// returns zeros, and decoders look once, at the end of a part.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <type_traits>
#include <vector>

namespace surfeit {

static_assert(std::endian::native == std::endian::little,
              "the file format is little-endian and its readers copy bytes");

// Appends values to a buffer.
class ByteWriter {
 public:
  explicit ByteWriter(std::vector<std::byte>& bytes) : bytes_(bytes) {}

  template <typename T>
  void put(const T& value) {
    static_assert(std::is_arithmetic_v<T>);
    putBytes(std::as_bytes(std::span(&value, 1)));
  }
  void putBytes(std::span<const std::byte> bytes) {
    const std::size_t before = bytes_.size();
    bytes_.resize(before + bytes.size());
    if (!bytes.empty()) std::memcpy(bytes_.data() + before, bytes.data(), bytes.size());
  }

 private:
  std::vector<std::byte>& bytes_;
};

// Takes values from the front of a buffer.
class ByteReader {
 public:
  explicit ByteReader(std::span<const std::byte> bytes) : rest_(bytes) {}

  template <typename T>
  T get() {
    static_assert(std::is_arithmetic_v<T>);
    T value{};
    const std::span<const std::byte> bytes = take(sizeof(T));
    if (bytes.size() == sizeof(T)) std::memcpy(&value, bytes.data(), sizeof(T));
    return value;
  }
  // The next `count` bytes; empty, and bad from now on, when fewer are left.
  std::span<const std::byte> take(std::size_t count) {
    if (count > rest_.size()) {
      bad_ = true;
      rest_ = {};
      return {};
    }
    const std::span<const std::byte> bytes = rest_.first(count);
    rest_ = rest_.subspan(count);
    return bytes;
  }

  bool ok() const { return !bad_; }
  std::size_t remaining() const { return rest_.size(); }

 private:
  std::span<const std::byte> rest_;
  bool bad_ = false;
};

}  // namespace surfeit
