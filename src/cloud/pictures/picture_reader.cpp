#include "cloud/pictures/picture_reader.h"

#include <fmt/format.h>

#include <array>
#include <cstddef>
#include <cstring>
#include <utility>

namespace surfeit {

Result<std::unique_ptr<PictureReader>> PictureReader::open(const std::string& path) {
  SURFEIT_ASSIGN_OR_RETURN(InputFile file, InputFile::open(path));
  std::array<std::byte, 4> magic{};
  SURFEIT_ASSIGN_OR_RETURN(const std::size_t size, file.readSome(0, magic));
  if (size == magic.size() && std::memcmp(magic.data(), "\x76\x2f\x31\x01", 4) == 0) {
    return openExrPicture(std::move(file));
  }
  if (size >= 2 && std::memcmp(magic.data(), "#?", 2) == 0) return openRgbePicture(std::move(file));

  std::string found;
  for (std::size_t i = 0; i < size; ++i) found += fmt::format(" {:02x}", unsigned(magic[i]));
  return Status::corruption(
      fmt::format("{}: begins with{}, expected 76 2f 31 01 (OpenEXR) or 23 3f (Radiance)", path,
                  size == 0 ? " nothing" : found));
}

Status PictureReader::setSize(std::int64_t width, std::int64_t height) {
  if (width <= 0 || height <= 0) {
    return Status::corruption(
        fmt::format("{}: {} x {} pixels, expected at least one", path_, width, height));
  }
  if (width > kMaxEdge || height > kMaxEdge ||
      std::uint64_t(width) * std::uint64_t(height) > kMaxPixels) {
    return Status::invalidArgument(
        fmt::format("{}: {} x {} pixels, expected at most {} and an edge of at most {}", path_,
                    width, height, kMaxPixels, kMaxEdge));
  }
  width_ = int(width);
  height_ = int(height);
  return {};
}

}  // namespace surfeit
