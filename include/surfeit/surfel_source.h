// Surfels that a caller has in memory, or makes as they are asked for, on the way to a scene.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <string>

#include "surfeit/api.h"
#include "surfeit/index.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"
#include "surfeit/surfel.h"
#include "surfeit/up_axis.h"

namespace surfeit {

// Implement to index without a file. Functions are called from one thread at a time, not always the
// same one.
class SURFEIT_API SurfelProvider {
 public:
  virtual ~SurfelProvider() = default;

  // Begins messages: "surfels".
  virtual std::string name() const { return "surfels"; }
  virtual std::uint64_t count() const = 0;
  // Which members of the surfels mean something; positions always do. What is missing is filled in
  // as for clouds (docs/format.md, "Filled in").
  virtual CloudChannels channels() const = 0;
  // What positions are counted from, in scene units.
  virtual glm::dvec3 origin() const { return glm::dvec3(0); }
  virtual UpAxis up() const { return kDefaultUpAxis; }
  // Copies surfels number first to first + count - 1, which exist, to `surfels`. Called for all of
  // them more than once, and each time it must give the same.
  virtual Status read(std::uint64_t first, std::size_t count, Surfel* surfels) = 0;
};

// An array that a caller holds.
class SURFEIT_API SurfelSpan : public SurfelProvider {
 public:
  SurfelSpan(const Surfel* surfels, std::size_t count, const CloudChannels& channels,
             const glm::dvec3& origin = glm::dvec3(0))
      : surfels_(surfels), count_(count), channels_(channels), origin_(origin) {}

  std::uint64_t count() const override { return count_; }
  CloudChannels channels() const override { return channels_; }
  glm::dvec3 origin() const override { return origin_; }
  Status read(std::uint64_t first, std::size_t count, Surfel* surfels) override {
    std::copy_n(surfels_ + first, count, surfels);
    return {};
  }

 private:
  const Surfel* surfels_;
  std::size_t count_;
  CloudChannels channels_;
  glm::dvec3 origin_;
};

// As indexClouds, of surfels from a provider. What a provider holds is not counted in the budget.
// Errors: as indexClouds, and the provider's own.
SURFEIT_API Result<IndexStats> indexSurfels(SurfelProvider& provider, const std::string& output,
                                            const IndexOptions& options, Progress& progress);

}  // namespace surfeit
