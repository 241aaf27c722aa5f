// Surfels of the pieces of a mesh, and the tasks that make them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "sample/dice.h"
#include "sample/direct_light.h"
#include "sample/meshes/mesh.h"
#include "surfeit/surfel.h"

namespace surfeit {

// About the number of pieces of a task: 32 KiB of surfels; a task of nothing but the worst slivers
// stays below 32 MiB.
inline constexpr std::uint64_t kTaskPieces = 512;

// What one task makes.
struct SurfelBatch {
  std::vector<Surfel> surfels;
  double disk_area = 0;
  std::uint64_t clear = 0;  // pieces of which nothing is there
};

// Gives parts of pieces normals and direct light. Immutable; safe from any thread.
class SurfelMaker {
 public:
  // Mesh and light must outlive it; `light` is null when nothing emits.
  SurfelMaker(const Mesh& mesh, const DirectLight* light, bool is_two_sided)
      : mesh_(mesh), light_(light), is_two_sided_(is_two_sided) {}

  const Mesh& mesh() const { return mesh_; }

  // The surfel of a part of the triangle; `there` becomes how much of it a mask leaves. The same
  // seed gives the same light.
  Surfel make(std::uint32_t triangle, const PiecePart& part, std::uint64_t seed,
              float& there) const;
  // Leaves the surfels from `begin` the areas that are there, and none of what is clear.
  void applyMasks(const std::vector<float>& there, std::size_t begin, SurfelBatch& batch) const;

 private:
  void showBothSides(SurfacePoint point, std::uint64_t seed, const PiecePart& part,
                     Surfel& surfel) const;

  const Mesh& mesh_;
  const DirectLight* light_;
  const bool is_two_sided_;
};

// Makes the surfels of some pieces. Safe from any thread.
class SurfelTask {
 public:
  virtual ~SurfelTask() = default;
  virtual void fill(SurfelBatch& batch) const = 0;
};

// Deals a mesh out in tasks that depend on mesh and options alone, not on the threads. One thread
// at a time.
class SurfelTasks {
 public:
  virtual ~SurfelTasks() = default;
  // Null at the end.
  virtual std::unique_ptr<SurfelTask> next() = 0;
};

// As many surfels as the plan says, in proportion to area. Plan and maker must outlive it.
std::unique_ptr<SurfelTasks> makePlanTasks(DicePlan& plan, const SurfelMaker& maker);

}  // namespace surfeit
