// The samples of the picture while disks are drawn, several per pixel, and their reduction to
// pixels.
//
// Overlapping disks of one surface cross each other at random; drawing the nearest alone gives
// speckle. So the cloud is drawn twice (as in EWA surface splatting). The first pass finds for each
// sample the depth limit of its front surface: the smallest depth + thickness over all disks seen
// there, where a disk is about as thick as its radius. The second pass averages the values of the
// fragments before that limit, weighted towards the centres of their disks. Both are independent
// of the order of the disks, the second up to rounding.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "view/picture.h"

namespace surfeit {

// Rows are independent: threads may work on different rows at once.
class Framebuffer {
 public:
  // What the second pass gathers in a sample.
  struct Sample {
    glm::vec3 sum{0};     // of weight * value
    float weight = 0;     // 0: nothing is seen here
    float depth = 0;      // of the nearest fragment
    float depth_sum = 0;  // of weight * depth
  };

  // `samples` along each edge of a pixel.
  Framebuffer(int width, int height, int samples);

  // Bytes that a framebuffer of this size and the picture made from it take.
  static std::uint64_t bytes(int width, int height, int samples);

  // Sizes in samples.
  int width() const { return width_; }
  int height() const { return height_; }

  std::span<float> limitRow(int y) { return std::span(limit_).subspan(rowOffset(y), rowSize()); }
  std::span<Sample> row(int y) { return std::span(samples_).subspan(rowOffset(y), rowSize()); }

  // Forgets the values, not the limits: for a second pass with other values.
  void clearValues();

  // The picture: each pixel is the mean of its samples (box filter).
  Picture resolve() const;

 private:
  std::size_t rowOffset(int y) const { return std::size_t(y) * std::size_t(width_); }
  std::size_t rowSize() const { return std::size_t(width_); }

  int width_, height_, samples_per_edge_;
  std::vector<float> limit_;
  std::vector<Sample> samples_;
};

}  // namespace surfeit
