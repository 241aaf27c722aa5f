#include "sample/texture.h"

#include <fmt/format.h>
#include <stb/stb_image.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <utility>

#include "core/assert.h"
#include "io/file.h"

namespace surfeit {
namespace {

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
  // Our own open first: stb_image does not tell a missing file from a damaged one
  SURFEIT_ASSIGN_OR_RETURN(const InputFile file, InputFile::open(path));
  int width = 0, height = 0, channels = 0;
  constexpr std::uint64_t kMaxTexels = std::uint64_t{1} << 28;
  if (stbi_info(path.c_str(), &width, &height, &channels) == 0 || width <= 0 || height <= 0) {
    return Status::corruption(fmt::format("{}: not a picture: {}", path, stbi_failure_reason()));
  }
  if (std::uint64_t(width) * std::uint64_t(height) > kMaxTexels) {
    return Status::corruption(
        fmt::format("{}: {} x {} texels, expected at most 2^28", path, width, height));
  }
  unsigned char* const texels = stbi_load(path.c_str(), &width, &height, &channels, 3);
  if (texels == nullptr) {
    return Status::corruption(fmt::format("{}: not a picture: {}", path, stbi_failure_reason()));
  }
  std::vector<std::uint8_t> rgb(texels, texels + std::size_t(width) * std::size_t(height) * 3);
  stbi_image_free(texels);
  return Texture(width, height, std::move(rgb));
}

glm::vec3 Texture::texel(int column, int row) const {
  const std::uint8_t* const rgb =
      &rgb_[(std::size_t(row) * std::size_t(width_) + std::size_t(column)) * 3];
  return {linearFromSrgb8(rgb[0]), linearFromSrgb8(rgb[1]), linearFromSrgb8(rgb[2])};
}

glm::vec3 Texture::lookup(const glm::vec2& uv) const {
  if (!std::isfinite(uv.x) || !std::isfinite(uv.y)) return texel(0, 0);
  const Footprint column = footprint(uv.x, width_);
  const Footprint row = footprint(1.0f - uv.y, height_);
  const glm::vec3 upper = texel(column.first, row.first) * (1.0f - column.weight) +
                          texel(column.second, row.first) * column.weight;
  const glm::vec3 lower = texel(column.first, row.second) * (1.0f - column.weight) +
                          texel(column.second, row.second) * column.weight;
  return upper * (1.0f - row.weight) + lower * row.weight;
}

}  // namespace surfeit
