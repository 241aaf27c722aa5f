#include "sample/ray_scene.h"

#include <embree3/rtcore.h>
#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <utility>

#include "core/resident_limit.h"
#include "core/split_mix.h"

namespace surfeit {
namespace {

// Of a triangle, while the hierarchy is built.
constexpr std::uint64_t kHierarchyBytes = 75;

// Embree hands its number to the filter: the color.
RTCRay makeRay(const glm::vec3& origin, const glm::vec3& direction, float begin, float end,
               std::uint32_t color) {
  RTCRay ray;
  ray.org_x = origin.x, ray.org_y = origin.y, ray.org_z = origin.z;
  ray.dir_x = direction.x, ray.dir_y = direction.y, ray.dir_z = direction.z;
  ray.tnear = begin, ray.tfar = end;
  ray.time = 0, ray.mask = ~0u, ray.id = color, ray.flags = 0;
  return ray;
}

// From 0 to 1, well mixed, by triangle and place.
float placeNumber(std::uint32_t triangle, float u, float v) {
  std::uint64_t bits = triangle;
  bits = splitMix(bits << 32 | std::bit_cast<std::uint32_t>(u));
  bits = splitMix(bits ^ std::bit_cast<std::uint32_t>(v));
  return float(bits >> 40) * 0x1p-24f;
}

float opacityFor(std::uint32_t color, const glm::vec3& opacity) {
  if (color < RayScene::kNoColor) return opacity[int(color)];
  return opacity == glm::vec3(opacity.r) ? opacity.r : (opacity.r + opacity.g + opacity.b) / 3;
}

// Lets rays through where the surface is not there; Embree calls it at each hit.
void passThroughMasks(const RTCFilterFunctionNArguments* arguments) {
  const Mesh& mesh = *static_cast<const Mesh*>(arguments->geometryUserPtr);
  for (unsigned i = 0; i < arguments->N; ++i) {
    if (arguments->valid[i] == 0) continue;
    const std::uint32_t triangle = RTCHitN_primID(arguments->hit, arguments->N, i);
    const float u = RTCHitN_u(arguments->hit, arguments->N, i);
    const float v = RTCHitN_v(arguments->hit, arguments->N, i);
    const float opacity =
        opacityFor(RTCRayN_id(arguments->ray, arguments->N, i), opacityAt(mesh, triangle, u, v));
    if (placeNumber(triangle, u, v) >= opacity) arguments->valid[i] = 0;
  }
}

}  // namespace

struct RayScene::Handles {
  RTCDevice device = nullptr;
  RTCScene scene = nullptr;

  ~Handles() {
    if (scene != nullptr) rtcReleaseScene(scene);
    if (device != nullptr) rtcReleaseDevice(device);
  }
};

RayScene::RayScene(std::unique_ptr<Handles> handles) : handles_(std::move(handles)) {}
RayScene::RayScene(RayScene&&) noexcept = default;
RayScene& RayScene::operator=(RayScene&&) noexcept = default;
RayScene::~RayScene() = default;

Result<RayScene> RayScene::build(const Mesh& mesh, int threads) {
  SURFEIT_RETURN_IF_ERROR(checkResidentBytes(fmt::format("{} triangles", mesh.triangle.size()),
                                             kHierarchyBytes * mesh.triangle.size()));
  auto handles = std::make_unique<Handles>();
  handles->device = rtcNewDevice(fmt::format("threads={}", std::max(threads, 1)).c_str());
  if (handles->device == nullptr) {
    return Status::failed(
        fmt::format("Embree: no device: error {}", int(rtcGetDeviceError(nullptr))));
  }
  RTCDevice device = handles->device;
  handles->scene = rtcNewScene(device);

  // Robust: a hit then depends on the triangle alone, not on the shape of the hierarchy, so that
  // the same scene gives the same shadows for any number of build threads
  rtcSetSceneFlags(handles->scene, RTC_SCENE_FLAG_ROBUST | RTC_SCENE_FLAG_COMPACT);
  RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                             mesh.position.data(), 0, sizeof(glm::vec3), mesh.position.size());
  rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                             mesh.triangle.data(), 0, sizeof(glm::uvec3), mesh.triangle.size());
  if (!mesh.isOpaque()) {
    rtcSetGeometryUserData(geometry, const_cast<Mesh*>(&mesh));  // read only, above
    rtcSetGeometryIntersectFilterFunction(geometry, passThroughMasks);
    rtcSetGeometryOccludedFilterFunction(geometry, passThroughMasks);
  }
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(handles->scene, geometry);
  rtcReleaseGeometry(geometry);
  rtcCommitScene(handles->scene);
  if (const RTCError error = rtcGetDeviceError(device); error != RTC_ERROR_NONE) {
    return Status::failed(fmt::format("Embree: {} triangles: error {}{}", mesh.triangle.size(),
                                      int(error),
                                      error == RTC_ERROR_OUT_OF_MEMORY ? " (out of memory)" : ""));
  }

  RayScene scene(std::move(handles));
  scene.bounds_ = mesh.bounds();
  scene.has_tints_ = mesh.hasTints();
  const glm::vec3 reach = glm::max(glm::abs(scene.bounds_.min), glm::abs(scene.bounds_.max));
  scene.surface_offset_ = std::max(1e-5f * glm::length(scene.bounds_.extent()),
                                   4e-7f * std::max({reach.x, reach.y, reach.z}));
  return scene;
}

bool RayScene::isOccluded(const glm::vec3& origin, const glm::vec3& direction, float begin,
                          float end, std::uint32_t color) const {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  RTCRay ray = makeRay(origin, direction, begin, end, color);
  rtcOccluded1(handles_->scene, &context, &ray);
  return ray.tfar < 0;  // Embree marks occluded rays with -inf
}

glm::vec3 RayScene::passedLight(const glm::vec3& origin, const glm::vec3& direction, float begin,
                                float end) const {
  if (!has_tints_) return glm::vec3(isOccluded(origin, direction, begin, end) ? 0.f : 1.f);
  glm::vec3 passed(1);
  for (std::uint32_t color = 0; color < 3; ++color) {
    if (isOccluded(origin, direction, begin, end, color)) passed[int(color)] = 0;
  }
  return passed;
}

std::optional<RayHit> RayScene::closestHit(const glm::vec3& origin, const glm::vec3& direction,
                                           float begin, float end, std::uint32_t color) const {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  RTCRayHit query;
  query.ray = makeRay(origin, direction, begin, end, color);
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  rtcIntersect1(handles_->scene, &context, &query);
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return std::nullopt;
  return RayHit{query.ray.tfar, query.hit.primID, query.hit.u, query.hit.v};
}

}  // namespace surfeit
