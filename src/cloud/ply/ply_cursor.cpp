#include "cloud/ply/ply_cursor.h"

#include <algorithm>
#include <cstring>

#include "cloud/ply/ply_number.h"

namespace surfeit {
namespace {

bool isBlank(std::byte byte) {
  const char c = static_cast<char>(byte);
  return c == ' ' || c == '\t' || c == '\v' || c == '\f';
}

// Of CR LF the second ends an empty line.
bool isLineEnd(std::byte byte) {
  return static_cast<char>(byte) == '\n' || static_cast<char>(byte) == '\r';
}

}  // namespace

void PlyCursor::jumpTo(std::uint64_t offset) {
  begin_ = end_ = 0;
  end_offset_ = offset;
  file_ended_ = false;
  failure_ = {};
}

void PlyCursor::skip(std::uint64_t size) {
  if (size <= end_ - begin_) {
    begin_ += static_cast<std::size_t>(size);
  } else {
    jumpTo(offset() + size);
  }
}

Result<std::size_t> PlyCursor::read(std::span<std::byte> bytes) {
  const std::size_t buffered = std::min(bytes.size(), end_ - begin_);
  std::copy_n(buffer_.begin() + static_cast<std::ptrdiff_t>(begin_), buffered, bytes.begin());
  begin_ += buffered;
  std::size_t done = buffered;
  while (done < bytes.size()) {
    const std::span<std::byte> rest = bytes.subspan(done);
    // Large reads go past the buffer, straight to where they are wanted
    if (rest.size() >= buffer_.size()) {
      SURFEIT_ASSIGN_OR_RETURN(const std::size_t got, file_.readSome(end_offset_, rest));
      end_offset_ += got;
      return done + got;
    }
    refill();
    SURFEIT_RETURN_IF_ERROR(failure_);
    if (begin_ == end_) break;
    const std::size_t size = std::min(rest.size(), end_ - begin_);
    std::memcpy(rest.data(), &buffer_[begin_], size);
    begin_ += size;
    done += size;
  }
  return done;
}

// Appends what fits behind the bytes that are left.
void PlyCursor::refill() {
  std::memmove(buffer_.data(), buffer_.data() + begin_, end_ - begin_);
  end_ -= begin_;
  begin_ = 0;
  const std::span<std::byte> room = std::span(buffer_).subspan(end_);
  const Result<std::size_t> got = file_.readSome(end_offset_, room);
  if (!got.ok()) failure_ = got.status();
  const std::size_t got_bytes = got.ok() ? *got : 0;
  file_ended_ = got_bytes < room.size();
  end_ += got_bytes;
  end_offset_ += got_bytes;
}

// Afterwards the cursor stands on a word, a line end or the end of the file, and a word is in the
// buffer as a whole unless it is too long to be a number. Inline: else ascii
// rows take 8 % longer.
inline void PlyCursor::skipBlanks() {
  for (;;) {
    const std::byte* next = buffer_.data() + begin_;
    const std::byte* const end = buffer_.data() + end_;
    while (next < end && isBlank(*next)) ++next;
    begin_ = static_cast<std::size_t>(next - buffer_.data());
    if (end_ - begin_ > kMaxPlyNumberChars || file_ended_) return;
    refill();
  }
}

std::string_view PlyCursor::nextWord() {
  skipBlanks();
  const std::byte* const begin = buffer_.data() + begin_;
  const std::byte* const limit = begin + std::min(end_ - begin_, kMaxPlyNumberChars + 1);
  const std::byte* last = begin;
  while (last < limit && !isBlank(*last) && !isLineEnd(*last)) ++last;
  const std::size_t size = static_cast<std::size_t>(last - begin);
  begin_ += size;
  return {reinterpret_cast<const char*>(begin), size};
}

void PlyCursor::skipEmptyLines() {
  for (skipBlanks(); begin_ < end_ && isLineEnd(buffer_[begin_]); skipBlanks()) ++begin_;
}

}  // namespace surfeit
