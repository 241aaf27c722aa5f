// Radiance pictures: lines of text up to an empty one, the size, then rows of pixels of four bytes
// (Ward, "Real Pixels", Graphics Gems II): mantissas of red, green and blue, and their exponent.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string_view>
#include <utility>
#include <vector>

#include "cloud/pictures/picture_reader.h"
#include "core/assert.h"

namespace surfeit {
namespace {

using Rgbe = std::array<std::uint8_t, 4>;

// The bytes of a file, one after the other.
class ByteCursor {
 public:
  explicit ByteCursor(InputFile file) : file_(std::move(file)), buffer_(kBufferBytes) {}

  std::uint64_t offset() const { return buffer_offset_ + next_; }

  Status readByte(std::uint8_t& byte) {
    if (next_ == end_) SURFEIT_RETURN_IF_ERROR(refill());
    byte = std::uint8_t(buffer_[next_++]);
    return {};
  }

 private:
  static constexpr std::size_t kBufferBytes = 1 << 16;

  Status refill() {
    buffer_offset_ += end_;
    next_ = end_ = 0;
    SURFEIT_ASSIGN_OR_RETURN(end_, file_.readSome(buffer_offset_, buffer_));
    if (end_ > 0) return {};
    return Status::corruption(
        fmt::format("{}: the file ends at {}, expected more pixels", file_.path(), buffer_offset_));
  }

  InputFile file_;
  std::vector<std::byte> buffer_;
  std::uint64_t buffer_offset_ = 0;
  std::size_t next_ = 0, end_ = 0;
};

// The number in front of a text, 0 for none, in whatever locale the caller is.
float numberIn(std::string_view text) {
  text.remove_prefix(std::min(text.find_first_not_of(" \t+"), text.size()));
  float number = 0;
  std::from_chars(text.data(), text.data() + text.size(), number);
  return number;
}

class RgbePicture final : public PictureReader {
 public:
  explicit RgbePicture(InputFile file) : PictureReader(file.path()), bytes_(std::move(file)) {}

  Status open() {
    std::string line;
    SURFEIT_RETURN_IF_ERROR(readLine(line));  // #?RADIANCE
    do {
      SURFEIT_RETURN_IF_ERROR(readLine(line));
      SURFEIT_RETURN_IF_ERROR(readVariable(line));
    } while (!line.empty());

    SURFEIT_RETURN_IF_ERROR(readLine(line));
    long long width = 0, height = 0;
    int length = 0;
    if (std::sscanf(line.c_str(), "-Y %10lld +X %10lld%n", &height, &width, &length) != 2 ||
        std::size_t(length) != line.size()) {
      return Status::corruption(
          fmt::format("{}: size '{}', expected -Y HEIGHT +X WIDTH", path(), line));
    }
    SURFEIT_RETURN_IF_ERROR(setSize(width, height));
    row_.resize(std::size_t(width));
    return {};
  }

  Status readRow(std::span<glm::vec3> row) override {
    SURFEIT_CHECK(row.size() == row_.size());
    if (failure_.ok()) failure_ = decodeRow();
    SURFEIT_RETURN_IF_ERROR(failure_);
    ++row_number_;
    std::transform(row_.begin(), row_.end(), row.begin(), [&](const Rgbe& pixel) {
      if (pixel[3] == 0) return glm::vec3(0);
      const float unit = scale_ * std::ldexp(1.0f, int(pixel[3]) - 136);
      return unit * glm::vec3(float(pixel[0]), float(pixel[1]), float(pixel[2]));
    });
    return {};
  }

 private:
  static constexpr std::size_t kMaxLine = 4096, kMaxHeader = 1 << 20;

  // A line without its end.
  Status readLine(std::string& line) {
    line.clear();
    for (;;) {
      std::uint8_t byte = 0;
      SURFEIT_RETURN_IF_ERROR(bytes_.readByte(byte));
      if (byte == '\n') break;
      if (line.size() == kMaxLine || bytes_.offset() > kMaxHeader) {
        return Status::corruption(
            fmt::format("{}: header: no end of the line at {}, expected a Radiance header", path(),
                        bytes_.offset()));
      }
      line += char(byte);
    }
    if (!line.empty() && line.back() == '\r') line.pop_back();
    return {};
  }

