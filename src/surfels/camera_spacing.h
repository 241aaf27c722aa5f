// The area that a surfel may have at a place, for cameras (surfeit/camera_density.h; course notes
// 2010, "Point Generation").
#pragma once

#include <cstddef>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <optional>
#include <vector>

#include "surfeit/camera_density.h"
#include "surfeit/status.h"
#include "surfeit/up_axis.h"

namespace surfeit {

// Distance from a place to the pyramid |x| <= slope_x z, |y| <= slope_y z, z >= 0; 0 within.
double distanceToPyramid(const glm::dvec3& place, double slope_x, double slope_y);

// The same to the pyramid of all (x z, y z, z) with z >= 0, least.x <= x <= most.x and least.y <= y
// <= most.y: a window of a picture.
double distanceToWindow(const glm::dvec3& place, const glm::dvec2& least, const glm::dvec2& most);

// With P the pixels, w the solid angle of the middle pixel, W the largest solid angle, d the
// distance to the eye and d' the distance to the view, which is 0 in view, a camera allows
//
//   area = max(P^2 w d^2, W d'^2)
//
// and several cameras the least of theirs. Immutable; safe from any thread.
class CameraSpacing {
 public:
  // Places are counted from `origin`. `near` >= 0: d is at least this. kInvalidArgument, naming the
  // value, for cameras that cannot work.
  static Result<CameraSpacing> create(const CameraDensity& density, UpAxis up,
                                      const glm::dvec3& origin, double near);

  double areaAt(const glm::dvec3& place) const { return leastArea(place, 0); }
  // A lower bound of areaAt for all places of a sphere, for both distances change by no more than
  // the place moves.
  double leastArea(const glm::dvec3& centre, double radius) const;
  // The area at the centre where the sphere is small beside both distances; else leastArea.
  double areaFor(const glm::dvec3& centre, double radius) const;

  std::size_t cameraCount() const { return cameras_.size(); }

 private:
  struct Camera {
    glm::dvec3 eye{0}, right{0}, up{0}, forward{0};
    double slope_x = 0, slope_y = 0;
    double pixel_area = 0;  // P^2 w
    // Slopes of the window that is in view; absent: all is
    struct Window {
      glm::dvec2 least{0}, most{0};
    };
    std::optional<Window> window;
  };
  struct Distances {
    double eye = 0, view = 0;
  };

  static Distances distances(const Camera& camera, const glm::dvec3& place);
  double area(const Camera& camera, const Distances& distances) const;

  std::vector<Camera> cameras_;
  double max_solid_angle_ = 0, near_ = 0;
};

}  // namespace surfeit
