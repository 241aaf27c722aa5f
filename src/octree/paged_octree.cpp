#include "octree/paged_octree.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>

#include "core/assert.h"

namespace surfeit {
namespace {

// A frame: how many records, then the records.
//   [ count : 4 | padding : 60 | records ... ]
constexpr std::size_t kFrameHeaderBytes = 64;

// Pages a thread holds in front of each cache: the knee of the measured curve.
constexpr std::size_t kFrontSlots = 64;
// Fewest frames that let one thread hold a page, and load another.
constexpr std::size_t kMinFramesPerThread = 2;

// zstd's decompression context.
constexpr std::size_t kDecoderBytes = 160 << 10;

std::size_t nodeFrameBytes(const SceneHeader& header) {
  return kFrameHeaderBytes + header.node_group_capacity * sizeof(Node);
}

std::size_t surfelFrameBytes(const SceneHeader& header) {
  return kFrameHeaderBytes + header.surfel_group_capacity * sizeof(Surfel);
}

PageCache::Options nodeOptions(const SceneFile& file, std::size_t frames) {
  return {file.nodePageCount(), nodeFrameBytes(file.header()), frames};
}

PageCache::Options surfelOptions(const SceneFile& file, std::size_t frames) {
  return {file.surfelPageCount(), surfelFrameBytes(file.header()), frames};
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

// The records of a loaded frame.
template <typename Record>
std::span<const Record> recordsOf(const std::byte* frame) {
  std::uint32_t count = 0;
  std::memcpy(&count, frame, sizeof count);
  return {reinterpret_cast<const Record*>(frame + kFrameHeaderBytes), count};
}

// The record array of a frame being filled.
template <typename Record>
std::span<Record> writableRecords(std::span<std::byte> frame) {
  return {reinterpret_cast<Record*>(frame.data() + kFrameHeaderBytes),
          (frame.size() - kFrameHeaderBytes) / sizeof(Record)};
}

// Finishes a load: the count goes into the frame, the bytes read to the cache's counters.
Result<std::uint64_t> finishLoad(const Result<std::uint32_t>& count, std::span<std::byte> frame,
                                 std::uint32_t stored_bytes) {
  if (!count.ok()) return count.status();
  std::memcpy(frame.data(), &*count, sizeof(std::uint32_t));
  return std::uint64_t{stored_bytes};
}

SceneFile::Scratch& threadScratch() {
  thread_local SceneFile::Scratch scratch;
  return scratch;
}

}  // namespace

struct PagedOctree::State {
  explicit State(SceneFile scene) : file(std::move(scene)) {}
  SceneFile file;
  Memory memory;
  std::unique_ptr<PageCache> nodes, surfels;
};

struct PagedOctree::Reader::State {
  explicit State(PagedOctree::State& octree)
      : file(octree.file),
        nodes(*octree.nodes, octree.memory.front_slots),
        surfels(*octree.surfels, octree.memory.front_slots) {}
  const SceneFile& file;
  CacheFront nodes, surfels;
};

std::size_t PagedOctree::fixedBytes(const SceneFile& file, int threads) {
  const PageFile& pages = file.pages();
  const std::size_t per_thread = pages.maxStoredBytes() + pages.maxPayloadBytes() + kDecoderBytes;
  return pages.pageCount() * sizeof(PageEntry) + static_cast<std::size_t>(threads) * per_thread;
}

std::size_t PagedOctree::unlimitedCacheBytes(const SceneFile& file) {
  return PageCache::memoryBytes(nodeOptions(file, file.nodePageCount())) +
         PageCache::memoryBytes(surfelOptions(file, file.surfelPageCount()));
}

Result<PagedOctree::Memory> PagedOctree::planMemory(const SceneFile& file, std::size_t cache_bytes,
                                                    int threads) {
  const std::size_t all_nodes = PageCache::memoryBytes(nodeOptions(file, file.nodePageCount()));
  const std::size_t all_surfels =
      PageCache::memoryBytes(surfelOptions(file, file.surfelPageCount()));

  // Half each, and what one cannot use goes to the other
  const std::size_t half = cache_bytes / 2;
  const std::size_t node_bytes =
      std::min(all_nodes, std::max(half, cache_bytes - std::min(all_surfels, cache_bytes)));
  const std::size_t surfel_bytes =
      std::min(all_surfels, cache_bytes - std::min(node_bytes, cache_bytes));
  Memory memory;
  memory.node_frames = framesWithin(nodeOptions(file, 0), node_bytes);
  memory.surfel_frames = framesWithin(surfelOptions(file, 0), surfel_bytes);

  // Every thread must be able to hold one page and load another; a cache that holds all pages
  // needs no more than those
  const auto least = [&](std::uint32_t pages) {
    return std::min<std::size_t>(pages, kMinFramesPerThread * static_cast<std::size_t>(threads));
  };
  const std::size_t least_nodes = least(file.nodePageCount());
  const std::size_t least_surfels = least(file.surfelPageCount());
  if (memory.node_frames < least_nodes || memory.surfel_frames < least_surfels) {
    const std::size_t needed =
        2 * std::max(PageCache::memoryBytes(nodeOptions(file, least_nodes)),
                     PageCache::memoryBytes(surfelOptions(file, least_surfels)));
    return Status::budgetTooSmall(
        fmt::format("{}: {} bytes for the caches of {} threads, expected at least {}", file.path(),
                    cache_bytes, threads, needed));
  }

  // At most half of each cache may be pinned by fronts, so that LRU keeps something to choose from
  const auto slots = [&](std::size_t frames, std::uint32_t pages) {
    return frames >= pages ? kFrontSlots : frames / (2 * static_cast<std::size_t>(threads));
  };
  memory.front_slots =
      std::clamp<std::size_t>(std::min(slots(memory.node_frames, file.nodePageCount()),
                                       slots(memory.surfel_frames, file.surfelPageCount())),
                              1, kFrontSlots);
  return memory;
}

Result<std::unique_ptr<PagedOctree>> PagedOctree::create(SceneFile file, const Memory& memory) {
  auto state = std::make_unique<State>(std::move(file));
  state->memory = memory;
  const SceneFile& scene = state->file;
  SURFEIT_ASSIGN_OR_RETURN(state->nodes,
                           PageCache::create(nodeOptions(scene, memory.node_frames),
                                             [&scene](PageNumber page, std::span<std::byte> frame) {
                                               return finishLoad(
                                                   scene.decodeNodes(page, threadScratch(),
                                                                     writableRecords<Node>(frame)),
                                                   frame, scene.nodePageBytes(page));
                                             }));
  SURFEIT_ASSIGN_OR_RETURN(
      state->surfels, PageCache::create(surfelOptions(scene, memory.surfel_frames),
                                        [&scene](PageNumber page, std::span<std::byte> frame) {
                                          return finishLoad(
                                              scene.decodeSurfels(page, threadScratch(),
                                                                  writableRecords<Surfel>(frame)),
                                              frame, scene.surfelPageBytes(page));
                                        }));
  return std::unique_ptr<PagedOctree>(new PagedOctree(std::move(state)));
}

PagedOctree::PagedOctree(std::unique_ptr<State> state) : state_(std::move(state)) {}
PagedOctree::~PagedOctree() = default;

const SceneFile& PagedOctree::file() const { return state_->file; }
CacheCounters PagedOctree::nodeCounters() const { return state_->nodes->counters(); }
CacheCounters PagedOctree::surfelCounters() const { return state_->surfels->counters(); }

PagedOctree::Reader::Reader(PagedOctree& octree)
    : state_(std::make_unique<State>(*octree.state_)) {}
PagedOctree::Reader::~Reader() = default;

Status PagedOctree::Reader::checkVisits(std::uint64_t nodes, std::uint64_t surfels) const {
  const SceneHeader& header = state_->file.header();
  if (nodes <= header.node_count && surfels <= header.surfel_count) return {};
  return Status::corruption(fmt::format(
      "{}: a traversal met more than its {} nodes and {} surfels: references form no tree",
      state_->file.path(), header.node_count, header.surfel_count));
}

Result<std::span<const Node>> PagedOctree::Reader::nodes(const NodeRange& range) {
  SURFEIT_ASSIGN_OR_RETURN(const std::byte* frame, state_->nodes.lookup(range.page));
  const std::span<const Node> nodes = recordsOf<Node>(frame);
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
  SURFEIT_ASSIGN_OR_RETURN(const std::byte* frame, state_->surfels.lookup(page));
  const std::span<const Surfel> surfels = recordsOf<Surfel>(frame);
  if (first >= surfels.size()) {
    return state_->file.pages().pageError(
        state_->file.nodePageCount() + page,
        fmt::format("surfel group: {} surfels, a reference needs number {}", surfels.size(),
                    first));
  }
  return surfels.subspan(first, std::min<std::uint64_t>(count, surfels.size() - first));
}

}  // namespace surfeit
