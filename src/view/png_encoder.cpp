#include <fmt/format.h>
#include <png.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "view/picture_file.h"
#include "view/srgb.h"

namespace surfeit {
namespace {

png_byte byteFromDisplay(float display) {
  return static_cast<png_byte>(std::lround(255 * std::clamp(display, 0.0f, 1.0f)));
}

std::vector<png_byte> displayBytes(const Picture& picture, const PngOptions& options) {
  // Light is mixed with the background scene-linear, data as it is
  const float gain = options.is_data ? 1 : std::exp2(options.exposure);
  const glm::vec3 background =
      options.is_data ? options.background : linearFromSrgb(options.background);
  std::vector<png_byte> bytes;
  bytes.reserve(3 * picture.pixels.size());
  for (const Picture::Pixel& pixel : picture.pixels) {
    const glm::vec3 color = gain * pixel.color + (1 - pixel.alpha) * background;
    for (int channel = 0; channel < 3; ++channel) {
      // A negative value has no place on the curve, and neither has one above 1
      const float value = std::clamp(color[channel], 0.0f, 1.0f);
      bytes.push_back(byteFromDisplay(options.is_data ? value : srgbFromLinear(value)));
    }
  }
  return bytes;
}

}  // namespace

Result<std::vector<std::byte>> encodePng(const Picture& picture, const PngOptions& options) {
  const std::vector<png_byte> pixels = displayBytes(picture, options);
  png_image image;
  std::memset(&image, 0, sizeof(image));
  image.version = PNG_IMAGE_VERSION;
  image.width = png_uint_32(picture.width);
  image.height = png_uint_32(picture.height);
  image.format = PNG_FORMAT_RGB;

  // The file is never larger than libpng's bound, so one pass is enough
  png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(image);
  std::vector<std::byte> file(size);
  if (png_image_write_to_memory(&image, file.data(), &size, 0, pixels.data(), 0, nullptr) == 0) {
    return Status::failed(fmt::format("libpng: {}", image.message));
  }
  file.resize(size);
  return file;
}

}  // namespace surfeit
