// The raster cube: what a receiver sees, as six faces of pixels with coverage and radiosity (memo
// 3.4). The cube is aligned with the world's axes, so that projecting needs no trigonometry.
//
// A direction d belongs to the face of its largest component |d[axis]|; the faces are +x -x +y -y
// +z -z, and a point on one has the coordinates
//
//   u = d[axis + 1] / |d[axis]|, v = d[axis + 2] / |d[axis]|   (axes modulo 3), both in [-1, 1].
//
// Pixel index = (face * resolution + row of v) * resolution + column of u.
#pragma once

#include <cstddef>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

namespace surfeit {

// Directions and solid angles of the pixels for one resolution. Immutable, so threads may share it.
class RasterGeometry {
 public:
  static constexpr int kFaces = 6;
  static constexpr int kMinResolution = 2;
  static constexpr int kMaxResolution = 64;

  struct Pixel {
    glm::vec3 direction;  // unit, through the middle of the pixel
    float solid_angle;    // exact; those of all pixels sum to 4 pi
  };

  // `resolution` must be even, so that no pixel straddles an axis, and within the limits above.
  explicit RasterGeometry(int resolution);
  // The raster of a cone: one face, +x of a frame of its own whose x axis is the cone's, with
  // slopes to the tangent of `angle`, half of the cone's; radians, below pi / 2.
  static RasterGeometry cone(int resolution, float angle);

  static bool isValidResolution(int resolution) {
    return resolution >= kMinResolution && resolution <= kMaxResolution && resolution % 2 == 0;
  }
  static std::size_t pixelCount(int resolution) {
    return std::size_t(kFaces) * std::size_t(resolution) * std::size_t(resolution);
  }

  int resolution() const { return resolution_; }
  int faceCount() const { return face_count_; }
  std::size_t facePixels() const { return std::size_t(resolution_) * std::size_t(resolution_); }
  // Pixels along a face for a slope (u or v) of 1.
  float pixelsPerSlope() const { return 0.5f * float(resolution_) / largest_slope_; }
  std::span<const Pixel> pixels() const { return pixels_; }

 private:
  RasterGeometry(int resolution, int face_count, float largest_slope);

  int resolution_, face_count_;
  float largest_slope_;
  std::vector<Pixel> pixels_;
};

// Axes of a cone's frame: local coordinates are dot products with them.
struct ConeFrame {
  glm::vec3 x, y, z;

  explicit ConeFrame(const glm::vec3& axis);  // unit
};

}  // namespace surfeit
