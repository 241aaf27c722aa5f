#include "octree/read/paged_octree.h"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <glm/geometric.hpp>
#include <map>
#include <mutex>
#include <optional>
#include <utility>

namespace surfeit {
namespace {

// Pages a thread holds in front of each cache: the knee of the measured curve.
constexpr std::size_t kFrontSlots = 64;
// Frames that let one thread hold a page, and load another.
constexpr std::size_t kMinFramesPerThread = 2;
// Upper levels stay resident while they take no more than this part of the node cache, and no more
// pages than are read in the blink of an eye.
constexpr std::size_t kResidentPart = 8;
constexpr std::size_t kMostResidentPages = 512;

// zstd's decompression context.
constexpr std::size_t kDecoderBytes = 160 << 10;

PageCache::Options nodeOptions(const SceneFile& file, std::size_t frames) {
  return {file.nodePageCount(), file.nodePageCapacityBytes(), frames};
}

PageCache::Options surfelOptions(const SceneFile& file, std::size_t frames) {
  return {file.surfelPageCount(), file.surfelPageCapacityBytes(), frames};
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

// Of a scene with lobes, the records of a page and the lobes behind them.
template <typename Record, typename RecordLobe>
struct LobedRecords {
  std::span<const Record> records;
  const RecordLobe* lobes = nullptr;

  LobedRecords() = default;
  explicit LobedRecords(std::span<const std::byte> page) {
    const std::size_t count = page.size() / (sizeof(Record) + sizeof(RecordLobe));
    records = {reinterpret_cast<const Record*>(page.data()), count};
    lobes = reinterpret_cast<const RecordLobe*>(page.data() + count * sizeof(Record));
  }
  // Null for what is no record of it.
  const RecordLobe* of(const Record* record) const {
    const std::less<> before;
    if (records.empty() || before(record, records.data())) return nullptr;
    if (!before(record, records.data() + records.size())) return nullptr;
    return lobes + (record - records.data());
  }
};

Status noSuchPage(PageNumber page, std::uint32_t pages) {
  return Status::corruption(
      fmt::format("page {} does not exist: expected less than {}", page, pages));
}

// A sphere around a box, and rounding.
LeafRuns::Sphere sphereAround(const Bounds3& box) {
  return {box.centre(), 0.5f * glm::length(box.extent()) * 1.00001f};
}

// Spheres around spheres, until there is one.
void addUpperLevels(LeafRuns& runs) {
  while (runs.levels.back().size() > 1) {
    const std::vector<LeafRuns::Sphere>& lower = runs.levels.back();
    std::vector<LeafRuns::Sphere> upper;
    for (std::size_t begin = 0; begin < lower.size(); begin += LeafRuns::kFanOut) {
      Bounds3 box;
      for (std::size_t i = begin; i < std::min(begin + LeafRuns::kFanOut, lower.size()); ++i) {
        box.add(lower[i].position - lower[i].radius);
        box.add(lower[i].position + lower[i].radius);
      }
      upper.push_back(sphereAround(box));
    }
    runs.levels.push_back(std::move(upper));
  }
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

}  // namespace

struct PagedOctree::State {
  State(SceneFile scene, std::shared_ptr<OctreeCaches> shared)
      : file(std::move(scene)), caches(std::move(shared)) {}
  SceneFile file;
  std::shared_ptr<OctreeCaches> caches;
  OctreeCaches::Place place;
  bool has_own_caches = false;
  Memory memory;
  std::mutex runs_mutex;                                          // guards runs
  std::map<std::uint64_t, std::shared_ptr<const LeafRuns>> runs;  // by the leaf's first surfel
};

struct PagedOctree::Reader::State {
  State(OctreeCaches& caches, std::size_t slots, CacheFront::Role role)
      : nodes(caches.nodes(), slots, role), surfels(caches.surfels(), slots, role) {
    nodes.yieldTo(surfels);
  }
  const SceneFile* file = nullptr;
  PagedOctree::State* octree = nullptr;
  OctreeCaches::Place place;
  std::uint32_t node_pages = 0, surfel_pages = 0;
  // The runs that were asked for last
  std::uint64_t last_leaf = 0;
  std::shared_ptr<const LeafRuns> last_runs;
  CacheFront nodes, surfels;
  // Of the pages that were looked up last, in scenes with lobes
  bool has_lobes = false;
  LobedRecords<Node, NodeLobes> lobed_nodes;
  LobedRecords<Surfel, Lobe> lobed_surfels;
};

std::size_t PagedOctree::leastFrames(std::size_t pages, int threads) {
  return std::min(pages, kMinFramesPerThread * static_cast<std::size_t>(threads));
}

std::size_t PagedOctree::frontSlots(std::size_t frames, std::size_t pages, int threads) {
  if (frames >= pages) return kFrontSlots;
  return std::clamp<std::size_t>(frames / (2 * static_cast<std::size_t>(threads)), 1, kFrontSlots);
}

std::size_t PagedOctree::fixedBytes(const SceneFile& file, int threads) {
  const PageFile& pages = file.pages();
  const std::size_t lobes =
      file.header().has_lobes ? file.nodePageCapacityBytes() + file.surfelPageCapacityBytes() : 0;
  const std::size_t per_thread = pages.maxStoredBytes() + 2 * kDirectAlignment +
                                 pages.maxPayloadBytes() + kDecoderBytes + lobes;
  return pages.memoryBytes() + static_cast<std::size_t>(threads) * per_thread;
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

  memory.front_slots = std::min(frontSlots(memory.node_frames, node_pages, threads),
                                frontSlots(memory.surfel_frames, surfel_pages, threads));
  memory.resident_node_pages = residentPages(file.header(), memory.node_frames);
  // What fronts pin, once more for LRU, and what is always there
  const std::size_t pinned = 2 * memory.front_slots * static_cast<std::size_t>(threads);
  memory.least_node_frames =
      std::min<std::size_t>(memory.node_frames, pinned + memory.resident_node_pages);
  memory.least_surfel_frames = std::min<std::size_t>(memory.surfel_frames, pinned);
  return memory;
}

Result<std::unique_ptr<PagedOctree>> PagedOctree::create(SceneFile file, const Memory& memory) {
  SURFEIT_ASSIGN_OR_RETURN(
      std::shared_ptr<OctreeCaches> caches,
      OctreeCaches::create({.node_page_bytes = file.nodePageCapacityBytes(),
                            .surfel_page_bytes = file.surfelPageCapacityBytes(),
                            .node_pages = file.nodePageCount(),
                            .surfel_pages = file.surfelPageCount(),
                            .node_frames = memory.node_frames,
                            .surfel_frames = memory.surfel_frames,
                            .tracked_pages = memory.tracked_pages}));
  SURFEIT_ASSIGN_OR_RETURN(std::unique_ptr<PagedOctree> octree,
                           share(std::move(file), std::move(caches)));
  octree->state_->memory = memory;
  octree->state_->has_own_caches = true;
  SURFEIT_RETURN_IF_ERROR(octree->nodeCache().keepResident(memory.resident_node_pages));
  return octree;
}

Result<std::unique_ptr<PagedOctree>> PagedOctree::share(SceneFile file,
                                                        std::shared_ptr<OctreeCaches> caches) {
  auto state = std::make_unique<State>(std::move(file), std::move(caches));
  SURFEIT_ASSIGN_OR_RETURN(state->place, state->caches->attach(state->file));
  return std::unique_ptr<PagedOctree>(new PagedOctree(std::move(state)));
}

PagedOctree::PagedOctree(std::unique_ptr<State> state) : state_(std::move(state)) {}
PagedOctree::~PagedOctree() {
  // Caches that nobody uses any more need not forget it, and their upper pages are resident
  if (!state_->has_own_caches) state_->caches->detach(state_->place);
}

const SceneFile& PagedOctree::file() const { return state_->file; }
const PagedOctree::Memory& PagedOctree::memory() const { return state_->memory; }
OctreeCaches& PagedOctree::caches() { return *state_->caches; }
std::shared_ptr<OctreeCaches> PagedOctree::sharedCaches() { return state_->caches; }
PageCache& PagedOctree::nodeCache() { return state_->caches->nodes(); }
PageCache& PagedOctree::surfelCache() { return state_->caches->surfels(); }
ReuseDistances* PagedOctree::nodeDistances() { return state_->caches->nodeDistances(); }
ReuseDistances* PagedOctree::surfelDistances() { return state_->caches->surfelDistances(); }

PagedOctree::Reader::Reader(PagedOctree& octree)
    : Reader(octree.caches(), octree.state_->memory.front_slots) {
  use(octree);
}

PagedOctree::Reader::Reader(OctreeCaches& caches, std::size_t slots, CacheFront::Role role)
    : state_(std::make_unique<State>(caches, slots, role)) {}
PagedOctree::Reader::~Reader() = default;

void PagedOctree::Reader::use(const PagedOctree& octree) {
  state_->file = &octree.state_->file;
  state_->octree = octree.state_.get();
  state_->last_runs = nullptr;
  state_->place = octree.state_->place;
  state_->node_pages = octree.state_->file.nodePageCount();
  state_->surfel_pages = octree.state_->file.surfelPageCount();
  state_->has_lobes = octree.state_->file.header().has_lobes;
  state_->lobed_nodes = {};
  state_->lobed_surfels = {};
}

const SceneFile& PagedOctree::Reader::file() const { return *state_->file; }

void PagedOctree::Reader::release() {
  state_->nodes.release();
  state_->surfels.release();
}

Status PagedOctree::Reader::checkVisits(std::uint64_t nodes, std::uint64_t surfels) const {
  const SceneHeader& header = state_->file->header();
  if (nodes <= header.node_count && surfels <= header.surfel_count) return {};
  return Status::corruption(fmt::format(
      "{}: a traversal met more than its {} nodes and {} surfels: references form no tree",
      state_->file->path(), header.node_count, header.surfel_count));
}

Result<std::span<const Node>> PagedOctree::Reader::nodes(const NodeRange& range) {
  if (range.page >= state_->node_pages) return noSuchPage(range.page, state_->node_pages);
  SURFEIT_ASSIGN_OR_RETURN(const std::span<const std::byte> data,
                           state_->nodes.lookup(state_->place.first_node_page + range.page));
  std::span<const Node> nodes = recordsOf<Node>(data);
  if (state_->has_lobes) {
    state_->lobed_nodes = LobedRecords<Node, NodeLobes>(data);
    nodes = state_->lobed_nodes.records;
  }
  // A page decodes on its own; what points into it was checked against the capacity only
  if (std::size_t{range.first} + range.count > nodes.size()) {
    return state_->file->pages().pageError(
        range.page, fmt::format("node group: {} nodes, a reference needs {}", nodes.size(),
                                range.first + range.count));
  }
  return nodes.subspan(range.first, range.count);
}

Result<std::span<const Surfel>> PagedOctree::Reader::surfels(std::uint32_t page,
                                                             std::uint32_t first,
                                                             std::uint64_t count) {
  if (page >= state_->surfel_pages) return noSuchPage(page, state_->surfel_pages);
  SURFEIT_ASSIGN_OR_RETURN(const std::span<const std::byte> data,
                           state_->surfels.lookup(state_->place.first_surfel_page + page));
  std::span<const Surfel> surfels = recordsOf<Surfel>(data);
  if (state_->has_lobes) {
    state_->lobed_surfels = LobedRecords<Surfel, Lobe>(data);
    surfels = state_->lobed_surfels.records;
  }
  if (first >= surfels.size()) {
    return state_->file->pages().pageError(
        state_->file->nodePageCount() + page,
        fmt::format("surfel group: {} surfels, a reference needs number {}", surfels.size(),
                    first));
  }
  return surfels.subspan(first, std::min<std::uint64_t>(count, surfels.size() - first));
}

const NodeLobes* PagedOctree::Reader::lobesOf(const Node& node) const {
  return state_->has_lobes ? state_->lobed_nodes.of(&node) : nullptr;
}

std::span<const Lobe> PagedOctree::Reader::lobesOf(std::span<const Surfel> surfels) const {
  if (!state_->has_lobes || surfels.empty()) return {};
  const Lobe* const first = state_->lobed_surfels.of(surfels.data());
  return first != nullptr ? std::span(first, surfels.size()) : std::span<const Lobe>();
}

Result<std::shared_ptr<const LeafRuns>> PagedOctree::Reader::leafRuns(const LeafRange& leaf) {
  const std::uint64_t key = std::uint64_t{leaf.page} << 32 | leaf.first;
  if (state_->last_runs != nullptr && state_->last_leaf == key) return state_->last_runs;
  // Who waits for the lock holds no page that its holder may be waiting for
  release();
  const std::lock_guard lock(state_->octree->runs_mutex);
  std::shared_ptr<const LeafRuns>& runs = state_->octree->runs[key];
  if (runs == nullptr) {
    auto found = std::make_shared<LeafRuns>();
    found->levels.emplace_back();
    SURFEIT_RETURN_IF_ERROR(visitSurfels(leaf, [&](std::span<const Surfel> surfels) {
      Bounds3 box;
      for (const Surfel& surfel : surfels) box.add(surfel.position);
      found->surfels.push_back(static_cast<std::uint32_t>(surfels.size()));
      found->levels.front().push_back(sphereAround(box));
    }));
    addUpperLevels(*found);
    runs = std::move(found);
  }
  state_->last_leaf = key;
  state_->last_runs = runs;
  return runs;
}

std::uint64_t PagedOctree::leafRunBytes(const SceneFile& file) {
  // An eighth more for each level
  return file.surfelPageCount() * (sizeof(std::uint32_t) + sizeof(LeafRuns::Sphere) * 8 / 7 + 1);
}

}  // namespace surfeit
