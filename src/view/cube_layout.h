// The unfolded raster cube: where in a picture the pixels of each face lie, as one sees them from
// inside, not mirrored.
//
//            [ above ]
//   [ left ] [ middle ] [ right ] [ behind ]
//            [ below ]
//
// The middle is the face that the receiver's normal points to; without a normal it is the view
// level ahead. Looking up, what is above in the picture lies behind; looking down, ahead: as when
// one bends the head back or down. A cone has its one face, with up as near the top as a quarter
// turn allows.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include "surfeit/cube.h"
#include "surfeit/up_axis.h"

namespace surfeit {

// Immutable; safe from any thread.
class CubeLayout {
 public:
  static constexpr std::int32_t kOutside = -1;

  CubeLayout(const CubeImage& cube, UpAxis up);

  // Pixels, one for each of the raster's.
  int width() const { return width_; }
  int height() const { return height_; }
  // The place in CubeImage::pixels, or kOutside beside the faces. Rows from the top.
  std::int32_t pixel(int x, int y) const {
    return pixels_[std::size_t(y) * std::size_t(width_) + std::size_t(x)];
  }

 private:
  void place(const CubeImage& cube, int column, int row, const glm::vec3& look,
             const glm::vec3& up);

  int width_, height_;
  std::vector<std::int32_t> pixels_;
};

}  // namespace surfeit
