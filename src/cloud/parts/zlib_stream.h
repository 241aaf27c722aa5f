// A zlib stream inside a file, or in memory, as the bytes that it codes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "storage/byte_input.h"
#include "surfeit/status.h"

namespace surfeit {

// Deflate codes at most this many bytes in one.
inline constexpr std::uint64_t kMaxDeflateRatio = 1032;

// Reads a stream that begins at an offset of a file. One thread at a time; takes about 300 KiB.
class ZlibStream {
 public:
  // `input` must outlive the stream.
  static Result<ZlibStream> open(ByteInput& input, std::uint64_t offset);
  ZlibStream(ZlibStream&&) noexcept;
  ZlibStream& operator=(ZlibStream&&) noexcept;
  ~ZlibStream();

  // Back to the first byte.
  Status rewind();
  // Decodes up to bytes.size() bytes; fewer only where the stream ends. kCorruption, naming the
  // byte of the file, when the stream is damaged or the file ends inside it.
  Result<std::size_t> read(std::span<std::byte> bytes);
  // The byte of the file behind those that were decoded so far.
  std::uint64_t offset() const;

 private:
  struct State;
  explicit ZlibStream(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

// Whether `packed` is one whole stream that codes exactly bytes.size() bytes; then `bytes` are
// these.
bool inflateWhole(Bytes packed, std::span<std::byte> bytes);

}  // namespace surfeit
