// Looking up a brick map (docs/brick.md, "Looking up").
#include <algorithm>
#include <array>
#include <cmath>
#include <new>
#include <utility>

#include "brick/brick_layout.h"
#include "brick/brick_pages.h"
#include "core/assert.h"
#include "surfeit/brick.h"

namespace surfeit {

struct BrickMap::State {
  std::unique_ptr<BrickPages> pages;
};

namespace {

// What the eight voxels around a place say, over the directions that count.
struct LevelSample {
  double weight = 0;
  std::array<double, kMaxBrickValues> sums = {};  // of values times weights

  // The weight, and behind it the values, of a voxel.
  void add(const float* voxel, double share, std::size_t value_count) {
    const double area = share * static_cast<double>(voxel[0]);
    weight += area;
    for (std::size_t i = 0; i < value_count; ++i) {
      sums[i] += area * static_cast<double>(voxel[i + 1]);
    }
  }
};

// One look-up: holds the leaves that it has used.
class BrickLookup {
 public:
  BrickLookup(BrickPages& pages, const glm::dvec3& position, const glm::vec3& normal)
      : pages_(pages), position_(position), shares_(sharesOf(normal)) {}

  // The values at a level, or at the next that has any there. False when there are none.
  Result<bool> at(int level, std::array<double, kMaxBrickValues>& values);

 private:
  struct Held {
    int group = -1;
    VdbCoord origin = {};
    std::shared_ptr<const BrickLeaf> leaf;
  };

  static std::array<float, kBrickDirections> sharesOf(const glm::vec3& normal);
  Status sample(int level, LevelSample& sample);
  Status sampleVoxel(int level, int direction, const VdbCoord& voxel, double weight,
                     LevelSample& sample);
  Result<const BrickLeaf*> leafOf(int level, int direction, const VdbCoord& voxel);

  BrickPages& pages_;
  glm::dvec3 position_;
  std::array<float, kBrickDirections> shares_;
  std::array<Held, 32> held_;
  std::size_t held_count_ = 0, next_held_ = 0;
};

std::size_t placeInLeaf(const VdbCoord& voxel) {
  return static_cast<std::size_t>((voxel[0] & 7) << 6 | (voxel[1] & 7) << 3 | (voxel[2] & 7));
}

VdbCoord parentOf(const VdbCoord& voxel) { return {voxel[0] >> 1, voxel[1] >> 1, voxel[2] >> 1}; }

// Whether any of the 8 children of a voxel's parent is there. They lie in one leaf.
bool hasSiblings(const BrickLeaf* leaf, const VdbCoord& voxel) {
  if (leaf == nullptr) return false;
  const std::size_t first = placeInLeaf({voxel[0] & ~1, voxel[1] & ~1, voxel[2] & ~1});
  for (const std::size_t step : {0, 1, 8, 9, 64, 65, 72, 73}) {
    if (leaf->has(first + step)) return true;
  }
  return false;
}

std::array<float, kBrickDirections> BrickLookup::sharesOf(const glm::vec3& normal) {
  const float length = std::sqrt(normal.x * normal.x + normal.y * normal.y + normal.z * normal.z);
  std::array<float, kBrickDirections> shares;
  if (!(length > 0)) {
    shares.fill(1);
    return shares;
  }
  shares = directionWeights(normal / length);
  shares[kNoDirection] = 1;
  return shares;
}

Result<const BrickLeaf*> BrickLookup::leafOf(int level, int direction, const VdbCoord& voxel) {
  const int group = level * kBrickDirections + direction;
  const VdbCoord origin = {voxel[0] & ~7, voxel[1] & ~7, voxel[2] & ~7};
  for (std::size_t i = 0; i < held_count_; ++i) {
    if (held_[i].group == group && held_[i].origin == origin) return held_[i].leaf.get();
  }
  SURFEIT_ASSIGN_OR_RETURN(std::shared_ptr<const BrickLeaf> leaf, pages_.leaf(group, origin));
  Held& held = held_[next_held_];
  next_held_ = (next_held_ + 1) % held_.size();
  held_count_ = std::min(held_count_ + 1, held_.size());
  held = {group, origin, std::move(leaf)};
  return held.leaf.get();
}

// A voxel that is not there was left out when an ancestor is there and has no children: that one
// stands for it, its value differs by no more than the max error. Else there is no surface.
Status BrickLookup::sampleVoxel(int level, int direction, const VdbCoord& voxel, double weight,
                                LevelSample& sample) {
  const std::size_t value_count = pages_.valueCount();
  SURFEIT_ASSIGN_OR_RETURN(const BrickLeaf* leaf, leafOf(level, direction, voxel));
  VdbCoord at = voxel;
  for (int above = level;;) {
    if (leaf != nullptr && leaf->has(placeInLeaf(at))) {
      sample.add(leaf->at(placeInLeaf(at), value_count + 1), weight, value_count);
      return {};
    }
    if (hasSiblings(leaf, at) || ++above == pages_.levelCount()) return {};
    at = parentOf(at);
    // A surface passes through about 4 of the 8 children of a voxel
    weight /= 4;
    SURFEIT_ASSIGN_OR_RETURN(leaf, leafOf(above, direction, at));
  }
}

Status BrickLookup::sample(int level, LevelSample& sample) {
  const double size = pages_.voxelSize(level);
  std::array<std::int32_t, 3> base;
  std::array<double, 3> fraction;
  for (int axis = 0; axis < 3; ++axis) {
    const double place = position_[axis] / size - 0.5;
    // Nothing lies out there, nor at a NaN
    if (!(std::abs(place) < static_cast<double>(kLargestBrickCoordinate))) return {};
    const auto at = static_cast<std::size_t>(axis);
    base[at] = static_cast<std::int32_t>(std::floor(place));
    fraction[at] = place - std::floor(place);
  }
  for (int direction = 0; direction < kBrickDirections; ++direction) {
    const auto share = static_cast<double>(shares_[static_cast<std::size_t>(direction)]);
    if (!(share > 0)) continue;
    for (int corner = 0; corner < 8; ++corner) {
      VdbCoord voxel;
      double weight = share;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const int bit = corner >> (2 - axis) & 1;
        voxel[axis] = base[axis] + bit;
        weight *= bit != 0 ? fraction[axis] : 1 - fraction[axis];
      }
      if (!(weight > 0)) continue;
      SURFEIT_RETURN_IF_ERROR(sampleVoxel(level, direction, voxel, weight, sample));
    }
  }
  return {};
}

Result<bool> BrickLookup::at(int level, std::array<double, kMaxBrickValues>& values) {
  for (; level < pages_.levelCount(); ++level) {
    LevelSample found;
    SURFEIT_RETURN_IF_ERROR(sample(level, found));
    if (!(found.weight > 0)) continue;
    for (std::size_t i = 0; i < pages_.valueCount(); ++i) values[i] = found.sums[i] / found.weight;
    return true;
  }
  return false;
}

}  // namespace

