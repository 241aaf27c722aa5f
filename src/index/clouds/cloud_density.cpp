#include "index/clouds/cloud_density.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <limits>
#include <memory>
#include <unordered_map>
#include <utility>

#include "core/square_strata.h"
#include "octree/neighbours/places.h"
#include "octree/read/paged_octree.h"

namespace surfeit {
namespace {

constexpr std::size_t kNeighbours = 8;
constexpr double kPi = 3.14159265358979323846;
constexpr std::size_t kBatch = 16384;
constexpr std::uint64_t kSampleKey = 0x5FC1A7;  // of the chance that picks
// Times as far as the sample lets expect the neighbours: of a surface; of what fills space. Then as
// far as other places of the sample, which are neighbours enough.
constexpr double kReaches[] = {2, 16, std::numeric_limits<double>::infinity()};
// As many places may be found sparser than the reach tells: they lie beyond the quantiles.
constexpr double kForgivenShare = 0.01;

double squaredDistance(const glm::vec3& a, const glm::vec3& b) {
  const glm::dvec3 d = glm::dvec3(a) - glm::dvec3(b);
  return glm::dot(d, d);
}

// The nearest other places of one, as far as they were seen.
class NearestOthers {
 public:
  void clear() { count_ = 0; }
  std::size_t count() const { return count_; }
  bool isFull() const { return count_ == kNeighbours; }
  // Of the farthest.
  double distanceSq() const { return count_ == 0 ? 0 : others_[count_ - 1].distance_sq; }

  // Takes a place, which may have been seen before, unless enough are nearer.
  void add(const glm::vec3& place, double distance_sq) {
    if (isFull() && distance_sq >= distanceSq()) return;
    for (std::size_t i = 0; i < count_; ++i) {
      if (others_[i].place == place) return;
    }
    std::size_t at = isFull() ? count_ - 1 : count_++;
    for (; at > 0 && others_[at - 1].distance_sq > distance_sq; --at) others_[at] = others_[at - 1];
    others_[at] = {distance_sq, place};
  }

 private:
  struct Other {
    double distance_sq = 0;
    glm::vec3 place{0};
  };
  std::array<Other, kNeighbours> others_;
  std::size_t count_ = 0;
};

// A place of the sample.
struct Spot {
  glm::vec3 place{0};
  std::uint64_t hits = 0;    // points of the sample there
  double far = 0;            // with so much reach it finds neighbours enough, or all that there are
  double reach = -1;         // not looked yet
  std::uint64_t points = 0;  // of the cloud there
  NearestOthers others;

  bool isSettled() const { return others.isFull() || reach >= far; }
};

// The different places, and how far each has to look.
std::vector<Spot> spotsOf(std::span<const glm::vec3> sample) {
  std::vector<Spot> spots;
  std::unordered_map<std::uint64_t, std::vector<std::size_t>> known;
  for (const glm::vec3& place : sample) {
    std::uint64_t hash = 0;
    for (int axis = 0; axis < 3; ++axis) {
      hash = hashOf(hash, std::uint64_t(std::hash<float>()(place[axis])));
    }
    std::vector<std::size_t>& same = known[hash];
    const auto found = std::find_if(same.begin(), same.end(),
                                    [&](std::size_t i) { return spots[i].place == place; });
    if (found != same.end()) {
      ++spots[*found].hits;
      continue;
    }
    same.push_back(spots.size());
    Spot& spot = spots.emplace_back();
    spot.place = place;
    spot.hits = 1;
  }
  for (Spot& spot : spots) {
    NearestOthers others;
    for (const Spot& other : spots) {
      if (&other != &spot) others.add(other.place, squaredDistance(other.place, spot.place));
    }
    // A few more digits than roundings take
    spot.far = others.isFull() ? std::sqrt(others.distanceSq()) * (1 + 1e-9)
                               : std::numeric_limits<double>::infinity();
  }
  return spots;
}

// Spots by the cells that their reaches touch. Cells come in sizes, so that a reach touches eight
// at most; a bit for every cell tells nearly always that there is none, without looking further.
class SpotGrid {
 public:
  // `farthest`: the largest coordinate of the cloud.
  SpotGrid(std::span<Spot* const> spots, double farthest) : bits_(kBits / 64) {
    for (Spot* const spot : spots) add(*spot, farthest);
  }

