#include "octree/neighbours/local_density.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <utility>

#include "core/long_side.h"
#include "octree/page/page_limits.h"

namespace surfeit {
namespace {

// Strays: radii off surfaces are limited to this many times the cloud's median; and those of what
// is sparse beside dense, for densities that change by 1:1600.
constexpr float kStrayLimit = 8, kSparseLimit = 40;
constexpr std::size_t kSamplePages = 64, kSampleStep = 16;
// Pages whose surfels are sized at once, for each thread: what a PlaceIndex serves best.
constexpr std::uint32_t kThreadPages = 16;

bool needsSize(const Surfel& surfel) { return (surfel.flags & kSurfelNeedsSize) != 0; }

}  // namespace

SizedSurfelStream::SizedSurfelStream(PagedOctree& octree, float overlap,
                                     std::optional<NormalRule> normals, int threads,
                                     const Progress& progress)
    : octree_(octree),
      overlap_(overlap),
      normals_(std::move(normals)),
      progress_(progress),
      end_page_(octree.file().surfelPageCount()) {
  for (int i = 0; i < threads; ++i) searchers_.emplace_back(octree);
}

SizedSurfelStream::~SizedSurfelStream() = default;

std::size_t SizedSurfelStream::searcherBytes(int threads) {
  // Surfels are read, then copied into a batch with their tickets
  constexpr std::size_t kBatchBytes =
      kThreadPages * kDefaultSurfelGroup * (2 * sizeof(Surfel) + sizeof(Ticket));
  return std::size_t(threads) * (SurfaceSearch::memoryBytes() + kBatchBytes);
}

Status SizedSurfelStream::prepare() {
  const SceneFile& file = octree_.file();
  const std::uint32_t pages = file.surfelPageCount();
  const std::uint32_t step = std::max<std::uint32_t>(1, pages / kSamplePages);
  std::vector<float> radii;
  for (std::uint32_t page = 0; page < pages; page += step) {
    surfels_.resize(file.header().surfel_group_capacity);
    SceneFile::Scratch scratch;
    SURFEIT_ASSIGN_OR_RETURN(const std::uint32_t count,
                             file.decodeSurfels(page, scratch, surfels_));
    SURFEIT_RETURN_IF_ERROR(searchers_[0].find(
        std::span(surfels_).first(count),
        [](std::size_t i) { return SurfaceNeeds{.size = i % kSampleStep == 0}; },
        [&](std::size_t, const SurfaceAt& surface) {
          if (surface.area > 0) radii.push_back(surface.radius);
        },
        progress_));
  }
  // One position for all: any size will do, so take a thousandth of the scene
  const float fallback = float(file.header().cube.size) * 1e-3f;
  if (radii.empty()) {
    largest_radius_ = fallback;
    return {};
  }
  const auto median = radii.begin() + static_cast<std::ptrdiff_t>(radii.size() / 2);
  std::nth_element(radii.begin(), median, radii.end());
  largest_radius_ = kStrayLimit * *median;
  for (SurfaceSearch& searcher : searchers_) {
    searcher.limitRadii(largest_radius_, kSparseLimit / kStrayLimit * largest_radius_);
  }
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
// which overlap four times, coverages of .01, .5 and .98 hide .009, .45 and .86 of what lies
// behind, and without a coverage .86.
float SizedSurfelStream::coveringArea(float coverage, float radius, float local_area) const {
  const float disk_area = areaOfDisk(radius, 1), opaque_area = areaOfDisk(radius, overlap_);
  const float faint_area = local_area > 0 ? std::min(local_area, disk_area) : disk_area;
  const float opaque_part = std::pow(coverage, 8.f);
  const float area = faint_area + opaque_part * std::max(opaque_area - faint_area, 0.f);
  return std::max(coverage * area, std::numeric_limits<float>::min());
}

void SizedSurfelStream::applySize(Surfel& surfel, const SurfaceAt& surface) const {
  surfel.flags &= ~(kSurfelNeedsSize | kSurfelMarks);
  if (surfel.radius > kPlaceholderSize) {
    surfel.area =
        coveringArea(std::min(surfel.area / kPlaceholderSize, 1.f), surfel.radius, surface.area);
    return;
  }
  const bool is_known = surface.area > 0 && surface.radius > 0;
  surfel.radius = is_known ? std::sqrt(overlap_) * surface.radius : largest_radius_;
  surfel.area = is_known ? surface.area : areaOfDisk(surfel.radius, overlap_);
}

void SizedSurfelStream::applyNormal(Surfel& surfel, const SurfaceAt& surface) {
  const FoundNormal found = normals_->at(surfel.position, surface);
  ++(found.is_thin ? thin_surfels_ : normals_found_);
  if (found.normal == glm::vec3(0)) return;
  surfel.normal = found.normal;
  surfel.flags &= ~kSurfelSphere;
  if (found.is_two_sided) {
    surfel.flags |= kSurfelTwoSided;
  } else if (normals_->needsSides()) {
    surfel.flags |= kSurfelNeedsSide;
  }
}

Result<std::shared_ptr<const SortedBatch>> SizedSurfelStream::next() {
  const SceneFile& file = octree_.file();
  if (next_page_ == end_page_) return std::shared_ptr<const SortedBatch>();
  const std::uint32_t pages = kThreadPages * std::uint32_t(searchers_.size());
  SURFEIT_RETURN_IF_ERROR(readPages(next_page_ + std::min(pages, end_page_ - next_page_)));

  SURFEIT_RETURN_IF_ERROR(findOnThreads(
      searchers_, surfels_,
      [&](std::size_t i) {
        return SurfaceNeeds{.size = needsSize(surfels_[i]), .normal = needsNormal(surfels_[i])};
      },
      [&](std::size_t i, const SurfaceAt& surface) {
        Surfel& surfel = surfels_[i];
        const bool is_bare = needsSize(surfel) && surfel.radius <= kPlaceholderSize;
        if (needsSize(surfel)) applySize(surfel, surface);
        if (needsNormal(surfel)) applyNormal(surfel, surface);
        // Spheres have no sides
        if (is_bare && !surfel.isSphere()) setLongSide(surface.long_side, surfel);
      },
      progress_));

  const auto batch = std::make_shared<SortedBatch>();
  batch->resize(surfels_.size());
  std::copy(surfels_.begin(), surfels_.end(), batch->surfels.begin());
  for (std::size_t i = 0; i < surfels_.size(); ++i) {
    batch->tickets[i] = {curveKey(surfels_[i].position, file.header().cube), i};
  }
  return std::shared_ptr<const SortedBatch>(batch);
}

void applySizeRules(Surfel& surfel, float overlap) {
  if (surfel.radius > 0 && surfel.area > 0) return;
  if (surfel.radius > 0) {
    if (surfel.area < 0) {  // a coverage
      surfel.area *= -kPlaceholderSize;
      surfel.flags |= kSurfelNeedsSize;
    } else {
      surfel.area = areaOfDisk(surfel.radius, overlap);
    }
  } else if (surfel.area > 0) {
    surfel.radius = std::sqrt(surfel.area * overlap / kPi);
  } else {
    surfel.radius = surfel.area = kPlaceholderSize;
    surfel.flags |= kSurfelNeedsSize;
  }
}

}  // namespace surfeit
