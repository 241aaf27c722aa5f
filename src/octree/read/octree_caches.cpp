#include "octree/read/octree_caches.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <utility>
#include <vector>

#include "core/thread_scratch.h"
#include "octree/node/node.h"
#include "surfeit/surfel.h"

namespace surfeit {
namespace {

// The record array of a frame being filled.
template <typename Record>
std::span<Record> writableRecords(std::span<std::byte> frame) {
  return {reinterpret_cast<Record*>(frame.data()), frame.size() / sizeof(Record)};
}

// Decodes a page of records into a frame, and behind them their lobes, where the scene has some:
// decode(records, lobes).
template <typename Record, typename RecordLobe, typename Decode>
Result<PageCache::Loaded> load(std::span<std::byte> frame, std::size_t capacity, bool has_lobes,
                               std::uint32_t stored_bytes, const Decode& decode) {
  std::vector<RecordLobe>& lobes = threadScratch<std::vector<RecordLobe>>([] {});
  lobes.resize(has_lobes ? capacity : 0);
  SURFEIT_ASSIGN_OR_RETURN(const std::uint32_t count,
                           decode(writableRecords<Record>(frame), std::span(lobes)));
  std::size_t bytes = count * sizeof(Record);
  if (has_lobes) {
    std::memcpy(frame.data() + bytes, lobes.data(), count * sizeof(RecordLobe));
    bytes += count * sizeof(RecordLobe);
  }
  return PageCache::Loaded{stored_bytes, static_cast<std::uint32_t>(bytes)};
}

SceneFile::Scratch& decodeScratch() {
  return threadScratch<SceneFile::Scratch>([] {});
}

Status checkPageSize(const SceneFile& file, const char* kind, std::size_t page_bytes,
                     std::size_t frame_bytes) {
  if (page_bytes <= frame_bytes) return {};
  return Status::invalidArgument(fmt::format(
      "{}: pages of {} decode to {} bytes, those of this engine hold {}{}", file.path(), kind,
      page_bytes, frame_bytes,
      file.header().has_lobes ? ": the scene has lobes, for which EngineOptions::lobes makes room"
                              : ""));
}

}  // namespace

std::optional<PageNumber> PageRanges::take(PageNumber count, const SceneFile* scene) {
  PageNumber first = 0;
  for (const auto& [begin, range] : ranges_) {
    if (begin - first >= count) break;
    first = begin + range.count;
  }
  if (capacity_ - first < count) return std::nullopt;
  ranges_.emplace(first, Range{count, scene});
  count_ += count;
  return first;
}

void PageRanges::giveBack(PageNumber first) {
  const auto found = ranges_.find(first);
  count_ -= found->second.count;
  ranges_.erase(found);
}

PageRanges::Owner PageRanges::ownerOf(PageNumber page) const {
  auto after = ranges_.upper_bound(page);
  if (after == ranges_.begin()) return {};
  --after;
  return {after->second.scene, after->first};
}

Result<std::unique_ptr<OctreeCaches>> OctreeCaches::create(const Options& options) {
  std::unique_ptr<OctreeCaches> caches(new OctreeCaches(options));
  OctreeCaches* const self = caches.get();
  const std::size_t node_bytes = caches->nodeFrameBytes();
  const std::size_t surfel_bytes = caches->surfelFrameBytes();
  const std::size_t most_bytes = options.most_bytes > 0 ? options.most_bytes
                                                        : options.node_frames * node_bytes +
                                                              options.surfel_frames * surfel_bytes;

  // Frames may move from one cache to the other: address space for as many as both have
  PageCache::Options nodes{.page_count = options.node_pages,
                           .frame_bytes = options.node_page_bytes,
                           .frame_count = options.node_frames,
                           .reuse_distances = caches->nodeDistances(),
                           .most_frames = most_bytes / node_bytes};
  SURFEIT_ASSIGN_OR_RETURN(
      caches->nodes_, PageCache::create(nodes, [self](PageNumber page, std::span<std::byte> frame) {
        const auto [scene, first] = self->nodeOwner(page);
        const SceneHeader& header = scene->header();
        return load<Node, NodeLobes>(
            frame, header.node_group_capacity, header.has_lobes, scene->nodePageBytes(page - first),
            [scene = scene, at = page - first](auto records, auto lobes) {
              return scene->decodeNodes(at, decodeScratch(), records, lobes);
            });
      }));
  PageCache::Options surfels{.page_count = options.surfel_pages,
                             .frame_bytes = options.surfel_page_bytes,
                             .frame_count = options.surfel_frames,
                             .reuse_distances = caches->surfelDistances(),
                             .most_frames = most_bytes / surfel_bytes};
  SURFEIT_ASSIGN_OR_RETURN(
      caches->surfels_,
      PageCache::create(surfels, [self](PageNumber page, std::span<std::byte> frame) {
        const auto [scene, first] = self->surfelOwner(page);
        const SceneHeader& header = scene->header();
        return load<Surfel, Lobe>(frame, header.surfel_group_capacity, header.has_lobes,
                                  scene->surfelPageBytes(page - first),
                                  [scene = scene, at = page - first](auto records, auto lobes) {
                                    return scene->decodeSurfels(at, decodeScratch(), records,
                                                                lobes);
                                  });
      }));
  return caches;
}

OctreeCaches::OctreeCaches(const Options& options)
    : options_(options), node_ranges_(options.node_pages), surfel_ranges_(options.surfel_pages) {
  if (options.tracked_pages == 0) return;
  node_distances_.emplace(options.node_pages, options.tracked_pages);
  surfel_distances_.emplace(options.surfel_pages, options.tracked_pages);
}

Result<OctreeCaches::Place> OctreeCaches::attach(const SceneFile& file) {
  SURFEIT_RETURN_IF_ERROR(
      checkPageSize(file, "nodes", file.nodePageCapacityBytes(), options_.node_page_bytes));
  SURFEIT_RETURN_IF_ERROR(
      checkPageSize(file, "surfels", file.surfelPageCapacityBytes(), options_.surfel_page_bytes));
  const std::unique_lock lock(mutex_);
  const std::optional<PageNumber> node_page = node_ranges_.take(file.nodePageCount(), &file);
  if (node_page) {
    if (const auto surfel_page = surfel_ranges_.take(file.surfelPageCount(), &file)) {
      return Place{*node_page, *surfel_page};
    }
    node_ranges_.giveBack(*node_page);
  }
  return Status::budgetTooSmall(
      fmt::format("{}: {} and {} pages, more than the numbers of this engine that are left",
                  file.path(), file.nodePageCount(), file.surfelPageCount()));
}

void OctreeCaches::detach(const Place& place) {
  const std::unique_lock lock(mutex_);
  nodes_->forget(place.first_node_page, node_ranges_.countOf(place.first_node_page));
  surfels_->forget(place.first_surfel_page, surfel_ranges_.countOf(place.first_surfel_page));
  node_ranges_.giveBack(place.first_node_page);
  surfel_ranges_.giveBack(place.first_surfel_page);
}

// The one that falls goes first.
void OctreeCaches::setFrameLimits(std::size_t nodes, std::size_t surfels) {
  const bool nodes_fall = nodes < nodes_->frameLimit();
  if (nodes_fall) nodes_->setFrameLimit(nodes);
  surfels_->setFrameLimit(surfels);
  if (!nodes_fall) nodes_->setFrameLimit(nodes);
}

PageNumber OctreeCaches::nodePages() const {
  const std::shared_lock lock(mutex_);
  return node_ranges_.count();
}

PageNumber OctreeCaches::surfelPages() const {
  const std::shared_lock lock(mutex_);
  return surfel_ranges_.count();
}

PageRanges::Owner OctreeCaches::nodeOwner(PageNumber page) const {
  const std::shared_lock lock(mutex_);
  return node_ranges_.ownerOf(page);
}

PageRanges::Owner OctreeCaches::surfelOwner(PageNumber page) const {
  const std::shared_lock lock(mutex_);
  return surfel_ranges_.ownerOf(page);
}

}  // namespace surfeit