  // NAME=VALUE; others than these two do not change the picture.
  Status readVariable(std::string_view line) {
    constexpr std::string_view kFormat = "FORMAT=", kExposure = "EXPOSURE=";
    if (line.starts_with(kFormat) && line.substr(kFormat.size()) != "32-bit_rle_rgbe") {
      return Status::corruption(fmt::format("{}: format '{}', expected 32-bit_rle_rgbe", path(),
                                            line.substr(kFormat.size())));
    }
    if (line.starts_with(kExposure)) {
      const std::string_view value = line.substr(kExposure.size());
      scale_ /= numberIn(value);
      if (!(scale_ > 0) || !std::isfinite(scale_)) {
        return Status::corruption(
            fmt::format("{}: exposure '{}', expected a positive number", path(), value));
      }
    }
    return {};
  }

  Status decodeRow() {
    Rgbe pixel{};
    SURFEIT_RETURN_IF_ERROR(readPixel(pixel));
    const std::size_t width = row_.size();
    if (width < 8 || width > 0x7fff || pixel[0] != 2 || pixel[1] != 2 || pixel[2] >= 0x80) {
      return decodePixels(pixel);
    }
    const std::size_t found = std::size_t(pixel[2]) << 8 | pixel[3];
    if (found != width) {
      return damaged(fmt::format("a row of {} pixels, expected {}", found, width));
    }
    for (std::size_t component = 0; component < 4; ++component) {
      SURFEIT_RETURN_IF_ERROR(decodeComponent(component));
    }
    return {};
  }

  // One component of all pixels: counts over 128 repeat the byte that follows, others say how many
  // bytes follow.
  Status decodeComponent(std::size_t component) {
    std::size_t done = 0;
    while (done < row_.size()) {
      std::uint8_t count = 0, value = 0;
      SURFEIT_RETURN_IF_ERROR(bytes_.readByte(count));
      const bool repeats = count > 128;
      const std::size_t length = repeats ? std::size_t(count) - 128 : count;
      if (length == 0 || length > row_.size() - done) {
        return damaged(
            fmt::format("a run of {} bytes, expected 1 to {}", length, row_.size() - done));
      }
      for (std::size_t i = 0; i < length; ++i) {
        if (i == 0 || !repeats) SURFEIT_RETURN_IF_ERROR(bytes_.readByte(value));
        row_[done++][component] = value;
      }
    }
    return {};
  }

  // Whole pixels, the first of which has been read. 1 1 1 N repeats the one before N times; further
  // ones behind it count 256 times as much each.
  Status decodePixels(Rgbe pixel) {
    int shift = 0;
    for (std::size_t done = 0;;) {
      if (pixel[0] == 1 && pixel[1] == 1 && pixel[2] == 1) {
        const std::size_t length = shift < 24 ? std::size_t(pixel[3]) << shift : row_.size() + 1;
        if (done == 0 || length > row_.size() - done) {
          return damaged(fmt::format("a run of {} pixels after {}, expected {} at most", length,
                                     done, done == 0 ? 0 : row_.size() - done));
        }
        std::fill_n(row_.begin() + std::ptrdiff_t(done), length, row_[done - 1]);
        done += length;
        shift += 8;
      } else {
        row_[done++] = pixel;
        shift = 0;
      }
      if (done == row_.size()) return {};
      SURFEIT_RETURN_IF_ERROR(readPixel(pixel));
    }
  }

  Status readPixel(Rgbe& pixel) {
    for (std::uint8_t& byte : pixel) SURFEIT_RETURN_IF_ERROR(bytes_.readByte(byte));
    return {};
  }

  Status damaged(const std::string& what) const {
    return Status::corruption(
        fmt::format("{}: row {} before {}: {}", path(), row_number_, bytes_.offset(), what));
  }

  ByteCursor bytes_;
  float scale_ = 1;
  std::vector<Rgbe> row_;
  std::uint64_t row_number_ = 0;
  Status failure_;
};

}  // namespace

Result<std::unique_ptr<PictureReader>> openRgbePicture(InputFile file) {
  auto picture = std::make_unique<RgbePicture>(std::move(file));
  SURFEIT_RETURN_IF_ERROR(picture->open());
  return std::unique_ptr<PictureReader>(std::move(picture));
}

}  // namespace surfeit
