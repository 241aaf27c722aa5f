#include "surfels/generated/scene_generator.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <glm/geometric.hpp>

#include "core/assert.h"
#include "core/square_strata.h"

namespace surfeit {
namespace {

constexpr int kGuideBits = 16;
constexpr std::uint64_t kDuplicateKey = 0x6475706C69636174u;

}  // namespace

RecordPermutation::RecordPermutation(std::uint64_t count, std::uint64_t seed)
    : count_(count), key_(mixBits(seed ^ 0x7065726D75746521u)) {
  const int bits = std::max(2, int(std::bit_width(count - 1)));
  low_bits_ = bits / 2;
  high_bits_ = bits - low_bits_;
}

std::uint64_t RecordPermutation::operator()(std::uint64_t index) const {
  const std::uint64_t low_mask = (std::uint64_t{1} << low_bits_) - 1;
  const std::uint64_t high_mask = (std::uint64_t{1} << high_bits_) - 1;
  // A step maps the numbers of all bits one to one; walking on from a number in the range, the
  // first to come back into it is that of no other
  do {
    std::uint64_t low = index & low_mask, high = index >> low_bits_;
    for (std::uint64_t round = 0; round < 4; round += 2) {
      low ^= hashOf(key_ + round, high) & low_mask;
      high ^= hashOf(key_ + round + 1, low) & high_mask;
    }
    index = (high << low_bits_) | low;
  } while (index >= count_);
  return index;
}

Result<SceneGenerator> SceneGenerator::create(const SceneRecipe& recipe) {
  SURFEIT_RETURN_IF_ERROR(checkSceneRecipe(recipe));
  return SceneGenerator(recipe);
}

SceneGenerator::SceneGenerator(const SceneRecipe& recipe)
    : recipe_(recipe),
      permutation_(recipe.surfels, recipe.seed),
      duplicate_limit_(std::uint64_t(recipe.duplicate_percent / 100 * 0x1p32)),
      surfaces_(makeSceneSurfaces(recipe.kind, recipe.seed)) {
  // The outlier is the last record of all
  const std::uint64_t total = recipe.surfels + (recipe.outlier_distance > 0 ? 1 : 0);
  const auto partBegin = [&](std::uint64_t part) {  // 2^40 records times 2^32 parts need 128 bits
    const std::uint64_t quotient = total / recipe.part_count, rest = total % recipe.part_count;
    return part * quotient + part * rest / recipe.part_count;
  };
  begin_ = partBegin(recipe.part - 1);
  end_ = partBegin(recipe.part);
  placeSurfels();
}

// Deals the surfels to the surfaces by area, as sampling of meshes does: one ends where the sum of
// areas so far, rounded to surfels, ends.
void SceneGenerator::placeSurfels() {
  for (const Surface& surface : surfaces_) area_ += double(surface.area);
  area_share_ = area_ / double(recipe_.surfels);
  placed_.resize(surfaces_.size() + 1);
  double area_before = 0;
  for (std::size_t i = 0; i < surfaces_.size(); ++i) {
    const Surface& surface = surfaces_[i];
    Placed& placed = placed_[i];
    placed.key = hashOf(recipe_.seed, i);
    area_before += double(surface.area);
    placed_[i + 1].first =
        std::uint64_t(std::floor(area_before / area_ * double(recipe_.surfels) + 0.5));
    const std::uint64_t count = placed_[i + 1].first - placed.first;
    if (count > 0) placed.rows = cellRows(surface, count);
  }
  SURFEIT_CHECK(placed_.back().first == recipe_.surfels);

  // A guide to the surfaces
  guide_shift_ = std::max(0, int(std::bit_width(recipe_.surfels - 1)) - kGuideBits);
  std::size_t surface = 0;
  for (std::uint64_t begin = 0; begin < recipe_.surfels;
       begin += std::uint64_t{1} << guide_shift_) {
    while (placed_[surface + 1].first <= begin) ++surface;
    guide_.push_back(std::uint32_t(surface));
  }
}

CloudChannels SceneGenerator::channels() const {
  CloudChannels channels;
  channels.radius = channels.area = channels.radiosity = channels.albedo = true;
  channels.normal = recipe_.kind != SceneKind::kVolume;
  channels.two_sided = recipe_.kind == SceneKind::kCity;
  return channels;
}

// The record that `record` repeats, or itself. Each step leads to an earlier record.
std::uint64_t SceneGenerator::originalOf(std::uint64_t record) const {
  while (record > 0) {
    const std::uint64_t hash = hashOf(recipe_.seed ^ kDuplicateKey, record);
    if ((hash >> 32) >= duplicate_limit_) break;
    record = mixBits(hash) % record;
  }
  return record;
}

std::size_t SceneGenerator::surfaceOf(std::uint64_t position) const {
  std::size_t surface = guide_[position >> guide_shift_];
  while (placed_[surface + 1].first <= position) ++surface;
  return surface;
}

// A ball of a square metre beside the world.
Surfel SceneGenerator::outlier() const {
  Surfel surfel;
  surfel.position = glm::vec3(0.5 * kWorldExtent + recipe_.outlier_distance, 0.5 * kWorldExtent, 0);
  surfel.radius = 0.6f;
  surfel.area = 1;
  if (recipe_.kind == SceneKind::kVolume) {
    surfel.flags = kSurfelSphere;
  } else {
    surfel.normal = {0, 0, 1};
  }
  surfel.albedo = surfel.radiosity = glm::vec3(0.5f);
  return surfel;
}

void SceneGenerator::generate(std::uint64_t first_record, std::span<Surfel> surfels) const {
  SURFEIT_ASSERT(first_record + surfels.size() <= recordCount());
  std::size_t surface = 0;
  for (std::size_t i = 0; i < surfels.size(); ++i) {
    std::uint64_t record = begin_ + first_record + i;
    if (record == recipe_.surfels) {
      surfels[i] = outlier();
      continue;
    }
    if (duplicate_limit_ > 0) record = originalOf(record);
    const std::uint64_t position =
        recipe_.order == RecordOrder::kShuffled ? permutation_(record) : record;

    // Mostly the surface of the surfel before
    if (position < placed_[surface].first || position >= placed_[surface + 1].first) {
      surface = surfaceOf(position);
    }
    const Placed& placed = placed_[surface];
    const std::uint64_t count = placed_[surface + 1].first - placed.first;
    surfels[i] = makeSurfaceSurfel(
        surfaces_[surface], {placed.key, count, placed.rows, area_share_}, position - placed.first);
  }
}

}  // namespace surfeit
