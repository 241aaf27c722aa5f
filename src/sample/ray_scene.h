// A mesh made ready for tracing rays; the one place that knows Embree.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <optional>

#include "sample/meshes/mesh.h"
#include "surfeit/status.h"

namespace surfeit {

// Where a ray meets the mesh: the point of `triangle` with barycentric weights (1 - u - v, u, v).
struct RayHit {
  float distance;  // in lengths of the ray's direction
  std::uint32_t triangle;
  float u, v;
};

// Shares the mesh, which must outlive it and stay where and as it is. Rays pass through what is not
// opaque with the probability that says how little of it is there, by a number that the place on
// the triangle gives: the same ray always does the same. Queries are safe from any thread.
class RayScene {
 public:
  // Builds the hierarchy with up to `threads` threads. kFailed when Embree refuses.
  static Result<RayScene> build(const Mesh& mesh, int threads);
  RayScene(RayScene&&) noexcept;
  RayScene& operator=(RayScene&&) noexcept;
  ~RayScene();

  // Whose light a ray is: what has a tint lets each color through by its own opacity. Light of no
  // color passes by the mean of the three.
  static constexpr std::uint32_t kNoColor = 3;

  // Is anything hit between distances begin and end along the ray? Its origin is counted from that
  // of the mesh.
  bool isOccluded(const glm::vec3& origin, const glm::vec3& direction, float begin, float end,
                  std::uint32_t color = kNoColor) const;
  // By color 0 where something is hit, else 1.
  glm::vec3 passedLight(const glm::vec3& origin, const glm::vec3& direction, float begin,
                        float end) const;
  std::optional<RayHit> closestHit(const glm::vec3& origin, const glm::vec3& direction, float begin,
                                   float end, std::uint32_t color = kNoColor) const;

  // How far off a surface a ray must start so as not to meet it again: covers the rounding of
  // positions of the size of this scene.
  float surfaceOffset() const { return surface_offset_; }
  const Bounds3& bounds() const { return bounds_; }

 private:
  struct Handles;
  explicit RayScene(std::unique_ptr<Handles> handles);
  std::unique_ptr<Handles> handles_;
  Bounds3 bounds_;
  float surface_offset_ = 0;
  bool has_tints_ = false;
};

}  // namespace surfeit
