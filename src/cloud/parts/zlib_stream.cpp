#include "cloud/parts/zlib_stream.h"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <limits>
#include <utility>
#include <vector>

namespace surfeit {
namespace {

constexpr std::size_t kPackedBytes = 256 << 10;
constexpr std::size_t kMaxStep = std::numeric_limits<uInt>::max();

Bytef* zlibBytes(const std::byte* bytes) {
  return reinterpret_cast<Bytef*>(const_cast<std::byte*>(bytes));  // zlib does not write there
}

}  // namespace

struct ZlibStream::State {
  State(ByteInput& file, std::uint64_t offset) : input(file), begin(offset), next(offset) {}
  ~State() {
    if (is_ready) inflateEnd(&zlib);
  }

  // More packed bytes, at least one.
  Status refill() {
    SURFEIT_ASSIGN_OR_RETURN(const std::size_t size, input.readSome(next, packed));
    if (size == 0) {
      return Status::corruption(fmt::format(
          "{}: file ends early: at byte {}, inside its zlib data, of which {} bytes are decoded",
          input.path(), next, decoded));
    }
    next += size;
    zlib.next_in = zlibBytes(packed.data());
    zlib.avail_in = static_cast<uInt>(size);
    return {};
  }

  Result<std::size_t> read(std::span<std::byte> bytes) {
    const std::size_t wanted = bytes.size();
    while (!bytes.empty() && !has_ended) {
      if (zlib.avail_in == 0) SURFEIT_RETURN_IF_ERROR(refill());
      const auto room = static_cast<uInt>(std::min(bytes.size(), kMaxStep));
      zlib.next_out = zlibBytes(bytes.data());
      zlib.avail_out = room;
      const int result = inflate(&zlib, Z_NO_FLUSH);
      decoded += room - zlib.avail_out;
      bytes = bytes.subspan(room - zlib.avail_out);
      has_ended = result == Z_STREAM_END;
      if (result == Z_OK || has_ended || (result == Z_BUF_ERROR && zlib.avail_in == 0)) continue;
      return Status::corruption(fmt::format("{}: damaged zlib data before byte {}: {}",
                                            input.path(), next - zlib.avail_in,
                                            zlib.msg != nullptr ? zlib.msg : "no valid stream"));
    }
    return wanted - bytes.size();
  }

  ByteInput& input;
  const std::uint64_t begin;
  std::uint64_t next;         // of the file, not in `packed` yet
  std::uint64_t decoded = 0;  // bytes so far
  std::vector<std::byte> packed = std::vector<std::byte>(kPackedBytes);
  z_stream zlib{};
  bool is_ready = false, has_ended = false;
};

ZlibStream::ZlibStream(std::unique_ptr<State> state) : state_(std::move(state)) {}
ZlibStream::ZlibStream(ZlibStream&&) noexcept = default;
ZlibStream& ZlibStream::operator=(ZlibStream&&) noexcept = default;
ZlibStream::~ZlibStream() = default;

Result<ZlibStream> ZlibStream::open(ByteInput& input, std::uint64_t offset) {
  auto state = std::make_unique<State>(input, offset);
  state->is_ready = inflateInit(&state->zlib) == Z_OK;
  if (!state->is_ready) return Status::failed(input.path() + ": no memory for zlib");
  return ZlibStream(std::move(state));
}

Status ZlibStream::rewind() {
  inflateReset(&state_->zlib);
  state_->zlib.avail_in = 0;
  state_->next = state_->begin;
  state_->decoded = 0;
  state_->has_ended = false;
  return {};
}

Result<std::size_t> ZlibStream::read(std::span<std::byte> bytes) { return state_->read(bytes); }

std::uint64_t ZlibStream::offset() const { return state_->next - state_->zlib.avail_in; }

bool inflateWhole(Bytes packed, std::span<std::byte> bytes) {
  if (packed.size() > kMaxStep || bytes.size() > kMaxStep) return false;
  z_stream zlib{};
  if (inflateInit(&zlib) != Z_OK) return false;
  // zlib wants a place to write to even when nothing is expected
  std::byte nothing{};
  zlib.next_in = zlibBytes(packed.data());
  zlib.avail_in = static_cast<uInt>(packed.size());
  zlib.next_out = zlibBytes(bytes.empty() ? &nothing : bytes.data());
  zlib.avail_out = static_cast<uInt>(bytes.size());
  const int result = inflate(&zlib, Z_FINISH);
  const bool is_whole = result == Z_STREAM_END && zlib.avail_out == 0 && zlib.avail_in == 0;
  inflateEnd(&zlib);
  return is_whole;
}

}  // namespace surfeit
