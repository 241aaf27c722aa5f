// gzip and zstd as streams of bytes, for whole files: storage/byte_input.h and
// storage/byte_output.h. Pages have storage/page_codec.h.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "storage/positional_file.h"
#include "surfeit/status.h"

namespace surfeit {

enum class Compression { kNone, kGzip, kZstd };

// By the first four bytes of a file.
Compression compressionOf(Bytes first_bytes);
// By the extension of its name: .gz or .zst, in any case.
Compression compressionOf(std::string_view path);

// Turns compressed bytes into what they stand for. One thread at a time.
class Decompressor {
 public:
  static Result<std::unique_ptr<Decompressor>> create(Compression compression);
  virtual ~Decompressor() = default;

  // Decodes from the front of `input` to the front of `output`, and takes what it used and filled
  // off both; makes progress unless one of them is empty. Where one member or frame ends the next
  // begins. kFailed, with what is wrong as its message, when the bytes are damaged.
  virtual Status decode(Bytes& input, std::span<std::byte>& output) = 0;
  // Whether the bytes may end here: behind a whole member or frame.
  virtual bool isBetweenParts() const = 0;
};

// The reverse, as one member or frame. The same bytes for the same input, however it is cut.
class Compressor {
 public:
  static Result<std::unique_ptr<Compressor>> create(Compression compression);
  virtual ~Compressor() = default;

  // Encodes all of `input` into pieces, as many as it takes, each of which it hands to `write`.
  // With `is_last` it completes the stream.
  template <typename Write>
  Status encode(Bytes input, bool is_last, Write write) {
    for (bool is_done = false; !is_done;) {
      SURFEIT_ASSIGN_OR_RETURN(const std::size_t size, encodePiece(input, is_last, is_done));
      if (size > 0) SURFEIT_RETURN_IF_ERROR(write(Bytes(piece_.get(), size)));
    }
    return {};
  }

 protected:
  static constexpr std::size_t kPieceBytes = 256 << 10;
  // Fills piece_ from the front of `input`, which it takes off; returns its bytes.
  virtual Result<std::size_t> encodePiece(Bytes& input, bool is_last, bool& is_done) = 0;

  std::unique_ptr<std::byte[]> piece_ = std::make_unique_for_overwrite<std::byte[]>(kPieceBytes);
};

}  // namespace surfeit
