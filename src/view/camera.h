// The perspective camera of `surfeit view`: where it stands, and which sample sees what.
//
// Camera space is x right, y up, z forward, in world units, with the eye at the origin. A point
// of camera space is seen along the slopes (x / z, y / z); slopes are linear in the position on
// the screen, which is counted in samples from the top left corner, sample centres at + 0.5.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>

#include "core/bounds.h"
#include "surfeit/status.h"
#include "surfeit/view.h"
#include "view/view_frame.h"

namespace surfeit {

// Immutable. Works in double outside the camera, so that clouds far from the origin stay sharp.
class Camera {
 public:
  // The frame that collects what a camera without an eye must show: its three-quarter view looks
  // from the right and a little above. kInvalidArgument: up along the view, field of view out of
  // range.
  static Result<ViewFrame> createFrame(const CameraOptions& options, int width, int height);

  // A camera that sees `width` x `height` samples, placed by `frame` where the options give no eye.
  // kInvalidArgument: eye on the look-at point, or as createFrame.
  static Result<Camera> create(const CameraOptions& options, const Bounds3d& bounds,
                               const ViewFrame& frame, int width, int height);

  glm::dvec3 eye() const { return eye_; }
  glm::dvec3 lookAt() const { return look_at_; }
  int width() const { return width_; }
  int height() const { return height_; }

  glm::vec3 cameraFromWorld(const glm::dvec3& position) const;
  glm::vec3 cameraFromWorldDirection(const glm::vec3& direction) const;
  glm::vec3 worldFromCameraDirection(const glm::vec3& direction) const;
  glm::dvec3 worldFromCamera(const glm::dvec3& position) const;
  const ViewAxes& axes() const { return axes_; }

  // Depth before which nothing is drawn.
  float nearDepth() const { return near_depth_; }
  // How much the slope changes from one sample to the next, in x and in y.
  float slopeStep() const { return slope_step_; }
  // Slopes of a screen position, and back.
  float slopeX(float screen_x) const { return (screen_x - half_width_) * slope_step_; }
  float slopeY(float screen_y) const { return (half_height_ - screen_y) * slope_step_; }
  float screenX(float slope_x) const { return half_width_ + slope_x / slope_step_; }
  float screenY(float slope_y) const { return half_height_ - slope_y / slope_step_; }

 private:
  glm::dvec3 eye_{0}, look_at_{0};
  ViewAxes axes_;
  int width_ = 0, height_ = 0;
  float half_width_ = 0, half_height_ = 0, slope_step_ = 0, near_depth_ = 0;
};

}  // namespace surfeit
