// How dense a cloud is, by a sample of its places: how far its points lie apart, and how many
// places have several. In bounded memory and without an octree: the cloud streams past the sample.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "core/bounds.h"
#include "octree/read/scene_file.h"
#include "surfeit/cloud_info.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"
#include "surfeit/surfel.h"
#include "surfels/rows/surfel_source.h"

namespace surfeit {

// Points from all over a cloud: one, by chance that is the same each time, of each thousandth of
// its records. One thread at a time.
class PlaceSample {
 public:
  static constexpr std::uint64_t kMostPlaces = 1000;

  // `records`: at least as many as the cloud has surfels.
  explicit PlaceSample(std::uint64_t records) : records_(records) {}

  // The next surfels of the cloud.
  void add(std::span<const Surfel> surfels);
  void clear();

  std::uint64_t surfelCount() const { return surfels_; }
  const Bounds3& bounds() const { return bounds_; }  // of all surfels
  std::span<const glm::vec3> places() const { return places_; }

 private:
  std::uint64_t nextPick() const;

  std::uint64_t records_;
  std::uint64_t surfels_ = 0;
  std::uint64_t part_ = 0;  // the next thousandth
  Bounds3 bounds_;
  std::vector<glm::vec3> places_;
};

// Reads the cloud that `sample` comes from, once, or up to three times where densities differ so
// much that the sample does not tell how far to look. Takes a few MiB. Errors: those of the source;
// kInterrupted.
Result<CloudDensity> measureDensity(SurfelSource& source, const PlaceSample& sample,
                                    Progress& progress);

// The same of a scene, by searches in its octree: a few thousand pages are read at most, and 16 MiB
// of them kept. Errors: kIoError, kCorruption, kInterrupted.
Result<CloudDensity> measureDensity(SceneFile scene, Progress& progress);

}  // namespace surfeit
