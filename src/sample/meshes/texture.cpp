#include "sample/meshes/texture.h"

#include <fmt/format.h>
#include <stb/stb_image.h>
#include <xxhash.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <span>
#include <string_view>
#include <utility>

#include "core/assert.h"
#include "core/luminance.h"
#include "storage/file.h"

namespace surfeit {
namespace {

using std::string_view_literals::operator""sv;

std::array<float, 256> makeSrgbTable() {
  std::array<float, 256> table{};
  for (std::size_t i = 0; i < table.size(); ++i) table[i] = linearFromSrgb(float(i) / 255.0f);
  return table;
}

// Texel left of (or below) a coordinate, its right neighbour, and the weight of the neighbour.
struct Footprint {
  int first, second;
  float weight;
};

Footprint footprint(float coordinate, int texels) {
  // The fraction first: a large coordinate must not overflow the integer
  const float in_texels = (coordinate - std::floor(coordinate)) * float(texels) - 0.5f;
  const float left = std::floor(in_texels);
  const int first = (int(left) + texels) % texels;
  return {first, (first + 1) % texels, in_texels - left};
}

template <typename Texel>
auto interpolate(const Footprint& column, const Footprint& row, Texel texel) {
  const auto upper = texel(column.first, row.first) * (1.0f - column.weight) +
                     texel(column.second, row.first) * column.weight;
  const auto lower = texel(column.first, row.second) * (1.0f - column.weight) +
                     texel(column.second, row.second) * column.weight;
  return upper * (1.0f - row.weight) + lower * row.weight;
}

struct Picture {
  int width, height;
  bool has_alpha;                    // in the file
  std::vector<std::uint8_t> texels;  // rgba
};

// Pictures that the library does not read, by what stands at a place of theirs.
struct OtherPicture {
  std::size_t offset;
  std::string_view magic;
  const char* name;
  const char* advice = "convert it to PNG of 8 bits";
};
constexpr const char* kLightAdvice =
    "save it as PNG, with the largest value at white, and multiply by that in Kd or Ke";
constexpr OtherPicture kOtherPictures[] = {
    {8, "WEBP"sv, "WebP"},
    {0, "II*\0"sv, "TIFF"},
    {0, "MM\0*"sv, "TIFF"},
    {0, "II+\0"sv, "TIFF (BigTIFF)"},
    {0, "MM\0+"sv, "TIFF (BigTIFF)"},
    {0, "\x76\x2f\x31\x01"sv, "OpenEXR", kLightAdvice},
    {4, "ftypavif"sv, "AVIF"},
    {4, "ftypheic"sv, "HEIC"},
    {4, "ftypmif1"sv, "HEIC or AVIF"},
    {0, "DDS "sv, "DDS"},
    {0, "\xabKTX"sv, "KTX"},
    {4, "jP  "sv, "JPEG 2000"},
    {0, "\xff\x4f\xff\x51"sv, "JPEG 2000"},
    {4, "JXL "sv, "JPEG XL"},
    {0, "\xff\x0a"sv, "JPEG XL"},
    {0, "\x01\xda"sv, "SGI"},
    {0, "Ptex"sv, "Ptex"},
    {0, "qoif"sv, "QOI"},
    {0, "<svg"sv, "SVG"},
    {0, "\0\0\x01\0"sv, "ICO"},
    {0, "version https://git-lfs"sv, "a pointer of Git LFS",
     "fetch the file itself: `git lfs pull`"},
};

// Of a file that the library does not decode.
Status notAPicture(const InputFile& file) {
  std::array<char, 32> begin{};
  SURFEIT_ASSIGN_OR_RETURN(const std::size_t count,
                           file.readSome(0, std::as_writable_bytes(std::span(begin))));
  const std::string_view text(begin.data(), count);
  for (const OtherPicture& other : kOtherPictures) {
    if (text.size() < other.offset || !text.substr(other.offset).starts_with(other.magic)) continue;
    return Status::corruption(fmt::format("{}: found {}, expected PNG, JPEG, TGA or BMP: {}",
                                          file.path(), other.name, other.advice));
  }
  return Status::corruption(
      fmt::format("{}: not a picture: {}", file.path(), stbi_failure_reason()));
}

Result<Picture> loadPicture(const std::string& path) {
  // Our own open first: stb_image does not tell a missing file from a damaged one
  SURFEIT_ASSIGN_OR_RETURN(const InputFile file, InputFile::open(path));
  int width = 0, height = 0, channels = 0;
  constexpr std::uint64_t kMaxTexels = std::uint64_t{1} << 28;
  if (stbi_info(path.c_str(), &width, &height, &channels) == 0 || width <= 0 || height <= 0) {
    return notAPicture(file);
  }
  if (std::uint64_t(width) * std::uint64_t(height) > kMaxTexels) {
    return Status::corruption(
        fmt::format("{}: {} x {} texels, expected at most 2^28", path, width, height));
  }
  // The library would cut light at 1 and code it by a curve that is not sRGB's
  if (stbi_is_hdr(path.c_str()) != 0) {
    return Status::corruption(fmt::format(
        "{}: found a Radiance picture, which textures are not made of, expected 8 bits a color: {}",
        path, kLightAdvice));
  }
  unsigned char* const texels = stbi_load(path.c_str(), &width, &height, &channels, 4);
  if (texels == nullptr) {
    return Status::corruption(fmt::format("{}: not a picture: {}", path, stbi_failure_reason()));
  }
  Picture picture{width, height, channels == 2 || channels == 4, {}};
  picture.texels.assign(texels, texels + std::size_t(width) * std::size_t(height) * 4);
  stbi_image_free(texels);
  return picture;
}

}  // namespace

float linearFromSrgb(float value) {
  return value <= 0.04045f ? value / 12.92f : std::pow((value + 0.055f) / 1.055f, 2.4f);
}

float linearFromSrgb8(std::uint8_t value) {
  static const std::array<float, 256> table = makeSrgbTable();
  return table[value];
}

Texture::Texture(int width, int height, std::vector<std::uint8_t> rgb)
    : width_(width), height_(height), rgb_(std::move(rgb)) {
  SURFEIT_CHECK(width > 0 && height > 0 &&
                rgb_.size() == std::size_t(width) * std::size_t(height) * 3);
}

Result<Texture> Texture::load(const std::string& path) {
  SURFEIT_ASSIGN_OR_RETURN(const Picture picture, loadPicture(path));
  const std::size_t count = picture.texels.size() / 4;
  std::vector<std::uint8_t> rgb(count * 3);
  bool has_alpha = false;
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint8_t* const texel = &picture.texels[4 * i];
    std::copy_n(texel, 3, &rgb[3 * i]);
    has_alpha = has_alpha || texel[3] < 255;
  }
  Texture texture(picture.width, picture.height, std::move(rgb));
  texture.has_alpha_ = has_alpha;
  return texture;
}

