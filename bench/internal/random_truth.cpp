#include "bench/internal/random_truth.h"

#include <embree3/rtcore.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <glm/geometric.hpp>
#include <limits>

#include "bench/internal/embree_scene.h"

namespace surfeit {
namespace {

// Spheres closer than so many of their radii are a receiver's own surface (docs/algorithm.md).
constexpr float kOwnRadii = 3;

// A ray, and how much of its light passes what it has met.
struct RayContext {
  RTCIntersectContext embree;  // first: filters get a pointer to it
  glm::vec3 open;              // rgb
};

// What the rays meet, as the user data of a geometry.
struct MetSurfaces {
  GatherSides sides = GatherSides::kBoth;
  std::vector<glm::vec3> opacities;  // of the primitives, rgb
};

// Takes what the hits hide from the light that passes, and keeps one where none is left.
void filterHits(const RTCFilterFunctionNArguments* hits) {
  const auto& met = *static_cast<const MetSurfaces*>(hits->geometryUserPtr);
  glm::vec3& open = reinterpret_cast<RayContext*>(hits->context)->open;
  for (unsigned i = 0; i < hits->N; ++i) {
    const float facing =
        RTCRayN_dir_x(hits->ray, hits->N, i) * RTCHitN_Ng_x(hits->hit, hits->N, i) +
        RTCRayN_dir_y(hits->ray, hits->N, i) * RTCHitN_Ng_y(hits->hit, hits->N, i) +
        RTCRayN_dir_z(hits->ray, hits->N, i) * RTCHitN_Ng_z(hits->hit, hits->N, i);
    const GatherSides side = facing < 0 ? GatherSides::kFront : GatherSides::kBack;
    const bool counts = met.sides == GatherSides::kBoth || met.sides == side;
    if (counts) open *= 1.f - met.opacities[RTCHitN_primID(hits->hit, hits->N, i)];
    if (open != glm::vec3(0)) hits->valid[i] = 0;
  }
}

class TruthScene {
 public:
  TruthScene() : device_(rtcNewDevice("threads=1,set_affinity=0")) {}
  TruthScene(const TruthScene&) = delete;
  TruthScene& operator=(const TruthScene&) = delete;
  ~TruthScene() {
    if (scene_ != nullptr) rtcReleaseScene(scene_);
    if (device_ != nullptr) rtcReleaseDevice(device_);
  }

  Status build(const RandomScene& scene, GatherSides sides) {
    if (device_ == nullptr) return Status::failed("Embree: no device");
    scene_ = rtcNewScene(device_);
    rtcSetSceneFlags(scene_, RTC_SCENE_FLAG_ROBUST);  // no ray slips between two triangles
    addTriangles(scene, false, sides);
    addTriangles(scene, true, GatherSides::kBoth);
    addSpheres(scene);
    rtcCommitScene(scene_);
    if (rtcGetDeviceError(device_) != RTC_ERROR_NONE) return Status::failed("Embree: no hierarchy");
    return {};
  }

  // Of all colors together, as occlusion has it.
  float openPart(const glm::vec3& origin, const glm::vec3& direction) const {
    RTCRay ray{};
    ray.org_x = origin.x, ray.org_y = origin.y, ray.org_z = origin.z;
    ray.dir_x = direction.x, ray.dir_y = direction.y, ray.dir_z = direction.z;
    ray.tfar = std::numeric_limits<float>::infinity();
    ray.mask = ~0u;
    RayContext context{{}, glm::vec3(1)};
    rtcInitIntersectContext(&context.embree);
    rtcOccluded1(scene_, &context.embree, &ray);
    return (context.open.x + context.open.y + context.open.z) / 3;
  }

 private:
  void attach(RTCGeometry geometry, MetSurfaces& met) {
    rtcSetGeometryUserData(geometry, &met);
    rtcSetGeometryOccludedFilterFunction(geometry, filterHits);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene_, geometry);
    rtcReleaseGeometry(geometry);
  }

