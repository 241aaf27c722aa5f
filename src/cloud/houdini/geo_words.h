// Words of Houdini's geometry as text.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "storage/byte_input.h"
#include "surfeit/status.h"

namespace surfeit {

// Words of a file between blanks; each of some letters is a word of its own. One thread at a time;
// takes 256 KiB.
class GeoWords {
 public:
  static constexpr std::size_t kMaxWordBytes = 4096;

  GeoWords(ByteInput input, std::string_view own_words)
      : input_(std::move(input)), own_words_(own_words) {}

  const ByteInput& input() const { return input_; }
  // Of the word that next() gave last.
  std::uint64_t offset() const { return word_offset_; }
  std::uint64_t nextOffset() const { return buffer_offset_ + begin_; }
  void moveTo(std::uint64_t offset) {
    buffer_offset_ = offset;
    begin_ = end_ = 0;
    has_ended_ = false;
  }

  // The next word, empty at the end of the file; at most kMaxWordBytes of it. The view lasts until
  // the next call.
  Status next(std::string_view& word) {
    while (true) {
      while (begin_ < end_ && isBlank(buffer_[begin_])) ++begin_;
      if (begin_ < end_) break;
      SURFEIT_RETURN_IF_ERROR(refill());
      if (begin_ == end_) break;
    }
    if (end_ - begin_ < kMaxWordBytes) SURFEIT_RETURN_IF_ERROR(refill());

    word_offset_ = nextOffset();
    std::size_t size = 0;
    const std::size_t most = std::min(end_ - begin_, kMaxWordBytes);
    while (size < most && !isBlank(buffer_[begin_ + size]) && !isOwnWord(begin_ + size)) ++size;
    if (size == 0 && most > 0) size = 1;  // a word of its own
    word = std::string_view(buffer_.data() + begin_, size);
    begin_ += size;
    return {};
  }

 private:
  static constexpr std::size_t kBufferBytes = 256 << 10;

  static bool isBlank(char letter) {
    return letter == ' ' || letter == '\t' || letter == '\n' || letter == '\r';
  }
  bool isOwnWord(std::size_t at) const { return own_words_.find(buffer_[at]) != own_words_.npos; }

  // Moves what is left to the front and reads on behind it.
  Status refill() {
    if (has_ended_ || end_ - begin_ == buffer_.size()) return {};
    std::memmove(buffer_.data(), buffer_.data() + begin_, end_ - begin_);
    buffer_offset_ += begin_;
    end_ -= begin_;
    begin_ = 0;
    const auto room = std::as_writable_bytes(std::span(buffer_)).subspan(end_);
    SURFEIT_ASSIGN_OR_RETURN(const std::size_t got, input_.readSome(buffer_offset_ + end_, room));
    end_ += got;
    has_ended_ = got == 0;
    return {};
  }

  ByteInput input_;
  std::string_view own_words_;
  std::vector<char> buffer_ = std::vector<char>(kBufferBytes);
  std::size_t begin_ = 0, end_ = 0;
  std::uint64_t buffer_offset_ = 0, word_offset_ = 0;
  bool has_ended_ = false;  // the file has nothing behind the buffer
};

}  // namespace surfeit
