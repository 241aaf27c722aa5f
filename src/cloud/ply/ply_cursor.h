// A place in a PLY file, moving forward by bytes or, in ascii files, by words; behind it a small
// buffer.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "storage/byte_input.h"
#include "surfeit/status.h"

namespace surfeit {

// One thread at a time; the buffer takes 256 KiB.
class PlyCursor {
 public:
  explicit PlyCursor(ByteInput file) : file_(std::move(file)) {}

  ByteInput& file() { return file_; }
  const ByteInput& file() const { return file_; }
  // Of the next byte; may lie behind the end of the file after jumpTo.
  std::uint64_t offset() const { return end_offset_ - (end_ - begin_); }
  void jumpTo(std::uint64_t offset);
  // Passes over `size` bytes.
  void skip(std::uint64_t size);

  // Reads up to bytes.size() bytes; fewer only at the end of the file.
  Result<std::size_t> read(std::span<std::byte> bytes);

  // The next word of the line, cut off when it is too long to be a number; empty at the end of the
  // line or the file. The view lasts until the next call.
  std::string_view nextWord();
  // Whether no word and no line end is left, after nextWord() gave nothing.
  bool isAtEnd() const { return begin_ == end_; }
  // Passes over the line end that nextWord() stopped at, unless it was the file that ended.
  void passLineEnd() { begin_ += begin_ < end_ ? 1 : 0; }
  // Passes over line ends and blanks.
  void skipEmptyLines();
  // A system error ends the file for words: then, until jumpTo, it is here, and goes before any
  // complaint about the end.
  const Status& failure() const { return failure_; }

 private:
  void refill();
  void skipBlanks();

  ByteInput file_;
  // buffer_[begin_, end_) are the next bytes; the file goes on at end_offset_
  std::vector<std::byte> buffer_ = std::vector<std::byte>(256 << 10);
  std::size_t begin_ = 0, end_ = 0;
  std::uint64_t end_offset_ = 0;
  bool file_ended_ = false;  // the file has nothing at end_offset_
  Status failure_;
};

}  // namespace surfeit