Mask::Mask(int width, int height, std::vector<std::uint8_t> values)
    : width_(width), height_(height), values_(std::move(values)) {}

Result<Mask> Mask::load(const std::string& path) {
  SURFEIT_ASSIGN_OR_RETURN(const Picture picture, loadPicture(path));
  const std::size_t count = picture.texels.size() / 4;
  std::vector<std::uint8_t> values(count);
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint8_t* const texel = &picture.texels[4 * i];
    // Of codes: masks are data and have no curve
    const double lightness = luminance(glm::dvec3(texel[0], texel[1], texel[2]));
    values[i] = picture.has_alpha ? texel[3] : std::uint8_t(std::lround(lightness));
  }
  return Mask(picture.width, picture.height, std::move(values));
}

float Mask::lookup(const glm::vec2& uv) const {
  const auto texel = [&](int column, int row) {
    return float(values_[std::size_t(row) * std::size_t(width_) + std::size_t(column)]) / 255;
  };
  if (!std::isfinite(uv.x) || !std::isfinite(uv.y)) return texel(0, 0);
  return interpolate(footprint(uv.x, width_), footprint(1.0f - uv.y, height_), texel);
}

glm::vec3 Texture::texel(int column, int row) const {
  const std::uint8_t* const rgb =
      &rgb_[(std::size_t(row) * std::size_t(width_) + std::size_t(column)) * 3];
  return {linearFromSrgb8(rgb[0]), linearFromSrgb8(rgb[1]), linearFromSrgb8(rgb[2])};
}

glm::vec3 Texture::lookup(const glm::vec2& uv) const {
  if (!std::isfinite(uv.x) || !std::isfinite(uv.y)) return texel(0, 0);
  return interpolate(footprint(uv.x, width_), footprint(1.0f - uv.y, height_),
                     [&](int column, int row) { return texel(column, row); });
}

std::uint64_t Texture::content(std::uint64_t seed) const {
  return XXH3_64bits_withSeed(rgb_.data(), rgb_.size(), seed ^ std::uint64_t(width_));
}

std::uint64_t Mask::content(std::uint64_t seed) const {
  return XXH3_64bits_withSeed(values_.data(), values_.size(), seed ^ std::uint64_t(width_));
}

}  // namespace surfeit
