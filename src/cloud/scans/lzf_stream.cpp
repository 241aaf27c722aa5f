#include "cloud/scans/lzf_stream.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <string_view>
#include <vector>

namespace surfeit {
namespace {

constexpr std::size_t kReach = 8192;  // of copies
constexpr std::size_t kInputBytes = 64 << 10, kOutputBytes = 256 << 10;

class LzfDecoder {
 public:
  LzfDecoder(ByteInput& input, std::uint64_t offset, std::uint64_t size, TemporaryFile& output)
      : input_(input), begin_(offset), next_(offset), left_(size), output_(output) {}

  // [ 000 | bytes - 1 : 5 ] literal bytes, or
  // [ length - 2 : 3, 7: the next byte is added | distance - 1 : 5 ] [ its low bits : 8 ]
  Status run(std::uint64_t expected) {
    while (left_ + in_.size() - at_ > 0) {
      SURFEIT_ASSIGN_OR_RETURN(const std::size_t control, nextByte());
      std::size_t length = control >> 5;
      if (length == 0) {
        length = control + 1;
        if (produced() + length > expected) return tooLong(expected);
        for (std::size_t i = 0; i < length; ++i) {
          SURFEIT_ASSIGN_OR_RETURN(const std::size_t literal, nextByte());
          out_.push_back(static_cast<std::byte>(literal));
        }
      } else {
        if (length == 7) {
          SURFEIT_ASSIGN_OR_RETURN(const std::size_t more, nextByte());
          length += more;
        }
        SURFEIT_ASSIGN_OR_RETURN(const std::size_t low, nextByte());
        const std::size_t distance = ((control & 31) << 8 | low) + 1;
        length += 2;
        if (produced() + length > expected) return tooLong(expected);
        if (distance > produced()) {
          return damaged(fmt::format("a copy of what came {} bytes before, expected at most {}",
                                     distance, produced()));
        }
        // The two may overlap: what was just written is copied again
        for (std::size_t i = 0; i < length; ++i) out_.push_back(out_[out_.size() - distance]);
      }
      if (out_.size() >= kOutputBytes) SURFEIT_RETURN_IF_ERROR(write(kReach));
    }
    if (produced() != expected) {
      return damaged(fmt::format("{} bytes come out, expected {}", produced(), expected));
    }
    SURFEIT_RETURN_IF_ERROR(write(0));
    return output_.flush();
  }

 private:
  std::uint64_t produced() const { return written_ + out_.size(); }

  Status damaged(std::string_view what) const {
    return Status::corruption(fmt::format("{}: compressed points at {}: byte {}: {}", input_.path(),
                                          begin_, next_ - in_.size() + at_, what));
  }
  Status tooLong(std::uint64_t expected) const {
    return damaged(fmt::format("more than {} bytes come out, expected that many", expected));
  }

  Result<std::size_t> nextByte() {
    if (at_ == in_.size()) {
      in_.resize(static_cast<std::size_t>(std::min<std::uint64_t>(kInputBytes, left_)));
      at_ = 0;
      if (in_.empty()) return damaged("ends in the middle, expected more");
      SURFEIT_RETURN_IF_ERROR(input_.readAt(next_, in_));
      next_ += in_.size();
      left_ -= in_.size();
    }
    return std::to_integer<std::size_t>(in_[at_++]);
  }

  // All but the last `kept` bytes.
  Status write(std::size_t kept) {
    const std::size_t size = out_.size() - std::min(out_.size(), kept);
    SURFEIT_RETURN_IF_ERROR(output_.append(Bytes(out_).first(size)).status());
    written_ += size;
    out_.erase(out_.begin(), out_.begin() + static_cast<std::ptrdiff_t>(size));
    return {};
  }

  ByteInput& input_;
  const std::uint64_t begin_;
  std::uint64_t next_, left_;  // of the file, behind what is in in_
  TemporaryFile& output_;
  std::vector<std::byte> in_;
  std::size_t at_ = 0;
  std::vector<std::byte> out_;  // the last bytes, which copies may reach
  std::uint64_t written_ = 0;
};

}  // namespace

Status decodeLzf(ByteInput& input, std::uint64_t offset, std::uint64_t size, std::uint64_t expected,
                 TemporaryFile& output) {
  return LzfDecoder(input, offset, size, output).run(expected);
}

}  // namespace surfeit