  // Calls visit(spot) for the spots that may reach a place.
  template <typename Visit>
  void visitAround(const glm::vec3& place, const Visit& visit) {
    for (const Level& level : levels_) {
      const std::uint64_t hash = hashOfCell(level, cellOf(level, glm::dvec3(place)));
      const std::uint64_t bit = hash % kBits;
      if ((bits_[bit / 64] >> (bit % 64) & 1) == 0) continue;
      const auto found = cells_.find(hash);
      if (found == cells_.end()) continue;
      for (Spot* const spot : found->second) visit(*spot);
    }
  }

 private:
  static constexpr std::uint64_t kBits = 1 << 18;
  struct Level {
    int exponent = 0;
    double cells_per_length = 0;
  };
  using Cell = std::array<std::int64_t, 3>;

  static Cell cellOf(const Level& level, const glm::dvec3& place) {
    Cell cell;
    for (int axis = 0; axis < 3; ++axis) {
      const double at = place[axis] * level.cells_per_length;
      const std::int64_t towards_0 = static_cast<std::int64_t>(at);
      cell[std::size_t(axis)] = towards_0 - (at < double(towards_0) ? 1 : 0);
    }
    return cell;
  }
  static std::uint64_t hashOfCell(const Level& level, const Cell& cell) {
    const std::uint64_t x = std::uint64_t(cell[0]) * 0x9E3779B97F4A7C15u;
    const std::uint64_t y = std::uint64_t(cell[1]) * 0xC2B2AE3D27D4EB4Fu;
    const std::uint64_t z = std::uint64_t(cell[2]) * 0x165667B19E3779F9u;
    return mixBits(x ^ (y << 1 | y >> 63) ^ (z << 2 | z >> 62) ^ std::uint64_t(level.exponent));
  }

  // Cells of an edge from 2 to 8 times the reach, and of no more than 2^40 from 0 on.
  const Level& levelOf(double reach, double farthest) {
    const double edge = std::max({2 * reach, farthest * 0x1p-40, 1e-300});
    int exponent = std::ilogb(edge) + 1;
    exponent += exponent & 1;
    for (const Level& level : levels_) {
      if (level.exponent == exponent) return level;
    }
    levels_.push_back({exponent, std::ldexp(1, -exponent)});
    return levels_.back();
  }

  void add(Spot& spot, double farthest) {
    // No farther than all there is
    const double reach = std::min(spot.reach, 4 * farthest);
    const Level level = levelOf(reach, farthest);
    const glm::dvec3 place(spot.place);
    const Cell low = cellOf(level, place - reach), high = cellOf(level, place + reach);
    for (std::int64_t x = low[0]; x <= high[0]; ++x) {
      for (std::int64_t y = low[1]; y <= high[1]; ++y) {
        for (std::int64_t z = low[2]; z <= high[2]; ++z) {
          const std::uint64_t hash = hashOfCell(level, {x, y, z});
          bits_[hash % kBits / 64] |= std::uint64_t{1} << (hash % 64);
          cells_[hash].push_back(&spot);
        }
      }
    }
  }

