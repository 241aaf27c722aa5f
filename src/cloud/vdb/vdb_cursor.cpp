#include "cloud/vdb/vdb_cursor.h"

#include <fmt/format.h>

#include <algorithm>

namespace surfeit {
namespace {

constexpr std::size_t kReadBytes = 64 * 1024;
constexpr std::uint32_t kMaxTextBytes = 64 * 1024;

}  // namespace

VdbCursor::VdbCursor(const InputFile& file, std::uint64_t begin, std::uint64_t end)
    : file_(&file), buffer_offset_(begin), end_(end) {}

Result<Bytes> VdbCursor::take(std::uint64_t size) {
  if (size > left()) {
    return corrupt(fmt::format("{} bytes expected, {} are left", size, left()));
  }
  const std::size_t bytes = static_cast<std::size_t>(size);
  if (view_.size() - position_ < bytes) {
    const std::uint64_t begin = offset();
    const std::size_t wanted =
        static_cast<std::size_t>(std::min<std::uint64_t>(std::max(bytes, kReadBytes), left()));
    SURFEIT_ASSIGN_OR_RETURN(view_, file_->readView(begin, wanted, buffer_));
    buffer_offset_ = begin;
    position_ = 0;
    if (view_.size() < bytes) {
      return corrupt(fmt::format("{} bytes expected, {} are left", size, view_.size()));
    }
  }
  const Bytes taken = view_.subspan(position_, bytes);
  position_ += bytes;
  return taken;
}

Status VdbCursor::skip(std::uint64_t size) {
  if (size > left()) {
    return corrupt(fmt::format("{} bytes expected, {} are left", size, left()));
  }
  if (size <= view_.size() - position_) {
    position_ += static_cast<std::size_t>(size);
  } else {
    buffer_offset_ = offset() + size;
    position_ = 0;
    view_ = {};
  }
  return {};
}

Status VdbCursor::readText(std::string& text) {
  std::uint32_t size = 0;
  SURFEIT_RETURN_IF_ERROR(read(size));
  if (size > kMaxTextBytes) {
    return corrupt(fmt::format("a text of {} bytes, expected at most {}", size, kMaxTextBytes));
  }
  SURFEIT_ASSIGN_OR_RETURN(const Bytes bytes, take(size));
  text.assign(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  return {};
}

Status VdbCursor::corrupt(const std::string& what) const {
  return Status::corruption(fmt::format("{}: at {}: {}", path(), offset(), what));
}

}  // namespace surfeit
