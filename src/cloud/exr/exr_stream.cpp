#include "cloud/exr/exr_stream.h"

#include <OpenEXR/Iex.h>

#include <algorithm>
#include <cstring>
#include <utility>

namespace surfeit {
namespace {

constexpr std::size_t kBufferBytes = 64 << 10;

}  // namespace

ExrInputStream::ExrInputStream(InputFile file)
    : Imf::IStream(file.path().c_str()), file_(std::move(file)) {}

bool ExrInputStream::read(char bytes[], int count) {
  const std::size_t size = std::size_t(std::max(count, 0));
  Status status = readAt(position_, std::as_writable_bytes(std::span(bytes, size)));
  if (!status.ok()) {
    status_ = std::move(status);
    throw Iex::InputExc(status_.message());
  }
  position_ += size;
  return position_ < file_.size();
}

Status ExrInputStream::readAt(std::uint64_t offset, std::span<std::byte> bytes) {
  if (bytes.size() >= kBufferBytes) return file_.readAt(offset, bytes);
  const auto isBuffered = [&] {
    return offset >= buffer_begin_ && offset - buffer_begin_ <= buffer_.size() &&
           bytes.size() <= buffer_.size() - (offset - buffer_begin_);
  };
  if (!isBuffered()) {
    buffer_.resize(kBufferBytes);
    buffer_begin_ = offset;
    Result<std::size_t> found = file_.readSome(offset, buffer_);
    buffer_.resize(found.ok() ? *found : 0);
    if (!found.ok()) return found.status();
    // The message is that of a read which found too little
    if (!isBuffered()) return file_.readAt(offset, bytes);
  }
  std::memcpy(bytes.data(), buffer_.data() + (offset - buffer_begin_), bytes.size());
  return {};
}

ExrOutputStream::ExrOutputStream(AtomicFile file)
    : Imf::OStream(file.path().c_str()), file_(std::move(file)) {}

void ExrOutputStream::write(const char bytes[], int count) {
  Bytes rest = std::as_bytes(std::span(bytes, std::size_t(std::max(count, 0))));
  // The offset table is overwritten when all blocks are known
  if (status_.ok() && position_ < file_.size()) {
    const std::size_t size =
        std::size_t(std::min<std::uint64_t>(rest.size(), file_.size() - position_));
    status_ = file_.writeAt(position_, rest.first(size));
    position_ += size;
    rest = rest.subspan(size);
  }
  if (status_.ok() && !rest.empty()) {
    status_ = file_.append(rest);
    position_ += rest.size();
  }
  if (!status_.ok()) throw Iex::IoExc(status_.message());
}

Status ExrOutputStream::commit() {
  SURFEIT_RETURN_IF_ERROR(status_);
  return file_.commit();
}

std::string exrMessage(std::string_view text) {
  constexpr std::size_t kMaxBytes = 300;
  std::string message(text.substr(0, kMaxBytes));
  for (char& c : message) {
    if (c == '\n') c = ' ';
    if (c < 0x20 || c > 0x7e) c = '?';
  }
  return message;
}

}  // namespace surfeit