  std::vector<std::uint64_t> bits_;
  std::vector<Level> levels_;
  std::unordered_map<std::uint64_t, std::vector<Spot*>> cells_;
};

// One pass of all points past the spots of the grid.
Status streamPast(SurfelSource& source, SpotGrid& grid, Progress& progress) {
  SURFEIT_RETURN_IF_ERROR(source.rewind());
  std::vector<Surfel> batch(kBatch);
  progress.beginPhase("density", source.recordCount(), "surfels");
  for (;;) {
    if (progress.isCancelled()) return Status::interrupted();
    SURFEIT_ASSIGN_OR_RETURN(const std::size_t count, source.read(batch));
    if (count == 0) return {};
    for (const Surfel& surfel : std::span(batch).first(count)) {
      const glm::vec3 place = surfel.position;
      grid.visitAround(place, [&place](Spot& spot) {
        const double distance_sq = squaredDistance(place, spot.place);
        if (place == spot.place) {
          ++spot.points;
        } else if (distance_sq <= spot.reach * spot.reach) {
          spot.others.add(place, distance_sq);
        }
      });
    }
    progress.advance(count);
  }
}

// A place with its spacing, and how many places it stands for.
struct Measured {
  double spacing = 0, weight = 0;
};

double quantile(std::span<const Measured> sorted, double share) {
  double all = 0, sum = 0;
  for (const Measured& place : sorted) all += place.weight;
  for (const Measured& place : sorted) {
    sum += place.weight;
    if (sum >= share * all) return place.spacing;
  }
  return sorted.empty() ? 0 : sorted.back().spacing;
}

double spacingOf(double distance_sq, std::size_t count) {
  return std::sqrt(kPi * distance_sq / double(count));
}

// Of a place whose nearest others were asked for, one more than count.
double spacingOf(const NearestPlaces& found) {
  const std::size_t others = std::min(found.neighbours.size(), kNeighbours);
  if (others < kNeighbours && std::isfinite(found.reach)) {
    return spacingOf(double(found.reach) * double(found.reach),
                     kNeighbours);  // several so far away
  }
  if (others == 0) return 0;
  const glm::dvec3 offset(found.neighbours[others - 1].offset);
  return spacingOf(glm::dot(offset, offset), others);
}

// Gathers what is found place by place. Places were drawn as often as they have points, so each
// stands for as many the fewer it has.
class DensitySum {
 public:
  // A place that was drawn `hits` times and has `points`. Spacing 0: there is no other place.
  void add(std::uint64_t hits, std::uint64_t points, double spacing) {
    const double weight = double(hits) / double(std::max<std::uint64_t>(points, 1));
    sampled_ += hits;
    places_ += weight;
    if (points > 1) repeated_ += weight;
    if (spacing > 0) measured_.push_back({spacing, weight});
  }

  CloudDensity result() {
    CloudDensity density;
    density.sampled = sampled_;
    if (sampled_ == 0) return density;
    density.repeated_share = repeated_ / places_;
    std::sort(measured_.begin(), measured_.end(),
              [](const Measured& a, const Measured& b) { return a.spacing < b.spacing; });
    density.low_spacing = quantile(measured_, 0.05);
    density.median_spacing = quantile(measured_, 0.5);
    density.high_spacing = quantile(measured_, 0.95);
    if (density.median_spacing > 0) {
      const double per_place = double(sampled_) / places_;
      density.points_per_area = per_place / (density.median_spacing * density.median_spacing);
    }
    return density;
  }

