// A cloud indexed to a temporary file and opened with everything in memory, and gathers from it.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/curve_key.h"
#include "gather/rules/gather_rules.h"
#include "gather/rules/receiver.h"
#include "octree/read/paged_octree.h"
#include "surfeit/bounce.h"
#include "surfeit/status.h"
#include "surfeit/surfel.h"

namespace surfeit {

struct IndexedSceneOptions {
  bool full_precision = false;
  int files = 1;  // that the cloud is split over
  int threads = 1;
  std::uint64_t memory_bytes = std::uint64_t{64} << 20;
};

// One thread at a time.
class IndexedScene {
 public:
  static Result<std::unique_ptr<IndexedScene>> make(std::span<const Surfel> cloud,
                                                    const IndexedSceneOptions& options = {});
  // The same, with the light of bounces.
  static Result<std::unique_ptr<IndexedScene>> makeBounced(std::span<const Surfel> cloud,
                                                           const IndexedSceneOptions& options,
                                                           const BounceOptions& bounce);
  static Result<std::unique_ptr<IndexedScene>> open(const std::string& path);

  // Each by itself; and together as gatherCloud does, along the curve. In the
  // order of the receivers.
  Result<std::vector<GatherResult>> gatherAlone(std::span<const LocalReceiver> receivers,
                                                const GatherRules& rules);
  Result<std::vector<GatherResult>> gatherTogether(std::span<const LocalReceiver> receivers,
                                                   const GatherRules& rules);

  PagedOctree::Reader& reader() { return *reader_; }
  // Of a place: receivers are ordered by it.
  CurveKey keyOf(const glm::vec3& position) const;

 private:
  explicit IndexedScene(std::unique_ptr<PagedOctree> octree)
      : octree_(std::move(octree)), reader_(std::make_unique<PagedOctree::Reader>(*octree_)) {}

  std::unique_ptr<PagedOctree> octree_;
  std::unique_ptr<PagedOctree::Reader> reader_;
};

// Indexes a cloud to a file that stays.
Status indexTo(const std::string& path, std::span<const Surfel> cloud,
               const IndexedSceneOptions& options = {});

// What a cloud of these surfels has.
CloudChannels channelsOf(std::span<const Surfel> cloud);

}  // namespace surfeit
