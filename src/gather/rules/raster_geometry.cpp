#include "gather/rules/raster_geometry.h"

#include <cmath>

#include "core/assert.h"
#include "core/tangent_frame.h"

namespace surfeit {
namespace {

// Solid angle of the part of a face from its middle to (u, v): atan(u v / sqrt(u^2 + v^2 + 1)).
double cornerSolidAngle(double u, double v) {
  return std::atan2(u * v, std::sqrt(u * u + v * v + 1));
}

}  // namespace

RasterGeometry::RasterGeometry(int resolution) : RasterGeometry(resolution, kFaces, 1) {}

RasterGeometry RasterGeometry::cone(int resolution, float angle) {
  return RasterGeometry(resolution, 1, std::tan(angle));
}

RasterGeometry::RasterGeometry(int resolution, int face_count, float largest_slope)
    : resolution_(resolution), face_count_(face_count), largest_slope_(largest_slope) {
  SURFEIT_CHECK(isValidResolution(resolution));
  pixels_.reserve(std::size_t(face_count) * std::size_t(resolution) * std::size_t(resolution));
  const double slope = largest_slope, step = 2 * slope / resolution;
  for (int face = 0; face < face_count; ++face) {
    const int axis = face / 2;
    for (int row = 0; row < resolution; ++row) {
      for (int column = 0; column < resolution; ++column) {
        const double u = -slope + column * step, v = -slope + row * step;
        glm::vec3 direction;
        direction[axis] = face % 2 == 0 ? 1.f : -1.f;
        direction[(axis + 1) % 3] = float(u + step / 2);
        direction[(axis + 2) % 3] = float(v + step / 2);
        const double solid_angle = cornerSolidAngle(u + step, v + step) -
                                   cornerSolidAngle(u, v + step) - cornerSolidAngle(u + step, v) +
                                   cornerSolidAngle(u, v);
        pixels_.push_back({glm::normalize(direction), float(solid_angle)});
      }
    }
  }
}

ConeFrame::ConeFrame(const glm::vec3& axis) : x(axis) {
  const TangentFrame frame(axis);
  y = frame.tangent;
  z = frame.bitangent;
}

}  // namespace surfeit
