// Ray tracing as a way to gather: Embree with every choice made in its favour.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "bench/internal/embree_scene.h"
#include "bench/internal/gather_measure.h"
#include "bench/internal/gather_scenes.h"
#include "surfeit/gather.h"
#include "surfeit/status.h"

namespace surfeit {

// Directions ready to be turned to a receiver's normal, so that making rays costs next to nothing:
// some stratified sets, of which each receiver gets one, turned about its normal by an angle of its
// own. Immutable; safe from any thread.
class RayDirections {
 public:
  // `rays` is the square of a multiple of 4.
  explicit RayDirections(int rays);
  int rays() const { return rays_; }
  // World directions of receiver number `receiver`: x, y and z of rays() rays each.
  void turn(const glm::vec3& normal, std::size_t receiver, float* x, float* y, float* z) const;

 private:
  static constexpr std::size_t kSets = 16, kAngles = 256;
  int rays_;
  std::vector<float> x_, y_, z_;   // kSets runs of rays_
  std::vector<glm::vec2> angles_;  // cosine and sine
};

// How rays are shot. All that a ray tracer is free to choose, found by trying.
struct RayShape {
  int lanes = 16;            // of a packet: 1, 8 or 16
  bool is_coherent = false;  // Embree's hint
};

// A scene to trace and what its primitives look like.
struct PeerScene {
  std::string name;
  std::unique_ptr<EmbreeScene> embree{};
  std::vector<glm::vec4> radiosity{};  // of primitives; one look-up is all that a hit costs
  // Where a ray begins above its receiver: scene units and radii of the receiver's surfel together.
  float offset = 0, offset_radii = 0;
  RayShape occlusion_shape{}, bleeding_shape{};
  // For places within primitives, null where these are too small to matter.
  const SceneGeometry* exact = nullptr;
  std::string notes{};  // what was tried and chosen
};

// Traces all rays of a receiver. With `is_exact` and a scene that has an exact geometry, radiosity
// is that of the very place hit: for errors, not for time.
std::unique_ptr<Worker> makeRayWorker(const PeerScene& scene, GatherMode mode,
                                      const RayDirections& directions, const RayShape& shape,
                                      bool is_exact);

// The triangles of a scene. One-sided scenes are traced with or without rejecting what faces away;
// without is faster, and as right where all is closed.
Result<PeerScene> makeTrianglePeer(const GatherScene& scene, bool rejects_backs, int threads);
// The surfels as disks: with the radii of the cloud or those of their areas, and a start of rays,
// whichever come nearest to the truth at the judged receivers.
Result<PeerScene> makeDiskPeer(const GatherScene& scene, std::span<const Surfel> surfels,
                               const ReceiverSet& set, std::span<const GatherResult> truth,
                               int threads);
// Finds the fastest shapes of rays at a sample of the receivers.
Status chooseRayShapes(const ReceiverSet& set, PeerScene& scene);

}  // namespace surfeit
