#include "bench/internal/embree_scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <utility>

#include "core/seconds_since.h"
#include "core/square_strata.h"

namespace surfeit {
namespace {

// Keeps hits whose geometric normal faces the origin of their ray. Lanes that are not valid may
// hold anything. Fields of RTCRayN: org_x org_y org_z tnear dir_x dir_y dir_z ...; of RTCHitN: Ng_x
// Ng_y Ng_z ...; each of them `lanes` floats.
[[gnu::always_inline]] inline void rejectBacks(const RTCFilterFunctionNArguments& hits,
                                               unsigned lanes) {
  constexpr unsigned kDirection = 4;
  const auto* const direction = reinterpret_cast<const float*>(hits.ray) + kDirection * lanes;
  const auto* const normal = reinterpret_cast<const float*>(hits.hit);
  for (unsigned i = 0; i < lanes; ++i) {
    const float facing = direction[i] * normal[i] + direction[lanes + i] * normal[lanes + i] +
                         direction[2 * lanes + i] * normal[2 * lanes + i];
    hits.valid[i] = facing < 0 ? hits.valid[i] : 0;
  }
}

// In the widest vectors of the machine, so that the filter costs the ray tracer as little as can be
SURFEIT_BENCH_CLONES void rejectBacksOf16(const RTCFilterFunctionNArguments& hits) {
  rejectBacks(hits, 16);
}

SURFEIT_BENCH_CLONES void rejectBacksOf8(const RTCFilterFunctionNArguments& hits) {
  rejectBacks(hits, 8);
}

void rejectBackHits(const RTCFilterFunctionNArguments* hits) {
  if (hits->N == 16) {
    rejectBacksOf16(*hits);
  } else if (hits->N == 8) {
    rejectBacksOf8(*hits);
  } else {
    rejectBacks(*hits, hits->N);
  }
}

}  // namespace

EmbreeScene::EmbreeScene(const EmbreeBuild& build)
    : build_(build),
      device_(rtcNewDevice(fmt::format("threads={}", std::max(build.threads, 1)).c_str())) {
  if (device_ == nullptr) return;
  scene_ = rtcNewScene(device_);
  rtcSetSceneFlags(scene_, build.flags);
  rtcSetSceneBuildQuality(scene_, build.quality);
}

EmbreeScene::EmbreeScene(EmbreeScene&& other) noexcept
    : build_(other.build_),
      device_(std::exchange(other.device_, nullptr)),
      scene_(std::exchange(other.scene_, nullptr)),
      build_seconds_(other.build_seconds_) {}

EmbreeScene::~EmbreeScene() {
  if (scene_ != nullptr) rtcReleaseScene(scene_);
  if (device_ != nullptr) rtcReleaseDevice(device_);
}

void EmbreeScene::attach(RTCGeometry geometry, GeometryId id) {
  rtcSetGeometryBuildQuality(geometry, build_.quality);
  if (build_.rejects_backs) {
    rtcSetGeometryIntersectFilterFunction(geometry, rejectBackHits);
    rtcSetGeometryOccludedFilterFunction(geometry, rejectBackHits);
  }
  rtcCommitGeometry(geometry);
  rtcAttachGeometryByID(scene_, geometry, id);
  rtcReleaseGeometry(geometry);
}

void EmbreeScene::addTriangles(const Mesh& mesh, std::size_t count) {
  RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
  void* const vertices =
      rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                              sizeof(glm::vec3), mesh.position.size());
  void* const triangles = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0,
                                                  RTC_FORMAT_UINT3, sizeof(glm::uvec3), count);
  if (vertices != nullptr && triangles != nullptr) {
    std::memcpy(vertices, mesh.position.data(), mesh.position.size() * sizeof(glm::vec3));
    std::memcpy(triangles, mesh.triangle.data(), count * sizeof(glm::uvec3));
  }
  attach(geometry, kTriangles);
}

void EmbreeScene::addSpheres(std::span<const TrueSphere> spheres) {
  if (spheres.empty()) return;
  RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_SPHERE_POINT);
  auto* const vertices = static_cast<float*>(rtcSetNewGeometryBuffer(
      geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT4, 4 * sizeof(float), spheres.size()));
  for (std::size_t i = 0; vertices != nullptr && i < spheres.size(); ++i) {
    const TrueSphere& sphere = spheres[i];
    const float values[] = {sphere.centre.x, sphere.centre.y, sphere.centre.z, sphere.radius};
    std::copy_n(values, 4, vertices + 4 * i);
  }
  attach(geometry, kSpheres);
}

