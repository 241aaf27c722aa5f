// The root cube that the scenes of a sequence share (IndexOptions::cube), and the surfels that it
// does not hold.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "core/bounds.h"
#include "surfeit/index.h"
#include "surfeit/scene.h"
#include "surfeit/status.h"
#include "surfeit/surfel.h"

namespace surfeit {

// One indexing's. The number of surfels outside is counted by any threads.
class PinnedCube {
 public:
  explicit PinnedCube(const SceneCube& cube) : cube_(cube) {}

  // kInvalidArgument for a cube that is none.
  static Status check(const SceneCube& cube);

  // Where positions are counted from. It follows from the cube alone: bounds of one scene of a
  // sequence would give another origin than those of the next.
  glm::dvec3 origin() const;
  // The cube about an origin.
  RootCube about(const glm::dvec3& origin) const;
  // The numbers, unless they are those of the cube that surfels in these bounds get by themselves.
  std::optional<std::array<double, 4>> unusualNumbers(const Bounds3& bounds,
                                                      const glm::dvec3& origin) const;

  // Counts the surfels outside, about that origin; `bounds` are theirs.
  void look(std::span<const Surfel> surfels, const Bounds3& bounds, const glm::dvec3& origin);
  // The number of surfels outside so far; more of them, which another machine has counted.
  std::uint64_t outside() const { return outside_; }
  void addOutside(std::uint64_t surfels) { outside_ += surfels; }
  // kInvalidArgument when there were any, with a cube that holds all `surfels` in `bounds`.
  Status status(std::uint64_t surfels, const Bounds3& bounds, const glm::dvec3& origin) const;

 private:
  Bounds3d box() const { return {cube_.corner, cube_.corner + cube_.size}; }

  SceneCube cube_;
  std::atomic<std::uint64_t> outside_{0};
};

}  // namespace surfeit
