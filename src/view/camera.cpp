#include "view/camera.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

namespace surfeit {
namespace {

// The default view stands this far to the right of the front and above the ground.
constexpr double kAzimuth = 35 * std::numbers::pi / 180;
constexpr double kElevation = 22 * std::numbers::pi / 180;

// Near plane as a part of the distances in the scene.
constexpr double kNearFraction = 1e-5;

// What is right, up and in front of the scene for a viewer before it; right x up = front. The
// front is where a viewer of such scenes stands: -y when z is up, +z when y is up.
struct WorldFrame {
  glm::dvec3 right, up, front;
};

WorldFrame worldFrame(UpAxis up_axis) {
  switch (up_axis) {
    case UpAxis::kX:
      return {{0, -1, 0}, {1, 0, 0}, {0, 0, 1}};
    case UpAxis::kZ:
      return {{1, 0, 0}, {0, 0, 1}, {0, -1, 0}};
    case UpAxis::kY:
      break;
  }
  return {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
}

bool isFinite(const glm::dvec3& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

glm::dvec3 worldUp(const CameraOptions& options) {
  return options.up.value_or(worldFrame(options.up_axis).up);
}

Result<double> halfSlope(const CameraOptions& options) {
  if (!(options.fov_degrees >= 1 && options.fov_degrees <= 170)) {
    return Status::invalidArgument("the field of view must lie between 1 and 170 degrees");
  }
  return std::tan(0.5 * options.fov_degrees * std::numbers::pi / 180);
}

// Axes of a view along `forward`, which is a unit vector.
Result<ViewAxes> axesAlong(const glm::dvec3& forward, const glm::dvec3& world_up) {
  const glm::dvec3 across = glm::cross(forward, world_up);
  if (!isFinite(world_up) || !(glm::length(across) > 1e-6 * glm::length(world_up))) {
    return Status::invalidArgument("the up direction is zero or lies along the view");
  }
  const glm::dvec3 right = glm::normalize(across);
  return ViewAxes{right, glm::cross(right, forward), forward};
}

}  // namespace

Result<ViewFrame> Camera::createFrame(const CameraOptions& options, int width, int height) {
  const WorldFrame world = worldFrame(options.up_axis);
  const glm::dvec3 back =
      std::cos(kElevation) * (std::sin(kAzimuth) * world.right + std::cos(kAzimuth) * world.front) +
      std::sin(kElevation) * world.up;
  SURFEIT_ASSIGN_OR_RETURN(const double slope, halfSlope(options));
  // An up along this view matters only where no eye is given, and create() asks again there
  Result<ViewAxes> axes = axesAlong(-back, worldUp(options));
  if (!axes.ok() && options.eye) axes = axesAlong(-back, world.up);
  if (!axes.ok()) return axes.status();
  return ViewFrame(*axes, slope * width / height, slope);
}

Result<Camera> Camera::create(const CameraOptions& options, const Bounds3d& bounds,
                              const ViewFrame& frame, int width, int height) {
  SURFEIT_ASSIGN_OR_RETURN(const double slope, halfSlope(options));
  const glm::dvec3 centre = bounds.centre();
  // A single place has a size all the same, one that doubles can still resolve there
  const double diagonal =
      std::max({glm::length(bounds.extent()), 1e-6 * glm::length(centre), 1e-12});
  Camera camera;
  camera.width_ = width;
  camera.height_ = height;
  camera.half_width_ = 0.5f * float(width);
  camera.half_height_ = 0.5f * float(height);
  camera.slope_step_ = float(2 * slope / height);

  if (options.eye) {
    camera.eye_ = *options.eye;
    camera.look_at_ = options.look_at.value_or(centre);
    const glm::dvec3 view = camera.look_at_ - camera.eye_;
    if (!isFinite(view)) return Status::invalidArgument("eye and look-at must be finite");
    if (!(glm::length(view) > 1e-9 * diagonal)) {
      return Status::invalidArgument("the eye stands on the look-at point");
    }
    SURFEIT_ASSIGN_OR_RETURN(camera.axes_, axesAlong(glm::normalize(view), worldUp(options)));
  } else {
    // A cloud without extent needs some distance all the same
    camera.axes_ = frame.axes();
    camera.eye_ = options.look_at ? frame.eyeFor(*options.look_at) : frame.eye();
    camera.eye_ -= 1e-3 * diagonal * camera.axes_.forward;
    const double depth = glm::dot(centre - camera.eye_, camera.axes_.forward);
    camera.look_at_ = options.look_at.value_or(camera.eye_ + depth * camera.axes_.forward);
    if (!isFinite(camera.eye_)) return Status::invalidArgument("look-at must be finite");
  }
  camera.near_depth_ = float(kNearFraction * std::max(diagonal, glm::length(camera.eye_ - centre)));
  return camera;
}

glm::vec3 Camera::cameraFromWorld(const glm::dvec3& position) const {
  const glm::dvec3 p = position - eye_;
  return {float(glm::dot(p, axes_.right)), float(glm::dot(p, axes_.up)),
          float(glm::dot(p, axes_.forward))};
}

glm::vec3 Camera::cameraFromWorldDirection(const glm::vec3& direction) const {
  const glm::dvec3 d(direction);
  return {float(glm::dot(d, axes_.right)), float(glm::dot(d, axes_.up)),
          float(glm::dot(d, axes_.forward))};
}

glm::vec3 Camera::worldFromCameraDirection(const glm::vec3& d) const {
  return glm::vec3(double(d.x) * axes_.right + double(d.y) * axes_.up +
                   double(d.z) * axes_.forward);
}

glm::dvec3 Camera::worldFromCamera(const glm::dvec3& p) const {
  return eye_ + p.x * axes_.right + p.y * axes_.up + p.z * axes_.forward;
}

}  // namespace surfeit