BrickMap::BrickMap(std::unique_ptr<State> state) : state_(std::move(state)) {}
BrickMap::BrickMap(BrickMap&&) noexcept = default;
BrickMap& BrickMap::operator=(BrickMap&&) noexcept = default;
BrickMap::~BrickMap() = default;

Result<BrickMap> BrickMap::open(const std::string& path, std::uint64_t memory_bytes) {
  try {
    auto state = std::make_unique<State>();
    SURFEIT_ASSIGN_OR_RETURN(state->pages, BrickPages::open(path, memory_bytes));
    return BrickMap(std::move(state));
  } catch (const std::bad_alloc&) {
    return Status::failed("out of memory while opening a brick map");
  }
}

const std::vector<BrickChannel>& BrickMap::channels() const { return state_->pages->channels(); }
std::size_t BrickMap::valueCount() const { return state_->pages->valueCount(); }
int BrickMap::levelCount() const { return state_->pages->levelCount(); }
double BrickMap::voxelSize(int level) const { return state_->pages->voxelSize(level); }
std::uint64_t BrickMap::cachedBytes() const { return state_->pages->cachedBytes(); }
std::uint64_t BrickMap::directoryBytes() const { return state_->pages->directoryBytes(); }

Result<bool> BrickMap::lookup(const glm::dvec3& position, const glm::vec3& normal,
                              double filter_width, float* numbers) const {
  const std::span<float> values(numbers, valueCount());
  try {
    std::fill(values.begin(), values.end(), 0.0f);
    const double octaves = filter_width > 0 ? std::log2(filter_width / voxelSize(0)) : 0;
    const double place = std::clamp(octaves, 0.0, static_cast<double>(levelCount() - 1));
    const int level = static_cast<int>(place);
    const double fraction = place - level;

    BrickLookup lookup(*state_->pages, position, normal);
    std::array<double, kMaxBrickValues> fine, coarse;
    SURFEIT_ASSIGN_OR_RETURN(const bool has_fine, lookup.at(level, fine));
    if (!has_fine) return false;  // nor is there anything above
    bool has_coarse = false;
    if (fraction > 0) {
      SURFEIT_ASSIGN_OR_RETURN(has_coarse, lookup.at(level + 1, coarse));
    }
    for (std::size_t i = 0; i < values.size(); ++i) {
      values[i] =
          static_cast<float>(has_coarse ? fine[i] + fraction * (coarse[i] - fine[i]) : fine[i]);
    }
    return true;
  } catch (const std::bad_alloc&) {
    return Status::failed("out of memory while looking up a brick map");
  }
}

}  // namespace surfeit
