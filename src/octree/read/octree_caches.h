// The two caches of an engine or a job: pages of nodes and pages of surfels, of one scene or of any
// number that are open together. Each scene has page numbers of its own in both.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <shared_mutex>
#include <span>

#include "cache/page_cache.h"
#include "cache/reuse_distances.h"
#include "octree/read/scene_file.h"
#include "surfeit/status.h"

namespace surfeit {

// Ranges of page numbers, each of a scene.
class PageRanges {
 public:
  explicit PageRanges(PageNumber capacity) : capacity_(capacity) {}

  // The lowest numbers that are free; nothing when none are.
  std::optional<PageNumber> take(PageNumber count, const SceneFile* scene);
  void giveBack(PageNumber first);
  // The scene that has a page, and the first of its numbers.
  struct Owner {
    const SceneFile* scene = nullptr;
    PageNumber first = 0;
  };
  Owner ownerOf(PageNumber page) const;
  // Numbers that are in use.
  PageNumber count() const { return count_; }
  PageNumber countOf(PageNumber first) const { return ranges_.at(first).count; }

 private:
  struct Range {
    PageNumber count;
    const SceneFile* scene;
  };
  PageNumber capacity_, count_ = 0;
  std::map<PageNumber, Range> ranges_;  // by their first number
};

// Safe from any thread, but for the two caches' own rules.
class OctreeCaches {
 public:
  struct Options {
    std::size_t node_page_bytes = 0, surfel_page_bytes = 0;  // decoded, of the largest page
    PageNumber node_pages = 0, surfel_pages = 0;  // numbers for all scenes that are open together
    std::size_t node_frames = 0, surfel_frames = 0;  // at first
    // Bytes that the frames of both may ever take together, for which address space is reserved in
    // each; 0: those of the frames at first.
    std::size_t most_bytes = 0;
    std::size_t tracked_pages = 0;  // sampled for reuse distances, per cache; 0: none
  };
  // kBudgetTooSmall without a frame, kFailed when the address space cannot be had.
  static Result<std::unique_ptr<OctreeCaches>> create(const Options& options);

  // Numbers for the pages of a scene. kBudgetTooSmall when there are too few; kInvalidArgument when
  // its pages are larger than the frames. `file` must stay where it is until detach.
  struct Place {
    PageNumber first_node_page = 0, first_surfel_page = 0;
  };
  Result<Place> attach(const SceneFile& file);
  // Nobody may hold a page of the scene any more; its frames are free.
  void detach(const Place& place);

  // Limits of both, so that together they never have more frames than before or after.
  void setFrameLimits(std::size_t nodes, std::size_t surfels);

  PageCache& nodes() { return *nodes_; }
  PageCache& surfels() { return *surfels_; }
  // Null unless pages are tracked.
  ReuseDistances* nodeDistances() { return node_distances_ ? &*node_distances_ : nullptr; }
  ReuseDistances* surfelDistances() { return surfel_distances_ ? &*surfel_distances_ : nullptr; }

  // Bytes that a page of either kind takes in its cache, and pages of all scenes that are open.
  std::size_t nodeFrameBytes() const { return PageCache::frameBytes(options_.node_page_bytes); }
  std::size_t surfelFrameBytes() const { return PageCache::frameBytes(options_.surfel_page_bytes); }
  PageNumber nodePages() const;
  PageNumber surfelPages() const;

 private:
  explicit OctreeCaches(const Options& options);
  PageRanges::Owner nodeOwner(PageNumber page) const;
  PageRanges::Owner surfelOwner(PageNumber page) const;

  const Options options_;
  mutable std::shared_mutex mutex_;
  PageRanges node_ranges_, surfel_ranges_;  // guarded by mutex_
  std::optional<ReuseDistances> node_distances_, surfel_distances_;
  std::unique_ptr<PageCache> nodes_, surfels_;
};

}  // namespace surfeit