  // Those that are two-sided, or the others.
  void addTriangles(const RandomScene& scene, bool are_two_sided, GatherSides sides) {
    std::vector<const RandomTriangle*> chosen;
    for (const RandomTriangle& triangle : scene.triangles) {
      if (triangle.is_two_sided == are_two_sided) chosen.push_back(&triangle);
    }
    if (chosen.empty()) return;
    RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
    auto* const corners = static_cast<float*>(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                sizeof(glm::vec3), 3 * chosen.size()));
    auto* const indices = static_cast<unsigned*>(rtcSetNewGeometryBuffer(
        geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(unsigned), chosen.size()));
    if (corners == nullptr || indices == nullptr) return;
    for (std::size_t i = 0; i < chosen.size(); ++i) {
      std::memcpy(corners + 9 * i, chosen[i]->corners, 3 * sizeof(glm::vec3));
      for (unsigned j = 0; j < 3; ++j) indices[3 * i + j] = unsigned(3 * i) + j;
    }
    MetSurfaces& met = met_[are_two_sided ? 1 : 0];
    met.sides = sides;
    for (const RandomTriangle* triangle : chosen) {
      met.opacities.push_back(scene.ingredients[triangle->ingredient].opacity);
    }
    attach(geometry, met);
  }

  void addSpheres(const RandomScene& scene) {
    if (scene.spheres.empty()) return;
    RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_SPHERE_POINT);
    auto* const values = static_cast<float*>(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT4,
                                4 * sizeof(float), scene.spheres.size()));
    for (std::size_t i = 0; values != nullptr && i < scene.spheres.size(); ++i) {
      const RandomSphere& sphere = scene.spheres[i];
      const float row[] = {sphere.centre.x, sphere.centre.y, sphere.centre.z, sphere.radius};
      std::copy_n(row, 4, values + 4 * i);
      met_[2].opacities.push_back(scene.ingredients[sphere.ingredient].opacity);
    }
    met_[2].sides = GatherSides::kFront;  // rays leave where they have met already
    attach(geometry, met_[2]);
  }

  RTCDevice device_ = nullptr;
  RTCScene scene_ = nullptr;
  MetSurfaces met_[3];  // one-sided triangles, two-sided ones, spheres
};

bool isOnSpheres(const RandomScene& scene, const LocalReceiver& receiver) {
  return std::any_of(scene.spheres.begin(), scene.spheres.end(), [&](const RandomSphere& sphere) {
    return glm::distance(sphere.centre, receiver.position) < kOwnRadii * sphere.radius;
  });
}

// Even over the sphere, by strata of height and turn.
std::vector<glm::vec3> sphereDirections(int side) {
  constexpr float kTurn = 6.2831853f;
  std::vector<glm::vec3> directions;
  for (int i = 0; i < side * side; ++i) {
    const float z = 1 - (2 * float(i / side) + 1) / float(side);
    const float turn = kTurn * (float(i % side) + .5f) / float(side);
    const float across = std::sqrt(1 - z * z);
    directions.emplace_back(across * std::cos(turn), across * std::sin(turn), z);
  }
  return directions;
}

}  // namespace

Result<std::vector<float>> traceOcclusion(const RandomScene& scene, GatherSides sides, int rays) {
  TruthScene truth;
  SURFEIT_RETURN_IF_ERROR(truth.build(scene, sides));
  const int side = int(std::lround(std::sqrt(double(rays))));
  const std::vector<glm::vec3> whole_sphere = sphereDirections(side);
  std::vector<float> occlusion;
  for (const RandomReceiver& one : scene.receivers) {
    const LocalReceiver& receiver = one.receiver;
    if (one.is_on_border || (receiver.isSpherical() && isOnSpheres(scene, receiver))) {
      occlusion.push_back(-1);
      continue;
    }
    const TangentFrame frame(receiver.isSpherical() ? glm::vec3(0, 0, 1) : receiver.normal);
    const glm::vec3 origin = receiver.position + one.ray_offset * receiver.normal;
    const std::vector<glm::vec3> hemisphere = stratifiedCosineDirections(side, occlusion.size());
    double open = 0;
    for (const glm::vec3& local : receiver.isSpherical() ? whole_sphere : hemisphere) {
      const glm::vec3 direction = receiver.isSpherical() ? local
                                                         : local.x * frame.x + local.y * frame.y +
                                                               local.z * receiver.normal;
      open += double(truth.openPart(origin, direction));
    }
    occlusion.push_back(float(1 - open / (double(side) * side)));
  }
  return occlusion;
}

}  // namespace surfeit
