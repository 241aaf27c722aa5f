#include "octree/local_density.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <thread>

#include "core/worker_threads.h"

namespace surfeit {
namespace {

// Neighbours looked at: on a square grid the 8th is the diagonal one, and pi d^2 / k is right
// within a fifth; fewer are noisy, more smear edges.
constexpr std::size_t kNeighbours = 8;
// Strays: radii are limited to this many times the cloud's median.
constexpr float kStrayLimit = 8;
constexpr std::size_t kSamplePages = 64;
// Pages whose surfels are sized at once.
constexpr std::uint32_t kBatchPages = 32;

// Squared distances to the nearest surfels at other positions, ascending.
struct Nearest {
  std::array<float, kNeighbours> distance_sq;
  std::uint64_t coincident = 0;

  Nearest() { distance_sq.fill(std::numeric_limits<float>::infinity()); }
  float limit() const { return distance_sq.back(); }
  void add(float d2) {
    if (d2 == 0) {
      ++coincident;
      return;
    }
    if (d2 >= limit()) return;
    std::size_t i = kNeighbours - 1;
    for (; i > 0 && distance_sq[i - 1] > d2; --i) distance_sq[i] = distance_sq[i - 1];
    distance_sq[i] = d2;
  }
};

// A node to visit, by the least distance that its surfels can have.
struct Candidate {
  float distance;
  NodeRange children;          // of a leaf: where its surfels begin
  std::uint64_t surfel_count;  // of a leaf, else 0
};

float leastDistance(const glm::vec3& position, const Node& node) {
  return std::max(0.f, glm::length(node.position - position) - node.radius);
}

// Depth first, nearest child first; what is needed of a visited range is copied because the reader
// may drop its page.
Status search(const glm::vec3& position, const NodeRange& range, PagedOctree::Reader& reader,
              Nearest& nearest) {
  SURFEIT_ASSIGN_OR_RETURN(const std::span<const Node> nodes, reader.nodes(range));
  std::array<Candidate, 8> candidates;
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const Node& node = nodes[i];
    candidates[i] = {leastDistance(position, node), childrenOf(node),
                     node.isLeaf() ? node.surfel_count : 0};
  }
  const std::span<Candidate> order = std::span(candidates).first(nodes.size());
  std::sort(order.begin(), order.end(),
            [](const Candidate& a, const Candidate& b) { return a.distance < b.distance; });
  for (const Candidate& candidate : order) {
    // Positions count, not disks; a slack of one part in a million covers rounding
    if (candidate.distance * candidate.distance > nearest.limit() * 1.000001f) break;
    const NodeRange& below = candidate.children;
    if (candidate.surfel_count == 0) {
      SURFEIT_RETURN_IF_ERROR(search(position, below, reader, nearest));
      continue;
    }
    const auto visit = [&](std::span<const Surfel> surfels) {
      for (const Surfel& surfel : surfels) {
        const glm::vec3 d = surfel.position - position;
        nearest.add(glm::dot(d, d));
      }
    };
    SURFEIT_RETURN_IF_ERROR(
        reader.visitSurfels(below.page, below.first, candidate.surfel_count, visit));
  }
  return {};
}

}  // namespace

Result<float> localArea(const glm::vec3& position, PagedOctree::Reader& reader) {
  Nearest nearest;
  SURFEIT_RETURN_IF_ERROR(search(position, kRootRange, reader, nearest));
  const auto end = std::find(nearest.distance_sq.begin(), nearest.distance_sq.end(),
                             std::numeric_limits<float>::infinity());
  const auto found = end - nearest.distance_sq.begin();
  if (found == 0) return 0.f;
  const float sharers = float(std::max<std::uint64_t>(nearest.coincident, 1));
  return kPi * *(end - 1) / float(found) / sharers;
}

SizedSurfelStream::SizedSurfelStream(PagedOctree& octree, float overlap, int threads)
    : octree_(octree), overlap_(overlap) {
  for (int i = 0; i < threads; ++i) {
    searchers_.push_back({std::make_unique<PagedOctree::Reader>(octree)});
  }
}

SizedSurfelStream::~SizedSurfelStream() = default;

Result<float> SizedSurfelStream::Searcher::areaAt(const glm::vec3& position) {
  if (!has_last || position != last_position) {
    SURFEIT_ASSIGN_OR_RETURN(last_area, localArea(position, *reader));
    last_position = position;
    has_last = true;
  }
  return last_area;
}

