#include "view/camera.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>

namespace surfeit {
namespace {

constexpr int kWidth = 200, kHeight = 100;

Bounds3d box(const glm::vec3& min, const glm::vec3& max) {
  Bounds3d bounds;
  bounds.add(min);
  bounds.add(max);
  return bounds;
}

Result<Camera> makeCamera(const CameraOptions& options, const Bounds3d& bounds) {
  SURFEIT_ASSIGN_OR_RETURN(ViewFrame frame, Camera::createFrame(options, kWidth, kHeight));
  for (int corner = 0; corner < 8; ++corner) {
    frame.add({(corner & 1) ? bounds.max.x : bounds.min.x,
               (corner & 2) ? bounds.max.y : bounds.min.y,
               (corner & 4) ? bounds.max.z : bounds.min.z});
  }
  return Camera::create(options, bounds, frame, kWidth, kHeight);
}

TEST(Camera, LookAtPointIsInTheMiddleAndUpIsUp) {
  CameraOptions options;
  options.eye = glm::dvec3(3, 4, 5);
  options.look_at = glm::dvec3(1, -1, 0);
  const Result<Camera> camera = makeCamera(options, box(glm::vec3(-1), glm::vec3(1)));
  ASSERT_TRUE(camera.ok()) << camera.status().message();
  const glm::vec3 middle = camera->cameraFromWorld({1, -1, 0});
  EXPECT_NEAR(camera->screenX(middle.x / middle.z), kWidth / 2, 1e-4);
  EXPECT_NEAR(camera->screenY(middle.y / middle.z), kHeight / 2, 1e-4);
  EXPECT_NEAR(middle.z, glm::length(glm::vec3(2, 5, 5)), 1e-5);
  const glm::vec3 above = camera->cameraFromWorld({1, 0, 0});
  EXPECT_NEAR(above.x, 0, 1e-6);
  EXPECT_LT(camera->screenY(above.y / above.z), kHeight / 2);
}

TEST(Camera, FieldOfViewSpansTheHeight) {
  CameraOptions options;
  options.eye = glm::dvec3(0, 0, 10);
  options.look_at = glm::dvec3(0);
  options.fov_degrees = 90;
  const Result<Camera> camera = makeCamera(options, box(glm::vec3(-1), glm::vec3(1)));
  ASSERT_TRUE(camera.ok());
  const glm::vec3 top = camera->cameraFromWorld({0, 10, 0});
  EXPECT_NEAR(camera->screenY(top.y / top.z), 0, 1e-3);
  const glm::vec3 right = camera->cameraFromWorld({20, 0, 0});  // twice as wide as high
  EXPECT_NEAR(camera->screenX(right.x / right.z), kWidth, 1e-3);
}

TEST(Camera, SlopesAndScreenPositionsAreInverse) {
  const Result<Camera> camera = makeCamera({}, box(glm::vec3(-1), glm::vec3(1)));
  ASSERT_TRUE(camera.ok());
  EXPECT_NEAR(camera->screenX(camera->slopeX(17.5f)), 17.5f, 1e-4);
  EXPECT_NEAR(camera->screenY(camera->slopeY(80.5f)), 80.5f, 1e-4);
}

TEST(Camera, DefaultViewShowsTheWholeBoundsAndFillsThePicture) {
  for (const UpAxis up : {UpAxis::kX, UpAxis::kY, UpAxis::kZ}) {
    CameraOptions options;
    options.up_axis = up;
    const Bounds3d bounds = box({100, 200, 300}, {130, 210, 340});
    const Result<Camera> camera = makeCamera(options, bounds);
    ASSERT_TRUE(camera.ok()) << camera.status().message();
    float left = 1e9f, right = -1e9f, top = 1e9f, bottom = -1e9f;
    for (int corner = 0; corner < 8; ++corner) {
      const glm::vec3 p = camera->cameraFromWorld(
          {(corner & 1) ? 130 : 100, (corner & 2) ? 210 : 200, (corner & 4) ? 340 : 300});
      ASSERT_GT(p.z, camera->nearDepth());
      left = std::min(left, camera->screenX(p.x / p.z));
      right = std::max(right, camera->screenX(p.x / p.z));
      top = std::min(top, camera->screenY(p.y / p.z));
      bottom = std::max(bottom, camera->screenY(p.y / p.z));
    }
    EXPECT_GE(left, 0);
    EXPECT_LE(right, kWidth);
    EXPECT_GE(top, 0);
    EXPECT_LE(bottom, kHeight);
    EXPECT_GT(std::max((right - left) / kWidth, (bottom - top) / kHeight), 0.9f);
  }
}

TEST(Camera, StraysDoNotShrinkTheView) {
  CameraOptions options;
  Result<ViewFrame> frame = Camera::createFrame(options, kWidth, kHeight);
  ASSERT_TRUE(frame.ok());
  for (int i = 0; i < 10000; ++i) frame->add(glm::dvec3(i % 10, i / 10 % 10, i / 100 % 10));
  frame->add(glm::dvec3(500, 0, 0));
  EXPECT_LT(glm::length(frame->eye()), 150);
}

TEST(Camera, RefusesViewsThatHaveNoDirection) {
  const Bounds3d bounds = box(glm::vec3(-1), glm::vec3(1));
  CameraOptions on_target;
  on_target.eye = on_target.look_at = glm::dvec3(1, 2, 3);
  EXPECT_EQ(makeCamera(on_target, bounds).status().code(), StatusCode::kInvalidArgument);
  CameraOptions along_up;
  along_up.eye = glm::dvec3(0, 5, 0);
  along_up.look_at = glm::dvec3(0);
  EXPECT_EQ(makeCamera(along_up, bounds).status().code(), StatusCode::kInvalidArgument);
  along_up.up_axis = UpAxis::kZ;
  EXPECT_TRUE(makeCamera(along_up, bounds).ok());
  CameraOptions wide;
  wide.fov_degrees = 180;
  EXPECT_EQ(makeCamera(wide, bounds).status().code(), StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace surfeit
