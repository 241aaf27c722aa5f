#include "view/framebuffer.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <utility>

namespace surfeit {

Framebuffer::Framebuffer(int width, int height, int samples)
    : width_(width * samples),
      height_(height * samples),
      samples_per_edge_(samples),
      fronts_(std::size_t(width_) * std::size_t(height_)),
      samples_(fronts_.size()) {}

std::uint64_t Framebuffer::bytes(int width, int height, int samples) {
  const std::uint64_t pixels = std::uint64_t(width) * std::uint64_t(height);
  const std::uint64_t per_pixel = std::uint64_t(samples) * std::uint64_t(samples);
  return pixels * (per_pixel * (sizeof(Front) + sizeof(Sample)) + sizeof(Picture::Pixel));
}

void Framebuffer::Front::add(float depth, float thickness, bool is_core) {
  const float limit_of_it = depth + thickness;
  if (is_core) {
    core = std::min(core, limit_of_it);
  } else if (limit_of_it < rims[0].limit) {
    if (limit_of_it < rims[0].depth()) rims[1] = rims[0];
    rims[0] = {limit_of_it, thickness};
  } else if (depth > rims[0].limit && limit_of_it < rims[1].limit) {
    rims[1] = {limit_of_it, thickness};
  }
}

bool Framebuffer::isBetweenCores(int x, int y, const Front::Rim& rim, int reach) const {
  // The nearest to the eye on one side, and how far away it is. The surface goes on beyond the
  // picture
  const auto coreOn = [&](int step_x, int step_y) {
    std::pair<float, int> nearest = {std::numeric_limits<float>::infinity(), 1};
    for (int i = 1; i <= reach; ++i) {
      const int at_x = x + i * step_x, at_y = y + i * step_y;
      if (at_x < 0 || at_x >= width_ || at_y < 0 || at_y >= height_) {
        return std::min(nearest, {rim.limit, i});
      }
      const float core = fronts_[rowOffset(at_y) + std::size_t(at_x)].core;
      if (core < nearest.first) nearest = {core, i};
    }
    return nearest;
  };
  constexpr int kDirections[8][2] = {{1, 0}, {0, 1}, {1, 1},  {1, -1},
                                     {2, 1}, {1, 2}, {2, -1}, {1, -2}};
  return std::any_of(std::begin(kDirections), std::end(kDirections), [&](const int(&step)[2]) {
    const auto [limit, distance] = coreOn(step[0], step[1]);
    const auto [other_limit, other_distance] = coreOn(-step[0], -step[1]);
    const float between = (limit * float(other_distance) + other_limit * float(distance)) /
                          float(distance + other_distance);
    return between <= rim.limit + rim.thickness;
  });
}

void Framebuffer::closeRow(int y, float slope_step) {
  for (int x = 0; x < width_; ++x) {
    Front& front = fronts_[rowOffset(y) + std::size_t(x)];
    front.limit = front.core;
    for (const Front::Rim& rim : front.rims) {
      if (!(rim.limit < front.core)) break;
      // As wide as a disk as thick looks
      const float reach = 2 * rim.thickness / (slope_step * std::max(rim.depth(), 1e-30f));
      if (isBetweenCores(x, y, rim, int(std::min(std::ceil(reach), float(width_))))) {
        front.limit = rim.limit;
        break;
      }
    }
  }
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