Status SizedSurfelStream::prepare() {
  const SceneFile& file = octree_.file();
  const std::uint32_t pages = file.surfelPageCount();
  const std::uint32_t step = std::max<std::uint32_t>(1, pages / kSamplePages);
  std::vector<float> areas;
  for (std::uint32_t page = 0; page < pages; page += step) {
    surfels_.resize(file.header().surfel_group_capacity);
    SceneFile::Scratch scratch;
    SURFEIT_ASSIGN_OR_RETURN(const std::uint32_t count,
                             file.decodeSurfels(page, scratch, surfels_));
    for (std::uint32_t i = 0; i < count; i += 16) {
      SURFEIT_ASSIGN_OR_RETURN(const float area, searchers_[0].areaAt(surfels_[i].position));
      if (area > 0) areas.push_back(area);
    }
  }
  // One position for all: any size will do, so take a thousandth of the scene
  const float fallback = float(file.header().cube.size) * 1e-3f;
  if (areas.empty()) {
    largest_radius_ = fallback;
    return {};
  }
  const auto median = areas.begin() + static_cast<std::ptrdiff_t>(areas.size() / 2);
  std::nth_element(areas.begin(), median, areas.end());
  largest_radius_ = kStrayLimit * std::sqrt(*median * overlap_ / kPi);
  return {};
}

// The surfels of pages up to end_page, into surfels_.
Status SizedSurfelStream::readPages(std::uint32_t end_page) {
  const SceneFile& file = octree_.file();
  const std::size_t capacity = file.header().surfel_group_capacity;
  SceneFile::Scratch scratch;
  surfels_.clear();
  for (; next_page_ < end_page; ++next_page_) {
    const std::size_t size = surfels_.size();
    surfels_.resize(size + capacity);
    SURFEIT_ASSIGN_OR_RETURN(
        const std::uint32_t count,
        file.decodeSurfels(next_page_, scratch, std::span(surfels_).subspan(size)));
    surfels_.resize(size + count);
  }
  return {};
}

// Faint disks add up, each with its coverage of its own place, `local_area`. Disks of an opaque
// sheet must overlap, or it has gaps where they happen to lie apart: these get the area of other
// disks. The eighth power of the coverage leads from one to the other: of a sheet of random splats,
// which overlap four times, coverages of .01, .5 and .98 hide .009, .44 and .86 of what lies
// behind, and without a coverage .86.
float SizedSurfelStream::coveringArea(float coverage, float radius, float local_area) const {
  const float disk_area = areaOfDisk(radius, 1), opaque_area = areaOfDisk(radius, overlap_);
  const float faint_area = local_area > 0 ? std::min(local_area, disk_area) : disk_area;
  const float opaque_part = std::pow(coverage, 8.f);
  const float area = faint_area + opaque_part * std::max(opaque_area - faint_area, 0.f);
  return std::max(coverage * area, std::numeric_limits<float>::min());
}

Status SizedSurfelStream::fillSizes(Searcher& searcher, std::span<Surfel> surfels) const {
  for (Surfel& surfel : surfels) {
    if ((surfel.flags & kSurfelNeedsSize) == 0) continue;
    SURFEIT_ASSIGN_OR_RETURN(const float area, searcher.areaAt(surfel.position));
    surfel.flags &= ~kSurfelNeedsSize;
    if (surfel.radius > kPlaceholderSize) {
      surfel.area =
          coveringArea(std::min(surfel.area / kPlaceholderSize, 1.f), surfel.radius, area);
      continue;
    }
    surfel.radius = std::min(std::sqrt(area * overlap_ / kPi), largest_radius_);
    if (!(surfel.radius > 0)) surfel.radius = largest_radius_;
    surfel.area = areaOfDisk(surfel.radius, overlap_);
  }
  return {};
}

Result<std::shared_ptr<const SortedBatch>> SizedSurfelStream::next() {
  const SceneFile& file = octree_.file();
  if (next_page_ == file.surfelPageCount()) return std::shared_ptr<const SortedBatch>();
  SURFEIT_RETURN_IF_ERROR(
      readPages(std::min<std::uint32_t>(next_page_ + kBatchPages, file.surfelPageCount())));

  // One slice per searcher, in order: neighbours find the same pages
  std::vector<Status> statuses(searchers_.size());
  const auto search_slice = [&](std::size_t r) {
    const std::size_t begin = surfels_.size() * r / searchers_.size();
    const std::size_t end = surfels_.size() * (r + 1) / searchers_.size();
    statuses[r] = catchAll("find neighbours", [&] {
      return fillSizes(searchers_[r], std::span(surfels_).subspan(begin, end - begin));
    });
  };
  {
    // Threads for a batch, which takes them tens of milliseconds: they join here
    std::vector<std::jthread> others;
    for (std::size_t r = 1; r < searchers_.size(); ++r) others.emplace_back(search_slice, r);
    search_slice(0);
  }
  for (const Status& status : statuses) SURFEIT_RETURN_IF_ERROR(status);

  const auto batch = std::make_shared<SortedBatch>();
  batch->resize(surfels_.size());
  std::copy(surfels_.begin(), surfels_.end(), batch->surfels.begin());
  for (std::size_t i = 0; i < surfels_.size(); ++i) {
    batch->tickets[i] = {curveKey(surfels_[i].position, file.header().cube), i};
  }
  return std::shared_ptr<const SortedBatch>(batch);
}

}  // namespace surfeit
