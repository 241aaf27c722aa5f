#include "view/framebuffer.h"

#include <algorithm>
#include <limits>

namespace surfeit {

Framebuffer::Framebuffer(int width, int height, int samples)
    : width_(width * samples),
      height_(height * samples),
      samples_per_edge_(samples),
      limit_(std::size_t(width_) * std::size_t(height_), std::numeric_limits<float>::infinity()),
      samples_(limit_.size()) {}

std::uint64_t Framebuffer::bytes(int width, int height, int samples) {
  const std::uint64_t pixels = std::uint64_t(width) * std::uint64_t(height);
  const std::uint64_t per_pixel = std::uint64_t(samples) * std::uint64_t(samples);
  return pixels * (per_pixel * (sizeof(float) + sizeof(Sample)) + sizeof(Picture::Pixel));
}

void Framebuffer::clearValues() { std::fill(samples_.begin(), samples_.end(), Sample()); }

Picture Framebuffer::resolve() const {
  const int n = samples_per_edge_;
  Picture picture;
  picture.width = width_ / n;
  picture.height = height_ / n;
  picture.pixels.resize(std::size_t(picture.width) * std::size_t(picture.height));
  const float share = 1 / float(n * n);

  for (int y = 0; y < height_; ++y) {
    const Sample* samples = samples_.data() + rowOffset(y);
    Picture::Pixel* pixels =
        picture.pixels.data() + std::size_t(y / n) * std::size_t(picture.width);
    for (int x = 0; x < width_; ++x) {
      const Sample& sample = samples[x];
      if (!(sample.weight > 0)) continue;
      Picture::Pixel& pixel = pixels[x / n];
      pixel.color += (share / sample.weight) * sample.sum;
      pixel.alpha += share;
      pixel.depth = std::min(pixel.depth, sample.depth);
    }
  }
  return picture;
}

}  // namespace surfeit
