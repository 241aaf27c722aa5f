// A picture that gives surfaces their reflectance: 8-bit sRGB in, scene-linear out.
#pragma once

#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <string>
#include <vector>

#include "surfeit/status.h"

namespace surfeit {

// Scene-linear value of an 8-bit sRGB value (IEC 61966-2-1).
float linearFromSrgb8(std::uint8_t value);
// The same for values in 0..1.
float linearFromSrgb(float value);

// Immutable once loaded.
class Texture {
 public:
  // Any format of stb_image (PNG, JPEG, TGA, BMP, ...). kIoError when the file cannot be opened,
  // kCorruption when it cannot be decoded or is larger than 2^28 pixels.
  static Result<Texture> load(const std::string& path);

  // A texture from rows of packed 8-bit sRGB rgb, top row first.
  Texture(int width, int height, std::vector<std::uint8_t> rgb);

  // Whether the file has alpha of which something is not opaque; it is not kept.
  bool hasAlpha() const { return has_alpha_; }

  int width() const { return width_; }
  int height() const { return height_; }

  // Bilinear between texel centres, in linear light; repeats outside 0..1. The origin is the
  // bottom left corner, as in OBJ files.
  glm::vec3 lookup(const glm::vec2& uv) const;
  // A number that differs between different textures.
  std::uint64_t content(std::uint64_t seed) const;

 private:
  glm::vec3 texel(int column, int row) const;

  int width_, height_;
  std::vector<std::uint8_t> rgb_;
  bool has_alpha_ = false;
};

// A picture that says how much of a surface is there. Immutable once loaded.
class Mask {
 public:
  // The alpha of the picture where it has one, else its lightness. Formats and errors as of
  // textures.
  static Result<Mask> load(const std::string& path);

  // From 0 (nothing) to 1, bilinear; coordinates as of textures.
  float lookup(const glm::vec2& uv) const;
  // A number that differs between different masks.
  std::uint64_t content(std::uint64_t seed) const;

 private:
  Mask(int width, int height, std::vector<std::uint8_t> values);

  int width_, height_;
  std::vector<std::uint8_t> values_;
};

}  // namespace surfeit
