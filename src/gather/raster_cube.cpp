#include "gather/raster_cube.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <utility>

#include "core/assert.h"
#include "gather/coverage_rules.h"

namespace surfeit {
namespace {

// Solid angle of the part of a face from its middle to (u, v): atan(u v / sqrt(u^2 + v^2 + 1)).
double cornerSolidAngle(double u, double v) {
  return std::atan2(u * v, std::sqrt(u * u + v * v + 1));
}

// The slopes x / w of the lines through the origin that touch a circle around (x, w), as far as
// they lie in front (w > 0). The circle must reach w > 0.
struct Slopes {
  float min, max;
};
Slopes tangentSlopes(float x, float w, float radius) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  const float length_sq = x * x + w * w - radius * radius;
  if (length_sq <= 0) return {-kInfinity, kInfinity};  // the origin is inside

  // With the circle's middle at angle t from the w axis and half its angular size s, the slopes are
  // tan(t - s) and tan(t + s); sines and cosines below are scaled by the squared distance
  const float length = std::sqrt(length_sq);
  const float cos_min = w * length + x * radius;
  const float cos_max = w * length - x * radius;
  return {cos_min > 0 ? (x * length - w * radius) / cos_min : -kInfinity,
          cos_max > 0 ? (x * length + w * radius) / cos_max : kInfinity};
}

}  // namespace

