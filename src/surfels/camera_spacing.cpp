#include "surfels/camera_spacing.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <numbers>

namespace surfeit {
namespace {

bool isFinite(const glm::dvec3& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

Status checkValue(const char* name, double value, double least, double most) {
  if (value >= least && value <= most) return {};
  return Status::invalidArgument(
      fmt::format("{}: found {}, expected {} to {}", name, value, least, most));
}

Status checkDensity(const CameraDensity& density) {
  SURFEIT_RETURN_IF_ERROR(checkValue("pixels", density.pixels, 0.01, 1e4));
  SURFEIT_RETURN_IF_ERROR(checkValue("max solid angle", density.max_solid_angle, 1e-9, 1));
  SURFEIT_RETURN_IF_ERROR(checkValue("width", density.width, 1, 1 << 20));
  SURFEIT_RETURN_IF_ERROR(checkValue("height", density.height, 1, 1 << 20));
  if (density.crop) {
    const PixelWindow& crop = *density.crop;
    if (crop.isEmpty() || crop.x0 < 0 || crop.y0 < 0 || crop.x1 > density.width ||
        crop.y1 > density.height) {
      return Status::invalidArgument(fmt::format(
          "crop {},{},{},{}: expected columns x0 < x1 and rows y0 < y1 of a picture of {}x{}",
          crop.x0, crop.y0, crop.x1, crop.y1, density.width, density.height));
    }
  }
  return checkValue("stereo", density.stereo, 0, 1e30);
}

glm::dvec3 axisOf(UpAxis up) {
  glm::dvec3 axis(0);
  axis[int(up)] = 1;
  return axis;
}

}  // namespace

double distanceToPyramid(const glm::dvec3& place, double slope_x, double slope_y) {
  // The pyramid looks the same from all four quadrants
  const glm::dvec3 p(std::abs(place.x), std::abs(place.y), place.z);
  const double beyond_x = p.x - slope_x * p.z, beyond_y = p.y - slope_y * p.z;
  if (p.z >= 0 && beyond_x <= 0 && beyond_y <= 0) return 0;

  // A side, where the foot of the perpendicular lies on it
  const double square_x = 1 + slope_x * slope_x, square_y = 1 + slope_y * slope_y;
  const double z_of_x = p.z + slope_x * beyond_x / square_x;
  if (beyond_x > 0 && z_of_x >= 0 && p.y <= slope_y * z_of_x) return beyond_x / std::sqrt(square_x);
  const double z_of_y = p.z + slope_y * beyond_y / square_y;
  if (beyond_y > 0 && z_of_y >= 0 && p.x <= slope_x * z_of_y) return beyond_y / std::sqrt(square_y);

  // Else the edge between the two, or the eye where it begins
  const glm::dvec3 edge = glm::normalize(glm::dvec3(slope_x, slope_y, 1));
  return glm::distance(p, std::max(0.0, glm::dot(p, edge)) * edge);
}

double distanceToWindow(const glm::dvec3& place, const glm::dvec2& least, const glm::dvec2& most) {
  double nearest = std::numeric_limits<double>::infinity();
  bool is_inside = place.z >= 0;
  // The sides, where the foot of the perpendicular lies on them
  for (int axis = 0; axis < 2; ++axis) {
    const int other = 1 - axis;
    for (const double sign : {-1.0, 1.0}) {
      const double slope = sign < 0 ? least[axis] : most[axis];
      const double beyond = sign * (place[axis] - slope * place.z) / std::sqrt(1 + slope * slope);
      if (!(beyond > 0)) continue;
      is_inside = false;
      glm::dvec3 normal(0, 0, -sign * slope);
      normal[axis] = sign;
      const glm::dvec3 foot = place - beyond * glm::normalize(normal);
      if (foot.z >= 0 && foot[other] >= least[other] * foot.z &&
          foot[other] <= most[other] * foot.z) {
        nearest = std::min(nearest, beyond);
      }
    }
  }
  if (is_inside) return 0;

  // The edges, or the eye where they begin
  for (const double x : {least.x, most.x}) {
    for (const double y : {least.y, most.y}) {
      const glm::dvec3 edge = glm::normalize(glm::dvec3(x, y, 1));
      const double along = std::max(0.0, glm::dot(place, edge));
      nearest = std::min(nearest, glm::distance(place, along * edge));
    }
  }
  return nearest;
}

Result<CameraSpacing> CameraSpacing::create(const CameraDensity& density, UpAxis up,
                                            const glm::dvec3& origin, double near) {
  SURFEIT_RETURN_IF_ERROR(checkDensity(density));
  CameraSpacing spacing;
  spacing.max_solid_angle_ = density.max_solid_angle;
  spacing.near_ = near;
  for (std::size_t i = 0; i < density.cameras.size(); ++i) {
    const DensityCamera& given = density.cameras[i];
    const auto invalid = [&](const char* what) {
      return Status::invalidArgument(fmt::format("camera {}: {}", i + 1, what));
    };
    if (!(given.fov_degrees >= 1 && given.fov_degrees <= 170)) {
      return invalid("the field of view must lie between 1 and 170 degrees");
    }
    const glm::dvec3 view = given.look_at - given.eye;
    if (!isFinite(given.eye) || !isFinite(view)) return invalid("eye and look-at must be finite");
    if (!(glm::length(view) > 0)) return invalid("the eye stands on the look-at point");
    const glm::dvec3 world_up = given.up.value_or(axisOf(up));
    const glm::dvec3 across = glm::cross(glm::normalize(view), world_up);
    if (!isFinite(world_up) || !(glm::length(across) > 1e-6 * glm::length(world_up))) {
      return invalid("the up direction is zero or lies along the view");
    }

    Camera camera;
    camera.forward = glm::normalize(view);
    camera.right = glm::normalize(across);
    camera.up = glm::cross(camera.right, camera.forward);
    camera.slope_y = std::tan(0.5 * given.fov_degrees * std::numbers::pi / 180);
    camera.slope_x = camera.slope_y * density.width / density.height;
    if (density.crop) {
      const PixelWindow& crop = *density.crop;
      const auto slope = [](double edge, double pixel, double pixels) {
        return edge * (2 * pixel / pixels - 1);
      };
      camera.window = {{slope(camera.slope_x, crop.x0, density.width),
                        -slope(camera.slope_y, crop.y1, density.height)},
                       {slope(camera.slope_x, crop.x1, density.width),
                        -slope(camera.slope_y, crop.y0, density.height)}};
    }
    const double pixel_edge = density.pixels * 2 * camera.slope_y / density.height;
    camera.pixel_area = pixel_edge * pixel_edge;
    for (const double side : {-0.5, 0.5}) {
      camera.eye = given.eye - origin + side * density.stereo * camera.right;
      spacing.cameras_.push_back(camera);
      if (density.stereo == 0) break;
    }
  }
  if (spacing.cameras_.empty()) return Status::invalidArgument("no camera");
  return spacing;
}

CameraSpacing::Distances CameraSpacing::distances(const Camera& camera, const glm::dvec3& place) {
  const glm::dvec3 from_eye = place - camera.eye;
  const glm::dvec3 p(glm::dot(from_eye, camera.right), glm::dot(from_eye, camera.up),
                     glm::dot(from_eye, camera.forward));
  const double view = camera.window ? distanceToWindow(p, camera.window->least, camera.window->most)
                                    : distanceToPyramid(p, camera.slope_x, camera.slope_y);
  return {glm::length(from_eye), view};
}

double CameraSpacing::area(const Camera& camera, const Distances& distances) const {
  const double eye = std::max(distances.eye, near_), view = std::max(distances.view, 0.0);
  return std::max(camera.pixel_area * eye * eye, max_solid_angle_ * view * view);
}

double CameraSpacing::leastArea(const glm::dvec3& centre, double radius) const {
  double least = std::numeric_limits<double>::infinity();
  for (const Camera& camera : cameras_) {
    Distances at = distances(camera, centre);
    at.eye = std::max(0.0, at.eye - radius);
    at.view -= radius;
    least = std::min(least, area(camera, at));
  }
  return least;
}

double CameraSpacing::areaFor(const glm::dvec3& centre, double radius) const {
  double least = std::numeric_limits<double>::infinity();
  for (const Camera& camera : cameras_) {
    Distances at = distances(camera, centre);
    const bool is_small = 2 * radius <= at.eye && (at.view == 0 || 2 * radius <= at.view);
    if (!is_small) {
      at.eye = std::max(0.0, at.eye - radius);
      at.view -= radius;
    }
    least = std::min(least, area(camera, at));
  }
  return least;
}

}  // namespace surfeit
