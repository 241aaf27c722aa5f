// What an automatic camera must show: found while the cloud streams by once, before the eye is
// known. The direction of the view is fixed, and so are the four side planes of its frustum up to
// their offsets; the cloud's reach beyond each plane tells how far back the eye must stand, and
// where, for the cloud to fill the picture.
#pragma once

#include <array>
#include <cstddef>
#include <glm/vec3.hpp>
#include <limits>

namespace surfeit {

// Unit axes of a view in the world.
struct ViewAxes {
  glm::dvec3 right{1, 0, 0}, up{0, 1, 0}, forward{0, 0, -1};
};

// One thread at a time. The eye depends on the order of the positions by rounding only.
class ViewFrame {
 public:
  // Slopes of the picture's right and upper edge.
  ViewFrame(const ViewAxes& axes, double slope_x, double slope_y);

  const ViewAxes& axes() const { return axes_; }

  void add(const glm::dvec3& position);

  // The eye from which the positions just fill the picture. Strays beyond three standard
  // deviations of the positions may be cut off.
  glm::dvec3 eye() const;
  // The same for an eye that must look straight at `look_at`.
  glm::dvec3 eyeFor(const glm::dvec3& look_at) const;

 private:
  // Frusta of these parts of the picture's width and height are tried for centring.
  static constexpr std::array<double, 6> kParts = {1, 0.8, 0.6, 0.45, 0.35, 0.25};

  // The two opposite side planes of a frustum, across one axis of the picture.
  struct Sides {
    double sin_half = 0, cos_half = 0;  // of the angle between plane and view
    // Along the outward normals, the right or upper plane first
    std::array<double, 2> reach = {-std::numeric_limits<double>::infinity(),
                                   -std::numeric_limits<double>::infinity()};
  };
  // Where the eye stands along the view and across it for both planes to touch the cloud.
  struct Place {
    double along = 0, across = 0;
  };

  double framedReach(int axis, const Sides& sides, int side) const;
  Place placeFor(int axis, const Sides& sides) const;

  ViewAxes axes_;
  std::array<std::array<Sides, kParts.size()>, 2> sides_;  // axis: 0 right, 1 up; index of kParts
  // Positions along the axes (right, up, forward): mean, and co-deviations summed up after Welford
  double count_ = 0;
  glm::dvec3 mean_{0};
  std::array<glm::dvec3, 3> deviation_{glm::dvec3(0), glm::dvec3(0), glm::dvec3(0)};
};

}  // namespace surfeit
