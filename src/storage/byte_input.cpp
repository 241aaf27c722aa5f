#include "storage/byte_input.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "core/process_cancelled.h"
#include "storage/compression.h"

namespace surfeit {
namespace {

constexpr std::size_t kPackedBytes = 256 << 10;
constexpr std::size_t kSkippedBytes = 64 << 10;

std::string_view nameOf(Compression compression) {
  return compression == Compression::kGzip ? "gzip" : "zstd";
}

}  // namespace

struct ByteInput::State {
  explicit State(InputFile opened) : file(std::move(opened)) {}

  // Back to the first byte.
  Status restart() {
    SURFEIT_ASSIGN_OR_RETURN(decompressor, Decompressor::create(compression));
    packed_buffer.resize(kPackedBytes);
    packed = {};
    packed_offset = 0;
    position = 0;
    return {};
  }

  // Reads on in the file. When it ends, that must be where a member or frame does.
  Status refill(bool& has_ended) {
    SURFEIT_ASSIGN_OR_RETURN(const std::size_t size, file.readSome(packed_offset, packed_buffer));
    packed = Bytes(packed_buffer).first(size);
    packed_offset += size;
    has_ended = size == 0;
    if (!has_ended || decompressor->isBetweenParts()) return {};
    return Status::corruption(
        fmt::format("{}: file ends early: {} bytes of {} data, expected more after the first {} "
                    "decoded bytes",
                    file.path(), packed_offset, nameOf(compression), position));
  }

  // Decodes the next bytes, fewer only at the end.
  Result<std::size_t> decode(std::span<std::byte> bytes) {
    const std::span<std::byte> all = bytes;
    while (!bytes.empty()) {
      if (isProcessCancelled()) return Status::interrupted();
      // A decompressor may hold decoded bytes after its last input, but then it is inside a part
      if (packed.empty()) {
        const std::size_t room = bytes.size();
        if (!decompressor->isBetweenParts()) SURFEIT_RETURN_IF_ERROR(decodeSome(bytes));
        if (bytes.size() < room) continue;
        bool has_ended = false;
        SURFEIT_RETURN_IF_ERROR(refill(has_ended));
        if (has_ended) break;
      }
      SURFEIT_RETURN_IF_ERROR(checkNextPart());
      SURFEIT_RETURN_IF_ERROR(decodeSome(bytes));
    }
    return all.size() - bytes.size();
  }

  // Behind a member or frame comes another one, or the end of the file.
  Status checkNextPart() {
    const std::uint64_t at = packed_offset - packed.size();
    if (at == 0 || !decompressor->isBetweenParts()) return {};
    std::array<std::byte, 4> magic;
    SURFEIT_ASSIGN_OR_RETURN(const std::size_t size, file.readSome(at, magic));
    if (compressionOf(Bytes(magic).first(size)) == compression) return {};
    return Status::corruption(fmt::format(
        "{}: {} bytes behind the {} data, from byte {} on, are none: head -c {} FILE > OUT writes "
        "the file without them",
        file.path(), file.size() - std::min(file.size(), at), nameOf(compression), at, at));
  }

  Status decodeSome(std::span<std::byte>& bytes) {
    const std::size_t room = bytes.size();
    const Status decoded = decompressor->decode(packed, bytes);
    position += room - bytes.size();
    if (decoded.ok()) return {};
    return Status::corruption(fmt::format("{}: damaged {} data before byte {}: {}", file.path(),
                                          nameOf(compression), packed_offset - packed.size(),
                                          decoded.message()));
  }

  // Decodes up to `offset`, as far as there is anything.
  Status moveTo(std::uint64_t offset) {
    if (decompressor == nullptr || offset < position) SURFEIT_RETURN_IF_ERROR(restart());
    while (position < offset) {
      skipped_buffer.resize(kSkippedBytes);
      const std::size_t size =
          static_cast<std::size_t>(std::min<std::uint64_t>(offset - position, kSkippedBytes));
      SURFEIT_ASSIGN_OR_RETURN(const std::size_t got,
                               decode(std::span(skipped_buffer).first(size)));
      if (got < size) break;
    }
    return {};
  }

  Result<std::size_t> readCompressed(std::uint64_t offset, std::span<std::byte> bytes) {
    Status status = moveTo(offset);
    if (status.ok() && position < offset) return std::size_t{0};
    if (status.ok()) {
      Result<std::size_t> got = decode(bytes);
      if (got.ok()) return got;
      status = got.status();
    }
    decompressor.reset();  // the next read begins again, and fails at the same place
    return status;
  }

  InputFile file;
  Compression compression = Compression::kNone;
  std::unique_ptr<Decompressor> decompressor;  // stands at `position`; none before the first read
  std::uint64_t position = 0;
  // Compressed bytes to be decoded; the file goes on at packed_offset
  std::vector<std::byte> packed_buffer, skipped_buffer;
  Bytes packed;
  std::uint64_t packed_offset = 0;
};

Result<ByteInput> ByteInput::open(const std::string& path, Access access) {
  SURFEIT_ASSIGN_OR_RETURN(InputFile file, InputFile::open(path, access));
  std::array<std::byte, 4> magic;
  SURFEIT_ASSIGN_OR_RETURN(const std::size_t size, file.readSome(0, magic));
  auto state = std::make_unique<State>(std::move(file));
  state->compression = compressionOf(Bytes(magic).first(size));
  return ByteInput(std::move(state));
}

ByteInput::ByteInput(std::unique_ptr<State> state) : state_(std::move(state)) {}
ByteInput::ByteInput(ByteInput&&) noexcept = default;
ByteInput& ByteInput::operator=(ByteInput&&) noexcept = default;
ByteInput::~ByteInput() = default;

const std::string& ByteInput::path() const { return state_->file.path(); }

bool ByteInput::isCompressed() const { return state_->compression != Compression::kNone; }

std::optional<std::uint64_t> ByteInput::size() const {
  if (isCompressed()) return std::nullopt;
  return state_->file.size();
}

Result<std::size_t> ByteInput::readSome(std::uint64_t offset, std::span<std::byte> bytes) {
  if (isProcessCancelled()) return Status::interrupted();
  if (!isCompressed()) return state_->file.readSome(offset, bytes);
  return state_->readCompressed(offset, bytes);
}

Status ByteInput::readAt(std::uint64_t offset, std::span<std::byte> bytes) {
  if (!isCompressed()) return state_->file.readAt(offset, bytes);
  SURFEIT_ASSIGN_OR_RETURN(const std::size_t got, state_->readCompressed(offset, bytes));
  if (got == bytes.size()) return {};
  return Status::corruption(fmt::format("{}: file ends early: {} bytes at {}, expected {}", path(),
                                        got, offset, bytes.size()));
}

Result<Bytes> ByteInput::readView(std::uint64_t offset, std::size_t size, AlignedBuffer& buffer) {
  if (isProcessCancelled()) return Status::interrupted();
  if (!isCompressed()) return state_->file.readView(offset, size, buffer);
  buffer.reserve(size);
  SURFEIT_ASSIGN_OR_RETURN(const std::size_t got,
                           state_->readCompressed(offset, {buffer.data(), size}));
  return Bytes(buffer.data(), got);
}

Status ByteInput::checkUnchanged() const { return state_->file.checkUnchanged(); }

}  // namespace surfeit
