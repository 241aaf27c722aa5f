// The samples of the picture while disks are drawn, several per pixel, and their reduction to
// pixels.
//
// Overlapping disks of one surface cross each other at random; drawing the nearest alone gives
// speckle. So the cloud is drawn twice (as in EWA surface splatting). The first pass finds for each
// sample the depth limit of its front surface: the smallest depth + thickness over all disks seen
// there, where a disk is about as thick as its radius. The second pass averages the values of the
// fragments before that limit, weighted towards the centres of their disks. Both are independent
// of the order of the disks, the second up to rounding.
//
// Rims of disks fill the gaps between the cores of a surface, but also reach beyond its edges. So a
// rim that is before all cores at its sample counts only where it lies on the line between two
// cores on either side of the sample, in one of eight directions, as near as disks are wide. Rims
// of one surface count as one, so their order may matter where surfaces touch.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <limits>
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

  // What the first pass finds in a sample.
  struct Front {
    struct Rim {
      float limit = std::numeric_limits<float>::infinity();
      float thickness = 0;
      float depth() const { return limit - thickness; }
    };
    float core = std::numeric_limits<float>::infinity();  // limit by cores
    Rim rims[3];  // of surfaces behind each other, the nearest first

    void add(float depth, float thickness, bool is_core);
  };

  // `samples` along each edge of a pixel.
  Framebuffer(int width, int height, int samples);

  // Bytes that a framebuffer of this size and the picture made from it take.
  static std::uint64_t bytes(int width, int height, int samples);

  // Sizes in samples.
  int width() const { return width_; }
  int height() const { return height_; }

  // Until the values begin.
  std::span<Front> frontRow(int y) { return std::span(fronts_).subspan(rowOffset(y), rowSize()); }
  std::span<const float> limitRow(int y) const {
    return std::span(limits_).subspan(rowOffset(y), rowSize());
  }
  std::span<Sample> row(int y) { return std::span(samples_).subspan(rowOffset(y), rowSize()); }

  // Decides the limits of a row, once all fronts are known. `slope_step`: the slope of a sample.
  void closeRow(int y, float slope_step);
  // Gives the memory of the fronts to the values, once all rows are closed.
  void beginValues();

  // Forgets the values, not the limits: for a second pass with other values.
  void clearValues();

  // The picture: each pixel is the mean of its samples (box filter).
  Picture resolve() const;

 private:
  std::size_t rowOffset(int y) const { return std::size_t(y) * std::size_t(width_); }
  std::size_t rowSize() const { return std::size_t(width_); }

  bool isBetweenCores(int x, int y, const Front::Rim& rim, int reach) const;

  int width_, height_, samples_per_edge_;
  std::vector<Front> fronts_;
  std::vector<float> limits_;
  std::vector<Sample> samples_;
};

}  // namespace surfeit
