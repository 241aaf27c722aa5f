// The gather of one bounce: threads take the surfel pages of the scene in order, a stretch at a
// time, gather at their surfels, and hand in the new radiosities.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <vector>

#include "batch/bounce_look.h"
#include "batch/paging_controller.h"
#include "bounce/bounce_radiosity.h"
#include "bounce/bounce_receivers.h"
#include "bounce/glossy_bounce.h"
#include "core/first_failure.h"
#include "engine/thread_gatherer.h"
#include "octree/read/paged_octree.h"
#include "octree/read/scene_file.h"
#include "surfeit/gather.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

class BounceCrew {
 public:
  // All that is referred to must outlive the crew.
  struct Setup {
    const SceneFile& scene;                    // with B_0
    const std::shared_ptr<const World> world;  // the same scene with B_{k-1}
    BounceLook look;                           // about the scene's origin
    CorrectionOfGroup of_groups{};
    const GlossOfGroup* gloss = nullptr;  // null: nothing is glossy
    int surfels_per_receiver = 1;
    int threads = 1;
    std::uint32_t stride = 1;    // one of so many stretches is gathered: 1 all, more a sample
    BounceRadiosity& radiosity;  // gets B_k
    PagingController& controller;
    Progress& progress;
  };
  explicit BounceCrew(const Setup& setup) : setup_(setup) {}

  // Gathers at all pages. Returns the first failure; kInterrupted when the progress is cancelled.
  // Once.
  Status run();

  // After run().
  std::uint64_t receivers() const { return receivers_; }
  std::uint64_t surfels() const { return surfels_; }
  // Surfels of glossy groups that send evenly: two-sided ones and spheres.
  std::uint64_t withoutMirror() const { return without_mirror_; }
  double largestChange() const { return double(largest_change_.load()); }

  // Bytes of a thread beside gatherer, reader and caches.
  static std::uint64_t threadBytes(const SceneFile& scene, int surfels_per_receiver,
                                   bool is_glossy);

 private:
  struct Stretch;

  Status gatherStretches();
  Status load(std::uint32_t first_page, PagedOctree::Reader& reader, Stretch& stretch) const;
  Status gather(ThreadGatherer& gatherer, Stretch& stretch) const;
  Status handIn(std::uint32_t first_page, Stretch& stretch);
  glm::vec3 reflected(const Surfel& surfel, const glm::vec3& irradiance) const;
  Lobe lobeOf(std::size_t i, const glm::vec3& sent, const glm::vec3& radiosity,
              const Stretch& stretch);
  void noteChange(float change);

  const Setup setup_;
  FirstFailure failure_;
  std::atomic<std::uint32_t> next_page_{0};
  std::atomic<std::uint64_t> receivers_{0}, surfels_{0}, without_mirror_{0};
  std::atomic<float> largest_change_{0};
};

}  // namespace surfeit
