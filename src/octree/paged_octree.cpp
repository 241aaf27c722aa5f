#include "octree/paged_octree.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <utility>

#include "core/thread_scratch.h"

namespace surfeit {
namespace {

// Pages a thread holds in front of each cache: the knee of the measured curve.
constexpr std::size_t kFrontSlots = 64;
// Fewest frames that let one thread hold a page, and load another.
constexpr std::size_t kMinFramesPerThread = 2;
// Upper levels stay resident while they take no more than this part of the node cache, and no more
// pages than are read in the blink of an eye.
constexpr std::size_t kResidentPart = 8;
constexpr std::size_t kMostResidentPages = 512;

// zstd's decompression context.
constexpr std::size_t kDecoderBytes = 160 << 10;

PageCache::Options nodeOptions(const SceneFile& file, std::size_t frames) {
  return {file.nodePageCount(), file.header().node_group_capacity * sizeof(Node), frames};
}

PageCache::Options surfelOptions(const SceneFile& file, std::size_t frames) {
  return {file.surfelPageCount(), file.header().surfel_group_capacity * sizeof(Surfel), frames};
}

// Frames that `threads` readers need of a cache.
std::size_t leastFrames(std::uint32_t pages, int threads) {
  return std::min<std::size_t>(pages, kMinFramesPerThread * static_cast<std::size_t>(threads));
}

// Frames that fit into `bytes` beside the tables, at most one per page.
std::size_t framesWithin(PageCache::Options options, std::size_t bytes) {
  std::size_t low = 0, high = options.page_count;
  while (low < high) {
    options.frame_count = low + (high - low + 1) / 2;
    if (PageCache::memoryBytes(options) <= bytes) {
      low = options.frame_count;
    } else {
      high = options.frame_count - 1;
    }
  }
  return low;
}

// The records of a page.
template <typename Record>
std::span<const Record> recordsOf(std::span<const std::byte> page) {
  return {reinterpret_cast<const Record*>(page.data()), page.size() / sizeof(Record)};
}

// The record array of a frame being filled.
template <typename Record>
std::span<Record> writableRecords(std::span<std::byte> frame) {
  return {reinterpret_cast<Record*>(frame.data()), frame.size() / sizeof(Record)};
}

template <typename Record>
Result<PageCache::Loaded> loaded(const Result<std::uint32_t>& count, std::uint32_t stored_bytes) {
  if (!count.ok()) return count.status();
  return PageCache::Loaded{stored_bytes, static_cast<std::uint32_t>(*count * sizeof(Record))};
}

// Pages of whole levels that may stay resident in so many frames.
PageNumber residentPages(const SceneHeader& header, std::size_t frames) {
  const std::size_t most = std::min(frames / kResidentPart, kMostResidentPages);
  PageNumber pages = 0;
  for (const std::uint32_t end : header.level_first_page) {
    if (end <= most) pages = std::max(pages, end);
  }
  return pages;
}

SceneFile::Scratch& decodeScratch() {
  return threadScratch<SceneFile::Scratch>([] {});
}

}  // namespace

struct PagedOctree::State {
  explicit State(SceneFile scene) : file(std::move(scene)) {}
  SceneFile file;
  Memory memory;
  std::optional<ReuseDistances> node_distances, surfel_distances;
  std::unique_ptr<PageCache> nodes, surfels;
};

struct PagedOctree::Reader::State {
  State(PagedOctree::State& octree, CacheFront::Role role)
      : file(octree.file),
        nodes(*octree.nodes, slotsOf(octree, role), role),
        surfels(*octree.surfels, slotsOf(octree, role), role) {
    nodes.yieldTo(surfels);
  }
  // One that prefetches has no use for a page but to see it loaded.
  static std::size_t slotsOf(const PagedOctree::State& octree, CacheFront::Role role) {
    return role == CacheFront::Role::kPrefetch ? 1 : octree.memory.front_slots;
  }
  const SceneFile& file;
  CacheFront nodes, surfels;
};

std::size_t PagedOctree::fixedBytes(const SceneFile& file, int threads) {
  const PageFile& pages = file.pages();
  const std::size_t per_thread =
      pages.maxStoredBytes() + 2 * kDirectAlignment + pages.maxPayloadBytes() + kDecoderBytes;
  return pages.pageCount() * sizeof(PageEntry) + static_cast<std::size_t>(threads) * per_thread;
}

std::size_t PagedOctree::unlimitedCacheBytes(const SceneFile& file) {
  return PageCache::memoryBytes(nodeOptions(file, file.nodePageCount())) +
         PageCache::memoryBytes(surfelOptions(file, file.surfelPageCount()));
}

std::size_t PagedOctree::leastCacheBytes(const SceneFile& file, int threads) {
  return PageCache::memoryBytes(nodeOptions(file, leastFrames(file.nodePageCount(), threads))) +
         PageCache::memoryBytes(surfelOptions(file, leastFrames(file.surfelPageCount(), threads)));
}

std::size_t PagedOctree::nodeFrameBytes(const SceneFile& file) {
  return PageCache::frameBytes(nodeOptions(file, 0).frame_bytes);
}

std::size_t PagedOctree::surfelFrameBytes(const SceneFile& file) {
  return PageCache::frameBytes(surfelOptions(file, 0).frame_bytes);
}

Result<PagedOctree::Memory> PagedOctree::planMemory(const SceneFile& file, std::size_t cache_bytes,
                                                    int threads, double node_share) {
  const std::size_t needed = leastCacheBytes(file, threads);
  if (cache_bytes < needed) {
    return Status::budgetTooSmall(
        fmt::format("{}: {} bytes for the caches of {} threads, expected at least {}", file.path(),
                    cache_bytes, threads, needed));
  }
  const std::uint32_t node_pages = file.nodePageCount(), surfel_pages = file.surfelPageCount();
  const std::size_t all_nodes = PageCache::memoryBytes(nodeOptions(file, node_pages));
  const std::size_t all_surfels = PageCache::memoryBytes(surfelOptions(file, surfel_pages));
  const std::size_t least_nodes =
      PageCache::memoryBytes(nodeOptions(file, leastFrames(node_pages, threads)));
  const std::size_t least_surfels =
      PageCache::memoryBytes(surfelOptions(file, leastFrames(surfel_pages, threads)));

  // The share, and what the surfels cannot use, but not what they cannot do without
  std::size_t node_bytes = static_cast<std::size_t>(double(cache_bytes) * node_share);
  node_bytes = std::max(node_bytes, cache_bytes - std::min(all_surfels, cache_bytes));
  node_bytes =
      std::clamp(node_bytes, least_nodes, std::min(all_nodes, cache_bytes - least_surfels));
  const std::size_t surfel_bytes = std::min(all_surfels, cache_bytes - node_bytes);
  Memory memory;
  memory.node_frames = framesWithin(nodeOptions(file, 0), node_bytes);
  memory.surfel_frames = framesWithin(surfelOptions(file, 0), surfel_bytes);

  // At most half of each cache may be pinned by fronts, so that LRU keeps something to choose from
  const auto slots = [&](std::size_t frames, std::uint32_t pages) {
    return frames >= pages ? kFrontSlots : frames / (2 * static_cast<std::size_t>(threads));
  };
  memory.front_slots = std::clamp<std::size_t>(
      std::min(slots(memory.node_frames, node_pages), slots(memory.surfel_frames, surfel_pages)), 1,
      kFrontSlots);
  memory.resident_node_pages = residentPages(file.header(), memory.node_frames);
  // What fronts pin, once more for LRU, and what is always there
  const std::size_t pinned = 2 * memory.front_slots * static_cast<std::size_t>(threads);
  memory.least_node_frames =
      std::min<std::size_t>(memory.node_frames, pinned + memory.resident_node_pages);
  memory.least_surfel_frames = std::min<std::size_t>(memory.surfel_frames, pinned);
  return memory;
}

Result<std::unique_ptr<PagedOctree>> PagedOctree::create(SceneFile file, const Memory& memory) {
  auto state = std::make_unique<State>(std::move(file));
  state->memory = memory;
  const SceneFile& scene = state->file;
  PageCache::Options nodes = nodeOptions(scene, memory.node_frames);
  PageCache::Options surfels = surfelOptions(scene, memory.surfel_frames);
  // Frames may move from one cache to the other: address space for as many as both have
  const std::size_t bytes =
      memory.node_frames * nodeFrameBytes(scene) + memory.surfel_frames * surfelFrameBytes(scene);
  nodes.most_frames = bytes / nodeFrameBytes(scene);
  surfels.most_frames = bytes / surfelFrameBytes(scene);
  if (memory.tracked_pages > 0) {
    nodes.reuse_distances = &state->node_distances.emplace(nodes.page_count, memory.tracked_pages);
    surfels.reuse_distances =
        &state->surfel_distances.emplace(surfels.page_count, memory.tracked_pages);
  }
  SURFEIT_ASSIGN_OR_RETURN(
      state->nodes, PageCache::create(nodes, [&scene](PageNumber page, std::span<std::byte> frame) {
        return loaded<Node>(scene.decodeNodes(page, decodeScratch(), writableRecords<Node>(frame)),
                            scene.nodePageBytes(page));
      }));
  SURFEIT_ASSIGN_OR_RETURN(
      state->surfels,
      PageCache::create(surfels, [&scene](PageNumber page, std::span<std::byte> frame) {
        return loaded<Surfel>(
            scene.decodeSurfels(page, decodeScratch(), writableRecords<Surfel>(frame)),
            scene.surfelPageBytes(page));
      }));
  SURFEIT_RETURN_IF_ERROR(state->nodes->keepResident(memory.resident_node_pages));
  return std::unique_ptr<PagedOctree>(new PagedOctree(std::move(state)));
}

PagedOctree::PagedOctree(std::unique_ptr<State> state) : state_(std::move(state)) {}
PagedOctree::~PagedOctree() = default;

const SceneFile& PagedOctree::file() const { return state_->file; }
const PagedOctree::Memory& PagedOctree::memory() const { return state_->memory; }
PageCache& PagedOctree::nodeCache() { return *state_->nodes; }
PageCache& PagedOctree::surfelCache() { return *state_->surfels; }
ReuseDistances* PagedOctree::nodeDistances() {
  return state_->node_distances ? &*state_->node_distances : nullptr;
}
ReuseDistances* PagedOctree::surfelDistances() {
  return state_->surfel_distances ? &*state_->surfel_distances : nullptr;
}

PagedOctree::Reader::Reader(PagedOctree& octree, CacheFront::Role role)
    : state_(std::make_unique<State>(*octree.state_, role)) {}
PagedOctree::Reader::~Reader() = default;

const SceneFile& PagedOctree::Reader::file() const { return state_->file; }

void PagedOctree::Reader::release() {
  state_->nodes.release();
  state_->surfels.release();
}

Status PagedOctree::Reader::checkVisits(std::uint64_t nodes, std::uint64_t surfels) const {
  const SceneHeader& header = state_->file.header();
  if (nodes <= header.node_count && surfels <= header.surfel_count) return {};
  return Status::corruption(fmt::format(
      "{}: a traversal met more than its {} nodes and {} surfels: references form no tree",
      state_->file.path(), header.node_count, header.surfel_count));
}

Result<std::span<const Node>> PagedOctree::Reader::nodes(const NodeRange& range) {
  SURFEIT_ASSIGN_OR_RETURN(const std::span<const std::byte> data, state_->nodes.lookup(range.page));
  const std::span<const Node> nodes = recordsOf<Node>(data);
  // A page decodes on its own; what points into it was checked against the capacity only
  if (std::size_t{range.first} + range.count > nodes.size()) {
    return state_->file.pages().pageError(
        range.page, fmt::format("node group: {} nodes, a reference needs {}", nodes.size(),
                                range.first + range.count));
  }
  return nodes.subspan(range.first, range.count);
}

Result<std::span<const Surfel>> PagedOctree::Reader::surfels(std::uint32_t page,
                                                             std::uint32_t first,
                                                             std::uint64_t count) {
  SURFEIT_ASSIGN_OR_RETURN(const std::span<const std::byte> data, state_->surfels.lookup(page));
  const std::span<const Surfel> surfels = recordsOf<Surfel>(data);
  if (first >= surfels.size()) {
    return state_->file.pages().pageError(
        state_->file.nodePageCount() + page,
        fmt::format("surfel group: {} surfels, a reference needs number {}", surfels.size(),
                    first));
  }
  return surfels.subspan(first, std::min<std::uint64_t>(count, surfels.size() - first));
}

}  // namespace surfeit