 private:
  std::uint64_t sampled_ = 0;
  double places_ = 0, repeated_ = 0;
  std::vector<Measured> measured_;
};

}  // namespace

// The number of the surfel that stands for the next thousandth.
std::uint64_t PlaceSample::nextPick() const {
  const std::uint64_t parts = std::min(records_, kMostPlaces);
  const auto bound = [&](std::uint64_t part) {
    return records_ / parts * part + records_ % parts * part / parts;
  };
  const std::uint64_t begin = bound(part_), end = bound(part_ + 1);
  return begin + hashOf(kSampleKey, part_) % (end - begin);
}

void PlaceSample::add(std::span<const Surfel> surfels) {
  const std::uint64_t end = surfels_ + surfels.size();
  while (part_ < std::min(records_, kMostPlaces) && nextPick() < end) {
    places_.push_back(surfels[nextPick() - surfels_].position);
    ++part_;
  }
  for (const Surfel& surfel : surfels) bounds_.add(surfel.position);
  surfels_ = end;
}

void PlaceSample::clear() {
  surfels_ = part_ = 0;
  bounds_ = {};
  places_.clear();
}

Result<CloudDensity> measureDensity(SurfelSource& source, const PlaceSample& sample,
                                    Progress& progress) {
  std::vector<Spot> spots = spotsOf(sample.places());
  const glm::vec3 far = glm::max(glm::abs(sample.bounds().min), glm::abs(sample.bounds().max));
  const double farthest = double(std::max({far.x, far.y, far.z}));
  const double part = double(sample.places().size()) / double(sample.surfelCount());
  for (const double times : kReaches) {
    std::vector<Spot*> open;
    for (Spot& spot : spots) {
      if (!spot.isSettled()) open.push_back(&spot);
    }
    if (open.empty()) break;
    if (times > kReaches[0] && double(open.size()) <= kForgivenShare * double(spots.size())) break;
    for (Spot* const spot : open) {
      spot->reach = std::min(times * spot->far * std::sqrt(part), spot->far);
      spot->points = 0;
      spot->others.clear();
    }
    SpotGrid grid(open, farthest);
    SURFEIT_RETURN_IF_ERROR(streamPast(source, grid, progress));
  }
  DensitySum sum;
  for (const Spot& spot : spots) {
    sum.add(spot.hits, spot.points,
            spot.isSettled()
                ? spacingOf(spot.others.distanceSq(), std::max<std::size_t>(spot.others.count(), 1))
                : spacingOf(spot.reach * spot.reach, kNeighbours));
  }
  return sum.result();
}

Result<CloudDensity> measureDensity(SceneFile scene, Progress& progress) {
  constexpr std::size_t kCacheBytes = 16 << 20;
  const std::size_t cache_bytes =
      std::max(std::min(PagedOctree::unlimitedCacheBytes(scene), kCacheBytes),
               PagedOctree::leastCacheBytes(scene, 1));
  SURFEIT_ASSIGN_OR_RETURN(const PagedOctree::Memory memory,
                           PagedOctree::planMemory(scene, cache_bytes, 1));
  SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<PagedOctree> octree,
                           PagedOctree::create(std::move(scene), memory));
  const SceneFile& file = octree->file();
  PagedOctree::Reader reader(*octree);
  SceneFile::Scratch scratch;
  std::vector<Surfel> page(file.header().surfel_group_capacity);
  const std::uint64_t pages = file.surfelPageCount();
  const std::uint64_t looks = std::min(pages, PlaceSample::kMostPlaces);
  const std::uint64_t picks = looks == 0 ? 0 : (PlaceSample::kMostPlaces + looks - 1) / looks;
  NearestPlaces found;
  glm::vec3 last(0);
  DensitySum sum;
  progress.beginPhase("density", looks, "pages");
  for (std::uint64_t look = 0; look < looks; ++look) {
    if (progress.isCancelled()) return Status::interrupted();
    const std::uint64_t number = std::uint64_t(double(look) * double(pages) / double(looks));
    SURFEIT_ASSIGN_OR_RETURN(const std::uint32_t count,
                             file.decodeSurfels(std::uint32_t(number), scratch, page));
    const std::uint64_t taken = std::min<std::uint64_t>(picks, count);
    for (std::uint64_t i = 0; i < taken; ++i) {
      const std::uint64_t at = (count * i + hashOf(kSampleKey, look * kBatch + i) % count) / taken;
      // The farthest of those that are asked for tells only how far the others were looked for. Of
      // a crowd, which takes long, once is enough
      if (look + i == 0 || page[at].position != last) {
        last = page[at].position;
        SURFEIT_RETURN_IF_ERROR(findPlaces(last, kNeighbours + 1, reader, found));
      }
      sum.add(1, found.coincident, spacingOf(found));
    }
    progress.advance(1);
  }
  return sum.result();
}

}  // namespace surfeit
