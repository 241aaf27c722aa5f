#include "view/cube_layout.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>

namespace surfeit {
namespace {

// A view of the world that stands upright.
struct Upright {
  glm::vec3 up, ahead;

  explicit Upright(UpAxis axis) {
    switch (axis) {
      case UpAxis::kX:
        up = {1, 0, 0}, ahead = {0, 0, 1};
        break;
      case UpAxis::kY:
        up = {0, 1, 0}, ahead = {0, 0, -1};
        break;
      case UpAxis::kZ:
        up = {0, 0, 1}, ahead = {0, 1, 0};
        break;
    }
  }
  // What is towards the top of a picture that looks along `look`.
  glm::vec3 topOf(const glm::vec3& look) const {
    constexpr float kSteep = 0.8f;
    const float rise = glm::dot(look, up);
    if (rise > kSteep) return -ahead;
    return rise < -kSteep ? ahead : up;
  }
};

// The axis of the world nearest to a direction.
glm::vec3 nearestAxis(const glm::vec3& direction) {
  int axis = 0;
  for (int i = 1; i < 3; ++i) {
    if (std::abs(direction[i]) > std::abs(direction[axis])) axis = i;
  }
  glm::vec3 nearest(0);
  nearest[axis] = direction[axis] < 0 ? -1.f : 1.f;
  return nearest;
}

// The one of the four sides of a face that is nearest to a direction.
glm::vec3 nearestSide(const CubeFace& face, const glm::vec3& direction) {
  const glm::vec3 u = glm::normalize(face.u), v = glm::normalize(face.v);
  const std::array<glm::vec3, 4> sides = {u, v, -u, -v};
  return *std::max_element(sides.begin(), sides.end(), [&](const auto& a, const auto& b) {
    return glm::dot(a, direction) < glm::dot(b, direction);
  });
}

}  // namespace

CubeLayout::CubeLayout(const CubeImage& cube, UpAxis up_axis) {
  const Upright upright(up_axis);
  const bool is_cone = cube.faces.size() == 1;
  width_ = (is_cone ? 1 : 4) * cube.resolution;
  height_ = (is_cone ? 1 : 3) * cube.resolution;
  pixels_.assign(std::size_t(width_) * std::size_t(height_), kOutside);
  if (is_cone) {
    const CubeFace& face = cube.faces[0];
    place(cube, 0, 0, face.forward, nearestSide(face, upright.topOf(face.forward)));
    return;
  }

  const bool has_normal = cube.receiver.normal != glm::vec3(0);
  const glm::vec3 look = has_normal ? nearestAxis(cube.receiver.normal) : upright.ahead;
  const glm::vec3 up = upright.topOf(look), right = glm::cross(look, up);
  place(cube, 1, 0, up, -look);
  place(cube, 0, 1, -right, up);
  place(cube, 1, 1, look, up);
  place(cube, 2, 1, right, up);
  place(cube, 3, 1, -look, up);
  place(cube, 1, 2, -up, look);
}

// The face along `look` goes to a square of the picture, turned so that `up` is at its top.
void CubeLayout::place(const CubeImage& cube, int column, int row, const glm::vec3& look,
                       const glm::vec3& up) {
  const auto found = std::max_element(
      cube.faces.begin(), cube.faces.end(), [&](const CubeFace& a, const CubeFace& b) {
        return glm::dot(a.forward, look) < glm::dot(b.forward, look);
      });
  const int face = int(found - cube.faces.begin()), size = cube.resolution;
  const glm::vec3 right = glm::cross(look, up);
  const glm::vec3 u = glm::normalize(found->u), v = glm::normalize(found->v);
  for (int y = 0; y < size; ++y) {
    for (int x = 0; x < size; ++x) {
      // Twice the distance from the middle of the face, in pixels
      const glm::vec3 place = float(2 * x + 1 - size) * right - float(2 * y + 1 - size) * up;
      const int place_u = int(std::lround(glm::dot(place, u)));
      const int place_v = int(std::lround(glm::dot(place, v)));
      const int pixel = (face * size + (place_v + size) / 2) * size + (place_u + size) / 2;
      pixels_[std::size_t((row * size + y) * width_ + column * size + x)] = pixel;
    }
  }
}

}  // namespace surfeit
