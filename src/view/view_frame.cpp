#include "view/view_frame.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

namespace surfeit {
namespace {

// Room left around the cloud.
constexpr double kMargin = 1.04;

// How far from the mean is still framed; a uniform box ends at 1.73 deviations.
constexpr double kFramedDeviations = 3;

}  // namespace

ViewFrame::ViewFrame(const ViewAxes& axes, double slope_x, double slope_y) : axes_(axes) {
  for (std::size_t axis = 0; axis < 2; ++axis) {
    for (std::size_t part = 0; part < kParts.size(); ++part) {
      const double slope = kParts[part] * (axis == 0 ? slope_x : slope_y) / kMargin;
      sides_[axis][part].sin_half = std::sin(std::atan(slope));
      sides_[axis][part].cos_half = std::cos(std::atan(slope));
    }
  }
}

void ViewFrame::add(const glm::dvec3& position) {
  const glm::dvec3 p(glm::dot(position, axes_.right), glm::dot(position, axes_.up),
                     glm::dot(position, axes_.forward));
  for (int axis = 0; axis < 2; ++axis) {
    for (Sides& sides : sides_[std::size_t(axis)]) {
      const double across = sides.cos_half * p[axis], along = sides.sin_half * p.z;
      sides.reach[0] = std::max(sides.reach[0], across - along);
      sides.reach[1] = std::max(sides.reach[1], -across - along);
    }
  }
  const glm::dvec3 from_mean = p - mean_;
  mean_ += from_mean / ++count_;
  for (int i = 0; i < 3; ++i) deviation_[std::size_t(i)] += from_mean[i] * (p - mean_);
}

double ViewFrame::framedReach(int axis, const Sides& sides, int side) const {
  // Mean and deviation along the normal follow from those along the axes
  const glm::dvec3 normal = (side == 0 ? 1.0 : -1.0) * sides.cos_half *
                                (axis == 0 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0)) -
                            glm::dvec3(0, 0, sides.sin_half);
  double variance = 0;
  for (int i = 0; i < 3; ++i) {
    variance += normal[i] * glm::dot(normal, deviation_[std::size_t(i)]) / count_;
  }
  const double limit =
      glm::dot(normal, mean_) + kFramedDeviations * std::sqrt(std::max(variance, 0.0));
  return std::min(sides.reach[std::size_t(side)], limit);
}

ViewFrame::Place ViewFrame::placeFor(int axis, const Sides& sides) const {
  // All positions lie inside when across cos - along sin >= reach of the right plane, and
  // -across cos - along sin >= reach of the left one
  const double right = framedReach(axis, sides, 0), left = framedReach(axis, sides, 1);
  return {-(right + left) / (2 * sides.sin_half), (right - left) / (2 * sides.cos_half)};
}

glm::dvec3 ViewFrame::eye() const {
  // The axis that needs more room tells the distance
  const double along = std::min(placeFor(0, sides_[0][0]).along, placeFor(1, sides_[1][0]).along);

  // In each axis, the narrowest frustum that still holds the cloud from there centres it
  glm::dvec3 eye = along * axes_.forward;
  for (int axis = 0; axis < 2; ++axis) {
    double across = 0;
    for (const Sides& sides : sides_[std::size_t(axis)]) {
      const Place place = placeFor(axis, sides);
      if (&sides == &sides_[std::size_t(axis)].front() || place.along >= along) {
        across = place.across;
      }
    }
    eye += across * (axis == 0 ? axes_.right : axes_.up);
  }
  return eye;
}

glm::dvec3 ViewFrame::eyeFor(const glm::dvec3& look_at) const {
  const glm::dvec3 target(glm::dot(look_at, axes_.right), glm::dot(look_at, axes_.up),
                          glm::dot(look_at, axes_.forward));
  double distance = 0;
  for (int axis = 0; axis < 2; ++axis) {
    const Sides& sides = sides_[std::size_t(axis)].front();
    for (int side = 0; side < 2; ++side) {
      const double across = (side == 0 ? 1 : -1) * sides.cos_half * target[axis];
      const double beyond = framedReach(axis, sides, side) - (across - sides.sin_half * target.z);
      distance = std::max(distance, beyond / sides.sin_half);
    }
  }
  return look_at - distance * axes_.forward;
}

}  // namespace surfeit
