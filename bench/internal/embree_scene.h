// Embree scenes of the gather benches: the true geometry, the triangles, or surfels as disks; and
// the rays that ray tracers gather with.
#pragma once

#include <embree3/rtcore.h>

#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "bench/internal/gather_scene_geometry.h"
#include "surfeit/status.h"
#include "surfeit/surfel.h"

// Functions that are compiled for several instruction sets, of which the best is taken at run time.
#if defined(__x86_64__)
#define SURFEIT_BENCH_CLONES __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define SURFEIT_BENCH_CLONES
#endif

namespace surfeit {

struct EmbreeBuild {
  RTCSceneFlags flags = RTC_SCENE_FLAG_NONE;
  RTCBuildQuality quality = RTC_BUILD_QUALITY_HIGH;
  bool rejects_backs = false;  // rays pass through what faces away from them
  int threads = 1;             // to build with
};

// Geometries have the numbers of this enum. Immutable; safe to trace from any thread.
class EmbreeScene {
 public:
  enum GeometryId : unsigned { kTriangles = 0, kSpheres = 1, kDisks = 0 };

  // All of these copy what they are given. kFailed when Embree refuses.
  static Result<EmbreeScene> ofTruth(const SceneGeometry& geometry, const EmbreeBuild& build);
  static Result<EmbreeScene> ofTriangles(const SceneGeometry& geometry, const EmbreeBuild& build);
  // radii[i] is that of surfel i's disk.
  static Result<EmbreeScene> ofDisks(std::span<const Surfel> surfels, std::span<const float> radii,
                                     const EmbreeBuild& build);
  EmbreeScene(EmbreeScene&& other) noexcept;
  ~EmbreeScene();

  RTCScene handle() const { return scene_; }
  double buildSeconds() const { return build_seconds_; }

 private:
  explicit EmbreeScene(const EmbreeBuild& build);
  void addTriangles(const Mesh& mesh, std::size_t count);
  void addSpheres(std::span<const TrueSphere> spheres);
  void attach(RTCGeometry geometry, GeometryId id);
  Status commit();

  EmbreeBuild build_;
  RTCDevice device_ = nullptr;
  RTCScene scene_ = nullptr;
  double build_seconds_ = 0;
};

// Two directions that are orthogonal to a unit vector and to each other.
struct TangentFrame {
  explicit TangentFrame(const glm::vec3& normal);
  glm::vec3 x, y;
};

// side^2 directions about +z with density cos / pi: a jittered grid lifted from the disk. Each run
// of 16 is a square of 4 x 4 cells of the grid, so that packets of neighbours stay together; `side`
// is a multiple of 4.
std::vector<glm::vec3> stratifiedCosineDirections(int side, std::uint64_t seed);

}  // namespace surfeit
