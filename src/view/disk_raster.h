// Surfels on the screen: exact perspective disks and spheres, sample by sample.
//
// A disk with centre c, normal n and radius r in camera space is met by the ray of slopes (u, v)
// at depth t = (n . c) / (n . d), d = (u, v, 1), and covers the sample when |t d - c| <= r. Its
// exact bounds come from its dual conic C* = r^2 (I - n n^T) - c c^T: lines of slope u = const
// that touch it satisfy C*_00 - 2 u C*_02 + u^2 C*_22 = 0. A sphere is the same with n = 0.
//
// A disk circumscribes its piece of the surface, and reaches beyond the edges of things. Its core,
// as large as the piece, hardly does: the framebuffer decides where a rim is seen.
//
// So that disks smaller than a sample do not fall between samples, a disk also covers samples
// within half a sample's diagonal of its centre (Botsch et al. 2005, "High-Quality Surface
// Splatting on Today's GPUs", screen-space filter).
#pragma once

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <optional>

#include "view/camera.h"
#include "view/cloud_record.h"

namespace surfeit {

// Samples [x_begin, x_end) x [y_begin, y_end).
struct ScreenBox {
  int x_begin = 0, x_end = 0, y_begin = 0, y_end = 0;
};

// A surfel ready to be drawn, in camera space.
struct ScreenSurfel {
  enum class Shape : std::uint8_t { kDisk, kSphere, kSquare };

  glm::vec3 centre;
  glm::vec3 normal;  // towards or away from the eye, as the surfel has it; zero for spheres
  glm::vec3 value;   // what it shows
  float radius;
  float core_rho;            // within which a fragment is of the core, see Fragment::rho
  float screen_x, screen_y;  // of the centre
  float thickness;           // depth within which it belongs to one surface with its neighbours
  bool is_back;              // seen from behind
  Shape shape;
  ScreenBox box;
};

// Places a record on the screen as a disk, or as a sphere when it has no normal; nothing when no
// sample sees it.
std::optional<ScreenSurfel> projectDisk(const CloudRecord& record, const Camera& camera);

// The same as a square of `size` samples at the centre's depth, whatever the radius.
std::optional<ScreenSurfel> projectSquare(const CloudRecord& record, const Camera& camera,
                                          float size);

// What a sample sees of a surfel.
struct Fragment {
  int x = 0;
  float depth = 0;
  float rho = 0;  // squared distance from the centre over squared radius, 0..1
  bool is_core = true;
  glm::vec3 slope{0, 0, 1};
};

// Calls visit(Fragment) for the samples of screen row `y` that see the surfel.
template <typename Visit>
void visitFragments(const ScreenSurfel& surfel, const Camera& camera, int y, Visit&& visit) {
  constexpr float kFilterRadiusSq = 0.5f;  // samples^2: half a diagonal
  const glm::vec3& c = surfel.centre;
  const glm::vec3& n = surfel.normal;
  const float inverse_radius_sq = 1 / (surfel.radius * surfel.radius);
  const float plane = glm::dot(n, c);
  const float offset_y = float(y) + 0.5f - surfel.screen_y;
  Fragment fragment;
  fragment.slope.y = camera.slopeY(float(y) + 0.5f);

  for (int x = surfel.box.x_begin; x < surfel.box.x_end; ++x) {
    fragment.x = x;
    fragment.slope.x = camera.slopeX(float(x) + 0.5f);
    const glm::vec3& d = fragment.slope;
    if (surfel.shape == ScreenSurfel::Shape::kSquare) {
      fragment.depth = c.z;
      visit(fragment);
      continue;
    }

    // Squared distance from the centre, and depth, on the disk's plane or the sphere's front
    float depth, distance_sq;
    if (surfel.shape == ScreenSurfel::Shape::kDisk) {
      depth = plane / glm::dot(n, d);
      const glm::vec3 q = depth * d - c;
      distance_sq = glm::dot(q, q);
    } else {
      const float d_sq = glm::dot(d, d);
      const float middle = glm::dot(c, d) / d_sq;
      const glm::vec3 q = middle * d - c;
      distance_sq = glm::dot(q, q);
      depth = middle - std::sqrt(std::max(surfel.radius * surfel.radius - distance_sq, 0.f) / d_sq);
    }
    fragment.rho = distance_sq * inverse_radius_sq;
    fragment.is_core = fragment.rho <= surfel.core_rho;

    // An edge-on plane gives no number at all: every test is written to fail then
    if (!(fragment.rho <= 1 && depth > camera.nearDepth())) {
      const float offset_x = float(x) + 0.5f - surfel.screen_x;
      fragment.rho = (offset_x * offset_x + offset_y * offset_y) / kFilterRadiusSq;
      fragment.is_core = true;
      depth = c.z;
      if (!(fragment.rho <= 1 && depth > camera.nearDepth())) continue;
    }
    fragment.depth = depth;
    visit(fragment);
  }
}

}  // namespace surfeit
