// The octree of a .sft file, read on demand through two caches: one for node groups, one for
// surfel groups (memo, section 4).
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "cache/cache_counters.h"
#include "cache/cache_front.h"
#include "cache/reuse_distances.h"
#include "core/bounds.h"
#include "octree/node/lobe.h"
#include "octree/node/node.h"
#include "octree/read/octree_caches.h"
#include "octree/read/scene_file.h"
#include "surfeit/status.h"
#include "surfeit/surfel.h"

namespace surfeit {

// Where the surfels of a large leaf lie: it may hold a whole cloud when a stray is far away.
// Spheres around the positions of each page's part, a run, around each eight of these, and so on up
// to one.
struct LeafRuns {
  static constexpr std::size_t kFanOut = 8;
  struct Sphere {
    glm::vec3 position{0};
    float radius = 0;
  };
  std::vector<std::uint32_t> surfels;       // of each run
  std::vector<std::vector<Sphere>> levels;  // runs first
};

// Open file, directory and caches. Readers on several threads share one of these.
class PagedOctree {
 public:
  // How a memory budget is spent; see planMemory.
  struct Memory {
    std::size_t node_frames = 0;
    std::size_t surfel_frames = 0;
    std::size_t least_node_frames = 0;  // that the threads need; resident pages included
    std::size_t least_surfel_frames = 0;
    std::size_t front_slots = 0;         // per thread and cache
    PageNumber resident_node_pages = 0;  // upper levels, which every traversal visits
    std::size_t tracked_pages = 0;       // sampled for reuse distances, per cache; 0: none
  };
  // Node frames for half of the bytes.
  static constexpr double kEvenSplit = 0.5;

  // Frames that `threads` readers need of a cache for so many pages: each holds one, and loads one.
  static std::size_t leastFrames(std::size_t pages, int threads);
  // Pages that each of `threads` readers holds in front of a cache: at most half of its frames in
  // all, so that least-recently-used keeps something to choose from.
  static std::size_t frontSlots(std::size_t frames, std::size_t pages, int threads);

  // Bytes that opening the file takes beside the caches: directory and decode buffers of `threads`.
  static std::size_t fixedBytes(const SceneFile& file, int threads);
  // Splits `cache_bytes` between the two caches of a file that `threads` readers use: everything
  // when it fits, else `node_share` of it (0..1) to nodes, with what one cannot use given to the
  // other and never less than the threads need. kBudgetTooSmall, naming the bytes that would do,
  // when a reader could not hold the pages of one traversal step.
  static Result<Memory> planMemory(const SceneFile& file, std::size_t cache_bytes, int threads,
                                   double node_share = kEvenSplit);
  // The fewest cache bytes that planMemory accepts.
  static std::size_t leastCacheBytes(const SceneFile& file, int threads);
  // Cache bytes that hold the whole file decoded.
  static std::size_t unlimitedCacheBytes(const SceneFile& file);
  // Bytes that a page of either kind takes in its cache.
  static std::size_t nodeFrameBytes(const SceneFile& file);
  static std::size_t surfelFrameBytes(const SceneFile& file);

  // With caches of its own.
  static Result<std::unique_ptr<PagedOctree>> create(SceneFile file, const Memory& memory);
  // In caches that it shares with other scenes. Errors: as OctreeCaches::attach.
  static Result<std::unique_ptr<PagedOctree>> share(SceneFile file,
                                                    std::shared_ptr<OctreeCaches> caches);
  // No reader of it may be left. Caches of its own must not be used any more.
  ~PagedOctree();

  const SceneFile& file() const;
  const Memory& memory() const;  // as at first, of caches of its own
  OctreeCaches& caches();
  std::shared_ptr<OctreeCaches> sharedCaches();
  PageCache& nodeCache();
  PageCache& surfelCache();
  // How pages are reused; null unless memory().tracked_pages > 0. Look-ups of resident pages and
  // those that fronts answer are not seen.
  ReuseDistances* nodeDistances();
  ReuseDistances* surfelDistances();

  // A thread's way into the octree. One thread at a time; must go before the octree does. Threads
  // wait for no frame while they hold one that another waits for, however few frames there are; a
  // thread that pauses must release().
  class Reader {
   public:
    explicit Reader(PagedOctree& octree);
    // For the scenes of these caches; holds up to `slots` pages of each kind. use() comes first.
    Reader(OctreeCaches& caches, std::size_t slots,
           CacheFront::Role role = CacheFront::Role::kRequests);
    ~Reader();

    // Reads another scene of the same caches from now on.
    void use(const PagedOctree& octree);
    const SceneFile& file() const;

    // Lets go of all pages.
    void release();

    // kCorruption when a traversal has met more nodes or surfels than the file holds: references
    // that share or repeat what lies below, which would make it endless for all practical purposes.
    Status checkVisits(std::uint64_t nodes, std::uint64_t surfels) const;

    // The siblings of a range. Valid until the next call of nodes() on this reader; surfels() does
    // not invalidate it, but nodes() may invalidate surfels. kCorruption when a page does not
    // decode.
    Result<std::span<const Node>> nodes(const NodeRange& range);

    // Up to `count` surfels from index `first` of a surfel page: fewer when the page ends before.
    // Never empty when ok. Valid until the next call of surfels() or nodes() on this reader.
    Result<std::span<const Surfel>> surfels(std::uint32_t page, std::uint32_t first,
                                            std::uint64_t count);

    // The lobes of a node or of surfels that the last call of nodes() or surfels() gave, as long as
    // these are valid. None in a scene without lobes, and none of other records.
    const NodeLobes* lobesOf(const Node& node) const;
    std::span<const Lobe> lobesOf(std::span<const Surfel> surfels) const;

    // Calls visit(std::span<const Surfel>) for the surfels of a leaf, page by page, in curve order.
    // It returns nothing, or a Status, whose failure ends the visit.
    template <typename Visit>
    Status visitLeaf(const Node& leaf, Visit&& visit) {
      return visitSurfels(surfelsOf(leaf), visit);
    }
    template <typename Visit>
    Status visitSurfels(LeafRange leaf, Visit&& visit) {
      auto& [page, first, count] = leaf;
      for (; count > 0; ++page, first = 0) {
        SURFEIT_ASSIGN_OR_RETURN(const std::span<const Surfel> run, surfels(page, first, count));
        if constexpr (std::is_void_v<decltype(visit(run))>) {
          visit(run);
        } else {
          SURFEIT_RETURN_IF_ERROR(visit(run));
        }
        count -= run.size();
      }
      return {};
    }

    // The runs of a leaf, found when they are first asked for; the octree's readers share them.
    // Invalidates what the other calls returned.
    Result<std::shared_ptr<const LeafRuns>> leafRuns(const LeafRange& leaf);

   private:
    struct State;
    std::unique_ptr<State> state_;
  };

  // Most bytes that leafRuns keeps: of a scene whose leaves are all large.
  static std::uint64_t leafRunBytes(const SceneFile& file);

 private:
  struct State;
  explicit PagedOctree(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace surfeit
