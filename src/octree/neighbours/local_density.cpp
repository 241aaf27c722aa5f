#include "octree/neighbours/local_density.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <utility>

#include "core/long_side.h"
#include "octree/build/curve_sort.h"
#include "octree/neighbours/leaf_levels.h"
#include "octree/page/page_limits.h"

namespace surfeit {
namespace {

// Strays: radii off surfaces are limited to this many times the cloud's median; and those of what
// is sparse beside dense, for densities that change by 1:1600.
constexpr float kStrayLimit = 8, kSparseLimit = 40;
constexpr std::size_t kSamplePages = 64, kSampleStep = 16;
// Pages whose surfels are sized at once, for each thread: what a PlaceIndex serves best.
constexpr std::uint32_t kThreadPages = 16;
// Of its width: a rectangle whose middle is farther away from the middle of its cell is a disk. So
// far, its moments about its middle are 1.2 times those of its area.
constexpr float kAside = 0.19f;

// From a place in the box along `way`, which lies in the plane with this normal; at a face of the
// box along that, in the plane.
glm::vec3 wayWithin(const Bounds3& box, const glm::vec3& from, glm::vec3 way,
                    const glm::vec3& normal) {
  constexpr float kInside = 0.999f;  // of the way: rounding may leave the box
  glm::vec3 place = from;
  for (int faces = 0; faces < 3; ++faces) {
    float part = 1;
    int face = -1;
    for (int axis = 0; axis < 3; ++axis) {
      const float room = (way[axis] > 0 ? box.max[axis] : box.min[axis]) - place[axis];
      if (std::abs(way[axis]) * part > std::abs(room)) face = axis, part = room / way[axis];
    }
    place += part * way;
    if (face < 0) break;
    glm::vec3 across = -normal[face] * normal;
    across[face] += 1;
    const float across_sq = glm::dot(across, across);
    if (!(across_sq > 1e-6f)) break;
    way *= 1 - part;
    way -= glm::dot(way, across) / across_sq * across;
    way[face] = 0;  // but for rounding
  }
  return from + kInside * (place - from);
}

// The part of a way from a place in the box that stays in it.
float partWithin(const Bounds3& box, const glm::vec3& from, const glm::vec3& way) {
  constexpr float kInside = 0.999f;  // rounding may leave the box
  float part = 1;
  for (int axis = 0; axis < 3; ++axis) {
    const float room = std::abs((way[axis] > 0 ? box.max[axis] : box.min[axis]) - from[axis]);
    if (std::abs(way[axis]) * part > kInside * room) part = kInside * room / std::abs(way[axis]);
  }
  return part;
}

float radiusOfArea(float area, float overlap) { return std::sqrt(area * overlap / kPi); }

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
  // Surfels are read, then copied into a batch with their tickets, which are sorted
  constexpr std::size_t kSurfelBytes = 2 * sizeof(Surfel) + 2 * sizeof(Ticket) + sizeof(CurveKey) +
                                       sizeof(std::uint8_t) + sizeof(SurfaceAt);
  constexpr std::size_t kBatchBytes = kThreadPages * kDefaultSurfelGroup * kSurfelBytes;
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
  page_begins_.clear();
  for (; next_page_ < end_page; ++next_page_) {
    const std::size_t size = surfels_.size();
    page_begins_.push_back(size);
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

// Of the first or the last surfel of a page, which need not exist.
Result<std::optional<CurveKey>> SizedSurfelStream::keyBeside(std::uint32_t page,
                                                             bool is_first) const {
  const SceneFile& file = octree_.file();
  if (page >= file.surfelPageCount()) return std::optional<CurveKey>();
  std::vector<Surfel> surfels(file.header().surfel_group_capacity);
  SceneFile::Scratch scratch;
  SURFEIT_ASSIGN_OR_RETURN(const std::uint32_t count, file.decodeSurfels(page, scratch, surfels));
  const Surfel& surfel = surfels[is_first ? 0 : count - 1];
  return std::optional(curveKey(surfel.position, file.header().cube));
}

// The surfels' keys, and the levels of their leaves, for those that move.
Status SizedSurfelStream::findLeaves() {
  if (keeps_places_ || std::none_of(surfels_.begin(), surfels_.end(), needsSize)) return {};
  const SceneHeader& header = octree_.file().header();
  keys_.resize(surfels_.size());
  curveKeys(&surfels_.front().position, sizeof(Surfel), header.cube, keys_);
  leaf_levels_.resize(surfels_.size());
  const std::uint32_t pages = std::uint32_t(page_begins_.size());
  std::optional<CurveKey> before;
  if (next_page_ > pages) {
    SURFEIT_ASSIGN_OR_RETURN(before, keyBeside(next_page_ - pages - 1, false));
  }
  for (std::size_t page = 0; page < pages; ++page) {
    const bool is_last = page + 1 == pages;
    const std::size_t begin = page_begins_[page],
                      size = (is_last ? keys_.size() : page_begins_[page + 1]) - begin;
    std::optional<CurveKey> after;
    if (is_last) {
      SURFEIT_ASSIGN_OR_RETURN(after, keyBeside(next_page_, true));
    } else {
      after = keys_[begin + size];
    }
    findLeafLevels(std::span(keys_).subspan(begin, size), before, after, header.leaf_capacity,
                   std::span(leaf_levels_).subspan(begin, size));
    before = keys_[begin + size - 1];
  }
  return {};
}

// As far as its leaf reaches. A receiver at the place may then be behind the disk, which matters
// where backs are seen.
void SizedSurfelStream::moveToSurface(std::size_t i, const glm::vec3& height) {
  Surfel& surfel = surfels_[i];
  if (keeps_places_ || surfel.isTwoSided() || height == glm::vec3(0)) return;
  const RootCube& cube = octree_.file().header().cube;
  const Bounds3 leaf = cellBounds(surfel.position, leaf_levels_[i], cube);
  const glm::vec3 place = surfel.position + partWithin(leaf, surfel.position, height) * height;
  if (firstDifferentLevel(keys_[i], curveKey(place, cube)) <= leaf_levels_[i]) return;
  surfel.position = place;
  ++scattered_surfels_;
}

// Without leaving its leaf, so the order of leaves stays. A disk around its new place is spread out
// as far as the cell.
void SizedSurfelStream::moveToMiddle(std::size_t i, const glm::vec3& middle) {
  Surfel& surfel = surfels_[i];
  // Of places at one position the first one's plane tells for all
  const glm::vec3 way = middle - glm::dot(middle, surfel.normal) * surfel.normal;
  if (keeps_places_ || way == glm::vec3(0)) return;
  const RootCube& cube = octree_.file().header().cube;
  const Bounds3 leaf = cellBounds(surfel.position, leaf_levels_[i], cube);
  glm::vec3 place = wayWithin(leaf, surfel.position, way, surfel.normal);
  const bool is_inside = firstDifferentLevel(keys_[i], curveKey(place, cube)) > leaf_levels_[i];
  if (!is_inside) place = surfel.position;
  const glm::vec3 left = surfel.position + way - place;
  const float left_sq = glm::dot(left, left);
  const float radius_sq =
      surfel.radius * surfel.radius + 2 * overlap_ * (left_sq - glm::dot(way, way));
  // A rectangle would lie beside its cell
  const float width_sq = surfel.area / elongationOf(surfel);
  if (left_sq > kAside * kAside * width_sq) surfel.long_side = kNoLongSide, surfel.elongation = 0;
  if (!(radius_sq > 0)) return;
  surfel.position = place;
  surfel.radius = std::sqrt(radius_sq);
}

void SizedSurfelStream::take(std::size_t i, const SurfaceAt& surface) {
  Surfel& surfel = surfels_[i];
  const bool has_area = hasAreaAlone(surfel), needs_size = needsSize(surfel);
  const bool is_bare = needs_size && !has_area && surfel.radius <= kPlaceholderSize;
  if (has_area) {
    area_cells_[i] = surface;
  } else if (needs_size) {
    applySize(surfel, surface);
  }
  if (needsNormal(surfel)) applyNormal(surfel, surface);
  // Spheres have no sides
  if (!is_bare || surfel.isSphere()) return;
  setLongSide(surface.long_side, surfel);
  moveToMiddle(i, surface.middle);
  moveToSurface(i, surface.height);
  setSharers(surface.sharers, surfel);
  // One-sided disks are tiles anyway
  if (surfel.isTwoSided() && surface.area > 0) setTile(surface.area, surfel);
}

// The disks of surfels with an area alone, when the cells of all are known.
void SizedSurfelStream::shapeGiven() {
  if (area_cells_.empty()) return;
  for (std::size_t page = 0; page < page_begins_.size(); ++page) {
    const bool is_last = page + 1 == page_begins_.size();
    const std::size_t begin = page_begins_[page],
                      size = (is_last ? surfels_.size() : page_begins_[page + 1]) - begin;
    shrinkToAreas(std::span(surfels_).subspan(begin, size),
                  std::span(area_cells_).subspan(begin, size));
  }
  for (std::size_t i = 0; i < surfels_.size(); ++i) {
    Surfel& surfel = surfels_[i];
    if (!hasAreaAlone(surfel)) continue;
    const SurfaceAt& cell = area_cells_[i];
    surfel.flags &= ~(kSurfelNeedsSize | kSurfelMarks);
    surfel.radius = std::sqrt(overlap_) * cell.radius;
    if (!surfel.isSphere() && cell.area > 0) {
      setLongSide(cell.long_side, surfel);
      moveToMiddle(i, cell.middle);
      moveToSurface(i, cell.height);
      setSharers(cell.sharers, surfel);
      setTile(cell.area, surfel);
    }
    const float radius = radiusOfArea(pieceArea(surfel), overlap_);
    if (!(cell.area > 0)) surfel.radius = radius;
    if (!hasLongSide(surfel)) {
      surfel.radius = std::min(surfel.radius, std::sqrt(kMostOverArea) * radius);
    }
  }
}

Result<std::shared_ptr<const SortedBatch>> SizedSurfelStream::next() {
  const SceneFile& file = octree_.file();
  if (next_page_ == end_page_) return std::shared_ptr<const SortedBatch>();
  const std::uint32_t pages = kThreadPages * std::uint32_t(searchers_.size());
  SURFEIT_RETURN_IF_ERROR(readPages(next_page_ + std::min(pages, end_page_ - next_page_)));

  SURFEIT_RETURN_IF_ERROR(findLeaves());
  area_cells_.assign(
      std::any_of(surfels_.begin(), surfels_.end(), hasAreaAlone) ? surfels_.size() : 0,
      SurfaceAt());
  SURFEIT_RETURN_IF_ERROR(findOnThreads(
      searchers_, surfels_,
      [&](std::size_t i) {
        return SurfaceNeeds{.size = needsSize(surfels_[i]), .normal = needsNormal(surfels_[i])};
      },
      [&](std::size_t i, const SurfaceAt& surface) { take(i, surface); }, progress_));
  shapeGiven();

  const auto batch = std::make_shared<SortedBatch>();
  batch->resize(surfels_.size());
  std::copy(surfels_.begin(), surfels_.end(), batch->surfels.begin());
  for (std::size_t i = 0; i < surfels_.size(); ++i) {
    batch->tickets[i] = {curveKey(surfels_[i].position, file.header().cube), i};
  }
  ticket_scratch_.resize(surfels_.size());
  sortByKey(batch->tickets, ticket_scratch_);
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
  } else if (findsRadius(surfel)) {
    surfel.radius = kPlaceholderSize;
    surfel.flags |= kSurfelNeedsSize;
  } else if (surfel.area > 0) {
    surfel.radius = radiusOfArea(surfel.area, overlap);
  } else {
    surfel.radius = surfel.area = kPlaceholderSize;
    surfel.flags |= kSurfelNeedsSize;
  }
}

}  // namespace surfeit
