#include "view/framebuffer.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <utility>

namespace surfeit {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

}  // namespace

Framebuffer::Framebuffer(int width, int height, int samples)
    : width_(width * samples),
      height_(height * samples),
      samples_per_edge_(samples),
      fronts_(std::size_t(width_) * std::size_t(height_)),
      limits_(fronts_.size()) {}

std::uint64_t Framebuffer::bytes(int width, int height, int samples) {
  const std::uint64_t pixels = std::uint64_t(width) * std::uint64_t(height);
  const std::uint64_t per_pixel = std::uint64_t(samples) * std::uint64_t(samples);
  return pixels * (per_pixel * (sizeof(float) + std::max(sizeof(Front), sizeof(Sample))) +
                   sizeof(Picture::Pixel));
}

void Framebuffer::Front::add(float depth, float thickness, bool is_core) {
  const Rim rim = {depth + thickness, thickness};
  if (is_core) {
    core = std::min(core, rim.limit);
    return;
  }
  for (std::size_t i = 0; i < std::size(rims); ++i) {
    if (rim.limit < rims[i].depth()) {  // a surface before this one
      std::copy_backward(rims + i, std::end(rims) - 1, std::end(rims));
      rims[i] = rim;
      return;
    }
    if (depth <= rims[i].limit) {
      if (rim.limit < rims[i].limit) rims[i] = rim;
      return;
    }
  }
}

bool Framebuffer::isBetweenCores(int x, int y, const Front::Rim& rim, int reach) const {
  constexpr int kLooks = 16;  // at most: cores of large disks are large
  const int stride = std::max(1, reach / kLooks);
  // The nearest to the eye on one side, and how far away it is. The surface goes on beyond the
  // picture
  const auto coreOn = [&](int step_x, int step_y) {
    std::pair<float, int> nearest = {kInfinity, 1};
    for (int i = stride; i <= reach; i += stride) {
      const int at_x = x + i * step_x, at_y = y + i * step_y;
      if (at_x < 0 || at_x >= width_ || at_y < 0 || at_y >= height_) {
        return std::min(nearest, {rim.limit, i});
      }
      const float core = fronts_[rowOffset(at_y) + std::size_t(at_x)].core;
      if (core < nearest.first) nearest = {core, i};
      if (core <= rim.limit) break;
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
    const Front& front = fronts_[rowOffset(y) + std::size_t(x)];
    float& limit = limits_[rowOffset(y) + std::size_t(x)];
    limit = front.core;
    for (const Front::Rim& rim : front.rims) {
      if (!(rim.limit < front.core)) break;
      // As wide as a disk as thick looks
      const float reach = 2 * rim.thickness / (slope_step * std::max(rim.depth(), 1e-30f));
      if (isBetweenCores(x, y, rim, int(std::min(std::ceil(reach), float(width_))))) {
        limit = rim.limit;
        break;
      }
    }
  }
}

void Framebuffer::beginValues() {
  fronts_ = {};
  samples_.resize(limits_.size());
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