RasterGeometry::RasterGeometry(int resolution) : resolution_(resolution) {
  SURFEIT_CHECK(isValidResolution(resolution));
  pixels_.reserve(pixelCount(resolution));
  const double step = 2.0 / resolution;
  for (int face = 0; face < kFaces; ++face) {
    const int axis = face / 2;
    for (int row = 0; row < resolution; ++row) {
      for (int column = 0; column < resolution; ++column) {
        const double u = -1 + column * step, v = -1 + row * step;
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

RasterCube::RasterCube(const RasterGeometry& geometry, bool has_color)
    : geometry_(&geometry),
      coverage_(geometry.pixels().size()),
      radiosity_(has_color ? geometry.pixels().size() : 0) {}

void RasterCube::clear() {
  std::fill(coverage_.begin(), coverage_.end(), Coverage{});
  std::fill(radiosity_.begin(), radiosity_.end(), glm::vec3(0));
}

// A layer with less room than `amount` ends at exactly 1, for a + (1 - a) is 1 in floats too, and
// the pixel is exactly 1 then.
inline void RasterCube::coverPixel(std::size_t pixel, float amount, const DepthRange& depth,
                                   const glm::vec3& radiosity) {
  Coverage& coverage = coverage_[pixel];
  if (coverage.total >= 1) return;

  // A gap in depth begins a new layer
  if (depth.begin > coverage.layer_end) {
    coverage.room = 1 - coverage.total;
    coverage.layer = 0;
  }
  coverage.layer_end = std::max(coverage.layer_end, depth.end);

  // Rectangles do not tile: where a surface fills a pixel their sum scatters around 1, and the
  // limit at 1 takes from what is above without giving to what is below. kFill gives it back, and
  // leaves alone what covers little
  coverage.layer += std::min(amount, 1 - coverage.layer);
  const float sum = coverage.layer;
  const float filled = std::min(1.f, sum + kFill * sum * sum * sum);
  const float before = coverage.total;
  coverage.total =
      filled >= 1 ? 1 : std::clamp(1 - coverage.room + filled * coverage.room, before, 1.f);
  if (!radiosity_.empty()) radiosity_[pixel] += (coverage.total - before) * radiosity;
}

// Covers pixels by the part of them that lies in the rectangle.
void RasterCube::coverRectangle(int face, const Rectangle& rectangle, const DepthRange& depth,
                                const glm::vec3& radiosity) {
  // From face coordinates to pixels
  const int resolution = geometry_->resolution();
  const float size = float(resolution), scale = 0.5f * size;
  const float x_begin = std::max(0.f, (rectangle.u_begin + 1) * scale);
  const float x_end = std::min(size, (rectangle.u_end + 1) * scale);
  const float y_begin = std::max(0.f, (rectangle.v_begin + 1) * scale);
  const float y_end = std::min(size, (rectangle.v_end + 1) * scale);
  if (!(x_begin < x_end && y_begin < y_end)) return;

  const int column_last = std::min(resolution - 1, int(x_end));
  const int row_last = std::min(resolution - 1, int(y_end));
  for (int row = int(y_begin); row <= row_last; ++row) {
    const float height = std::min(y_end, float(row + 1)) - std::max(y_begin, float(row));
    const std::size_t row_first = std::size_t((face * resolution + row) * resolution);
    for (int column = int(x_begin); column <= column_last; ++column) {
      const float width = std::min(x_end, float(column + 1)) - std::max(x_begin, float(column));
      coverPixel(row_first + std::size_t(column), width * height, depth, radiosity);
    }
  }
}

void RasterCube::splatRectangle(const glm::vec3& direction, const glm::vec3& normal,
                                float solid_angle, const DepthRange& depth,
                                const glm::vec3& radiosity) {
  // The face of the largest component, and the direction's place on it
  const glm::vec3 magnitude = glm::abs(direction);
  int axis = magnitude.x >= magnitude.y ? 0 : 1;
  if (magnitude.z > magnitude[axis]) axis = 2;
  const int u_axis = (axis + 1) % 3, v_axis = (axis + 2) % 3;
  const float inverse = 1 / magnitude[axis];
  const float u = direction[u_axis] * inverse, v = direction[v_axis] * inverse;

  // Half extents on the face of a unit disk with this normal, times a common factor: the gradient
  // of u is (e_u - u e_axis) / |d[axis]|, and a disk extends along a gradient g by
  // sqrt(g.g - (g.n)^2). The floor keeps a disk seen edge-on from becoming a line.
  const float n_axis = direction[axis] < 0 ? -normal[axis] : normal[axis];
  const float g_u = normal[u_axis] - u * n_axis, g_v = normal[v_axis] - v * n_axis;
  const float extent_u_sq = std::max(kLeastExtentSq, 1 + u * u - g_u * g_u);
  const float extent_v_sq = std::max(kLeastExtentSq, 1 + v * v - g_v * g_v);

  // Area on the face: du dv = solid angle / |d[axis]|^3
  const float half_area = 0.25f * solid_angle * inverse * inverse * inverse;
  const float half_u_sq = half_area * std::sqrt(extent_u_sq / extent_v_sq);
  const float half_u = std::sqrt(half_u_sq), half_v = half_area / half_u;
  const Rectangle on_face = {u - half_u, u + half_u, v - half_v, v + half_v};
  const int face = 2 * axis + (direction[axis] < 0 ? 1 : 0);
  coverRectangle(face, on_face, depth, radiosity);

  // Spill over: the point (u, v) of the face's plane, |v| > 1, is the direction that the face of
  // v's axis has at 1 / |v| along our axis and u / |v| along u's. The overhang becomes a trapezoid
  // there; we cover the rectangle through its middle.
  const float sign = direction[axis] < 0 ? -1.f : 1.f;
  const auto order = [](float a, float b) { return std::pair(std::min(a, b), std::max(a, b)); };
  for (const int side : {0, 1}) {
    const float v_far = side == 0 ? on_face.v_end : -on_face.v_begin;
    if (v_far > 1) {
      const auto [begin, end] = order(sign / v_far, sign);
      const float shrink = 2 / (1 + v_far);
      coverRectangle(2 * v_axis + side,
                     {begin, end, on_face.u_begin * shrink, on_face.u_end * shrink}, depth,
                     radiosity);
    }
    const float u_far = side == 0 ? on_face.u_end : -on_face.u_begin;
    if (u_far > 1) {
      const auto [begin, end] = order(sign / u_far, sign);
      const float shrink = 2 / (1 + u_far);
      coverRectangle(2 * u_axis + side,
                     {on_face.v_begin * shrink, on_face.v_end * shrink, begin, end}, depth,
                     radiosity);
    }
  }
}

// Asks isHit(direction) for the pixels that may see the sphere around `centre`.
template <typename IsHit>
void RasterCube::tracePixels(const glm::vec3& centre, float radius, const DepthRange& depth,
                             const glm::vec3& radiosity, const IsHit& isHit) {
  const int resolution = geometry_->resolution();
  const float size = float(resolution), scale = 0.5f * size;
  const std::span<const RasterGeometry::Pixel> pixels = geometry_->pixels();
  for (int face = 0; face < RasterGeometry::kFaces; ++face) {
    const int axis = face / 2;
    const float w = face % 2 == 0 ? centre[axis] : -centre[axis];
    if (w <= -radius) continue;

    // Pixels between the lines that touch the sphere, with one to spare against rounding
    const Slopes u = tangentSlopes(centre[(axis + 1) % 3], w, radius);
    const Slopes v = tangentSlopes(centre[(axis + 2) % 3], w, radius);
    const int column_begin = int(std::clamp((u.min + 1) * scale - 1, 0.f, size));
    const int column_end = int(std::clamp((u.max + 1) * scale + 2, 0.f, size));
    const int row_begin = int(std::clamp((v.min + 1) * scale - 1, 0.f, size));
    const int row_end = int(std::clamp((v.max + 1) * scale + 2, 0.f, size));

    for (int row = row_begin; row < row_end; ++row) {
      const std::size_t row_first = std::size_t((face * resolution + row) * resolution);
      for (int column = column_begin; column < column_end; ++column) {
        const std::size_t pixel = row_first + std::size_t(column);
        if (isHit(pixels[pixel].direction)) coverPixel(pixel, 1, depth, radiosity);
      }
    }
  }
}

// The ray t d meets the plane of the disk at t = c.n / d.n, and the disk when |t d - c| <= r.
// Multiplied by (d.n)^2, so that nothing is divided.
void RasterCube::traceDisk(const glm::vec3& centre, const glm::vec3& normal, float radius,
                           const DepthRange& depth, const glm::vec3& radiosity) {
  const float c_n = glm::dot(centre, normal);
  const float power = glm::dot(centre, centre) - radius * radius;
  tracePixels(centre, radius, depth, radiosity, [&](const glm::vec3& d) {
    const float d_n = glm::dot(d, normal);
    return c_n * d_n > 0 &&
           c_n * c_n - 2 * c_n * d_n * glm::dot(d, centre) + power * d_n * d_n <= 0;
  });
}

// The ray t d meets the sphere when it points to its side and passes the centre within r.
void RasterCube::traceSphere(const glm::vec3& centre, float radius, const DepthRange& depth,
                             const glm::vec3& radiosity) {
  const float power = glm::dot(centre, centre) - radius * radius;
  tracePixels(centre, radius, depth, radiosity, [&](const glm::vec3& d) {
    const float d_c = glm::dot(d, centre);
    return d_c > 0 && d_c * d_c >= power;
  });
}

}  // namespace surfeit