Status EmbreeScene::commit() {
  const auto begin = std::chrono::steady_clock::now();
  rtcCommitScene(scene_);
  build_seconds_ = secondsSince(begin);
  if (const RTCError error = rtcGetDeviceError(device_); error != RTC_ERROR_NONE) {
    return Status::failed(fmt::format("Embree: no hierarchy: error {}{}", int(error),
                                      error == RTC_ERROR_OUT_OF_MEMORY ? " (out of memory)" : ""));
  }
  return {};
}

Result<EmbreeScene> EmbreeScene::ofTruth(const SceneGeometry& geometry, const EmbreeBuild& build) {
  EmbreeScene scene(build);
  if (scene.device_ == nullptr) return Status::failed("Embree: no device");
  scene.addTriangles(geometry.mesh, geometry.exact_triangles);
  scene.addSpheres(geometry.spheres);
  SURFEIT_RETURN_IF_ERROR(scene.commit());
  return scene;
}

Result<EmbreeScene> EmbreeScene::ofTriangles(const SceneGeometry& geometry,
                                             const EmbreeBuild& build) {
  EmbreeScene scene(build);
  if (scene.device_ == nullptr) return Status::failed("Embree: no device");
  scene.addTriangles(geometry.mesh, geometry.mesh.triangle.size());
  SURFEIT_RETURN_IF_ERROR(scene.commit());
  return scene;
}

Result<EmbreeScene> EmbreeScene::ofDisks(std::span<const Surfel> surfels,
                                         std::span<const float> radii, const EmbreeBuild& build) {
  EmbreeScene scene(build);
  if (scene.device_ == nullptr) return Status::failed("Embree: no device");
  RTCGeometry geometry = rtcNewGeometry(scene.device_, RTC_GEOMETRY_TYPE_ORIENTED_DISC_POINT);
  auto* const vertices = static_cast<float*>(rtcSetNewGeometryBuffer(
      geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT4, 4 * sizeof(float), surfels.size()));
  auto* const normals = static_cast<float*>(rtcSetNewGeometryBuffer(
      geometry, RTC_BUFFER_TYPE_NORMAL, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), surfels.size()));
  for (std::size_t i = 0; vertices != nullptr && normals != nullptr && i < surfels.size(); ++i) {
    std::memcpy(vertices + 4 * i, &surfels[i].position, sizeof(glm::vec3));
    vertices[4 * i + 3] = radii[i];
    std::memcpy(normals + 3 * i, &surfels[i].normal, sizeof(glm::vec3));
  }
  scene.attach(geometry, kDisks);
  SURFEIT_RETURN_IF_ERROR(scene.commit());
  return scene;
}

// Duff et al. 2017, "Building an orthonormal basis, revisited".
TangentFrame::TangentFrame(const glm::vec3& normal) {
  const float sign = std::copysign(1.0f, normal.z);
  const float a = -1 / (sign + normal.z), b = normal.x * normal.y * a;
  x = {1 + sign * normal.x * normal.x * a, sign * b, -sign * normal.x};
  y = {b, sign + normal.y * normal.y * a, -normal.y};
}

std::vector<glm::vec3> stratifiedCosineDirections(int side, std::uint64_t seed) {
  constexpr int kTile = 4;
  constexpr double kQuarterPi = 0.7853981633974483;
  std::vector<glm::vec3> directions;
  directions.reserve(std::size_t(side) * std::size_t(side));
  for (int i = 0; i < side * side; ++i) {
    const int tile = i / (kTile * kTile), tiles = side / kTile, cell = i % (kTile * kTile);
    const std::uint64_t hash = hashOf(seed, std::uint64_t(i));
    const double column = tile % tiles * kTile + cell % kTile + double(hash >> 40) * 0x1p-24;
    const double row =
        int(tile / tiles) * kTile + int(cell / kTile) + double(hash & 0xffffff) * 0x1p-24;

    // Shirley and Chiu's concentric map keeps the cells square, and so their error small
    const double a = 2 * column / side - 1, b = 2 * row / side - 1;
    const bool is_wide = std::abs(a) > std::abs(b);
    const double radius = is_wide ? a : b, ratio = radius == 0 ? 0 : (is_wide ? b : a) / radius;
    const double along = radius * std::cos(kQuarterPi * ratio);
    const double across = radius * std::sin(kQuarterPi * ratio);
    const double height = std::sqrt(std::max(0.0, 1 - radius * radius));
    directions.push_back(is_wide ? glm::vec3(along, across, height)
                                 : glm::vec3(across, along, height));
  }
  return directions;
}

}  // namespace surfeit
