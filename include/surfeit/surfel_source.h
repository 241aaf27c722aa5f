// Builds a scene from surfels that a caller holds in memory or makes on demand.
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

// Implement it to index surfels without a file. Functions are called from one thread at a time, not
// always from the same one.
class SURFEIT_API SurfelProvider {
 public:
  virtual ~SurfelProvider() = default;

  // Messages about the surfels begin with this name.
  virtual std::string name() const { return "surfels"; }
  virtual std::uint64_t count() const = 0;
  // The members of the surfels that hold data, besides the position. The others are filled in as
  // for clouds (docs/format.md, "Rules for what is missing").
  virtual CloudChannels channels() const = 0;
  // The origin of positions, in scene units.
  virtual glm::dvec3 origin() const { return glm::dvec3(0); }
  virtual UpAxis up() const { return kDefaultUpAxis; }
  // Copies surfels number first to first + count - 1, which exist, to `surfels`. Each surfel is
  // read more than once, and must be the same each time.
  virtual Status read(std::uint64_t first, std::size_t count, Surfel* surfels) = 0;
};

// An array that the caller holds.
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

// As indexClouds, for surfels from a provider. The budget does not count the provider's memory.
// Errors: as indexClouds, and the provider's own.
SURFEIT_API Result<IndexStats> indexSurfels(SurfelProvider& provider, const std::string& output,
                                            const IndexOptions& options, Progress& progress);

}  // namespace surfeit
