// The octree of a .sft file, read on demand through two caches: one for node groups, one for
// surfel groups (memo, section 4).
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "cache/page_cache.h"
#include "core/bounds.h"
#include "octree/node.h"
#include "octree/scene_file.h"
#include "surfeit/status.h"
#include "surfeit/surfel.h"

namespace surfeit {

// Open file, directory and caches. Readers on several threads share one of these.
class PagedOctree {
 public:
  // How a memory budget is spent. All in bytes or counts; see planMemory.
  struct Memory {
    std::size_t node_frames = 0;
    std::size_t surfel_frames = 0;
    std::size_t front_slots = 0;  // per thread and cache
  };

  // Bytes that opening the file takes beside the caches: directory and decode buffers of `threads`.
  static std::size_t fixedBytes(const SceneFile& file, int threads);
  // Splits `cache_bytes` between the two caches of a file that `threads` readers use: everything
  // when it fits, else half each with what one cannot use given to the other. kBudgetTooSmall,
  // naming the bytes that would do, when a reader could not hold the pages of one traversal step.
  static Result<Memory> planMemory(const SceneFile& file, std::size_t cache_bytes, int threads);
  // Cache bytes that hold the whole file decoded.
  static std::size_t unlimitedCacheBytes(const SceneFile& file);

  static Result<std::unique_ptr<PagedOctree>> create(SceneFile file, const Memory& memory);
  ~PagedOctree();

  const SceneFile& file() const;
  CacheCounters nodeCounters() const;
  CacheCounters surfelCounters() const;

  // A thread's way into the octree. One thread at a time; must go before the octree does.
  class Reader {
   public:
    explicit Reader(PagedOctree& octree);
    ~Reader();

    // kCorruption when a traversal has met more nodes or surfels than the file holds: references
    // that share or repeat what lies below, which would make it endless for all practical purposes.
    Status checkVisits(std::uint64_t nodes, std::uint64_t surfels) const;

    // The siblings of a range. Valid until the next call of nodes() on this reader; surfels() does
    // not invalidate it. kCorruption when a page does not decode.
    Result<std::span<const Node>> nodes(const NodeRange& range);

    // Up to `count` surfels from index `first` of a surfel page: fewer when the page ends before.
    // Never empty when ok. Valid until the next call of surfels() on this reader.
    Result<std::span<const Surfel>> surfels(std::uint32_t page, std::uint32_t first,
                                            std::uint64_t count);

    // Calls visit(std::span<const Surfel>) for the surfels of a leaf, page by page, in curve order.
    template <typename Visit>
    Status visitLeaf(const Node& leaf, Visit&& visit) {
      std::uint32_t page = leaf.page;
      std::uint32_t first = leaf.first;
      for (std::uint64_t left = leaf.surfel_count; left > 0; ++page, first = 0) {
        SURFEIT_ASSIGN_OR_RETURN(const std::span<const Surfel> run, surfels(page, first, left));
        visit(run);
        left -= run.size();
      }
      return {};
    }

   private:
    struct State;
    std::unique_ptr<State> state_;
  };

 private:
  struct State;
  explicit PagedOctree(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace surfeit
