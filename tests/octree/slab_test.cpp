#include "octree/build/slab.h"

#include <gtest/gtest.h>

#include <cstring>

#include "octree/build/octree_builder.h"
#include "octree/test_scenes.h"

namespace surfeit {
namespace {

// Surfels of given keys, in batches of a given size. Only keys matter to the cutter.
class KeyStream : public SortedSurfelStream {
 public:
  KeyStream(std::span<const CurveKey> keys, std::size_t batch) : keys_(keys), batch_(batch) {}
  Result<std::shared_ptr<const SortedBatch>> next() override {
    const std::size_t count = std::min(batch_, keys_.size() - at_);
    if (count == 0) return std::shared_ptr<const SortedBatch>();
    const auto batch = std::make_shared<SortedBatch>();
    batch->resize(count);
    for (std::size_t i = 0; i < count; ++i) batch->tickets[i] = {keys_[at_ + i], i};
    at_ += count;
    return std::shared_ptr<const SortedBatch>(batch);
  }

 private:
  std::span<const CurveKey> keys_;
  std::size_t batch_, at_ = 0;
};

std::vector<Slab> slabsOf(std::span<const CurveKey> keys, std::size_t batch) {
  KeyStream stream(keys, batch);
  SlabCutter cutter(stream);
  std::vector<Slab> slabs;
  for (;;) {
    Result<std::optional<Slab>> slab = cutter.next();
    EXPECT_TRUE(slab.ok());
    if (!slab.ok() || !slab->has_value()) return slabs;
    slabs.push_back(std::move(**slab));
  }
}

std::vector<CurveKey> randomKeys(std::size_t count) {
  TestRandom random(8);
  std::vector<CurveKey> keys(count);
  // Dense and sparse regions
  for (CurveKey& key : keys) {
    key = (CurveKey{random.bits()} << 31 | random.bits()) >> (random.bits() % 30);
    key &= (CurveKey{1} << 63) - 1;
  }
  std::sort(keys.begin(), keys.end());
  return keys;
}

TEST(SlabCutter, BricksAreTheLargestCellsThatFit) {
  const std::vector<CurveKey> keys = randomKeys(200000);
  std::size_t begin = 0;
  for (const Slab& slab : slabsOf(keys, 50000)) {
    std::size_t brick_begin = begin;
    for (const Brick& brick : slab.bricks) {
      const std::size_t end = begin + brick.end;
      ASSERT_LE(end - brick_begin, kBrickSurfels);
      // All of one cell of the level, and nothing of it outside
      EXPECT_GT(firstDifferentLevel(keys[brick_begin], keys[end - 1]), brick.level);
      if (brick_begin > 0) {
        EXPECT_LE(firstDifferentLevel(keys[brick_begin - 1], keys[brick_begin]), brick.level);
      }
      if (end < keys.size()) {
        EXPECT_LE(firstDifferentLevel(keys[end - 1], keys[end]), brick.level);
        EXPECT_EQ(firstDifferentLevel(keys[end - 1], keys[end]), brick.boundary_level);
      } else {
        EXPECT_EQ(brick.boundary_level, 0);
      }
      // The cell above would hold too many, or begin before
      if (brick.level > 0) {
        const int above = brick.level - 1;
        const bool begins_before =
            brick_begin > 0 &&
            firstDifferentLevel(keys[brick_begin - 1], keys[brick_begin]) > above;
        const bool holds_too_many =
            brick_begin + kBrickSurfels < keys.size() &&
            firstDifferentLevel(keys[brick_begin], keys[brick_begin + kBrickSurfels]) > above;
        EXPECT_TRUE(begins_before || holds_too_many);
      }
      brick_begin = end;
    }
    begin += slab.surfel_count;
  }
  EXPECT_EQ(begin, keys.size());
}

TEST(SlabCutter, BatchesDoNotShow) {
  const std::vector<CurveKey> keys = randomKeys(100000);
  const std::vector<Slab> expected = slabsOf(keys, keys.size());
  for (const std::size_t batch : {777u, 16384u, 99999u}) {
    const std::vector<Slab> found = slabsOf(keys, batch);
    ASSERT_EQ(found.size(), expected.size());
    for (std::size_t i = 0; i < found.size(); ++i) {
      EXPECT_EQ(found[i].surfel_count, expected[i].surfel_count);
      ASSERT_EQ(found[i].bricks.size(), expected[i].bricks.size());
    }
  }
}

TEST(SlabCutter, OneKeyWithMoreThanABrickIsAGiant) {
  std::vector<CurveKey> keys = randomKeys(1000);
  keys.insert(keys.begin() + 500, 2 * kBrickSurfels + 5, keys[500]);
  std::size_t pieces = 0, surfels = 0;
  for (const Slab& slab : slabsOf(keys, 3000)) {
    surfels += slab.surfel_count;
    if (!slab.giant) continue;
    EXPECT_EQ(slab.giant->begins, pieces == 0);
    EXPECT_EQ(slab.giant->ends, pieces == 2);
    EXPECT_EQ(slab.surfel_count, pieces < 2 ? kBrickSurfels : 6);
    ++pieces;
  }
  EXPECT_EQ(pieces, 3u);
  EXPECT_EQ(surfels, keys.size());
}

// The surfels of a cloud up to a place where slabs begin anew, and those behind it, have the slabs
// of the whole, whatever comes before and after.
TEST(SlabCutter, SlabsBeginAnewBehindGreatCells) {
  const std::vector<CurveKey> keys = randomKeys(500000);
  const std::vector<Slab> whole = slabsOf(keys, 30000);
  std::size_t place = 0, cuts = 0;
  for (std::size_t s = 0; s < whole.size(); place += whole[s++].surfel_count) {
    if (place == 0) continue;
    const int level = firstDifferentLevel(keys[place - 1], keys[place]);
    const int shift = 3 * (kCurveLevels - level + 1);
    const CurveKey cell = keys[place] >> shift << shift;
    const auto begin = std::lower_bound(keys.begin(), keys.end(), cell) - keys.begin();
    if (place - std::size_t(begin) < kFreshSurfels) continue;
    ++cuts;
    const std::span<const CurveKey> all = keys;
    KeyStream stream(all.subspan(place), 7000);
    SlabCutter cutter(stream, {level, 0});
    for (std::size_t i = s; i < whole.size(); ++i) {
      const Result<std::optional<Slab>> slab = cutter.next();
      ASSERT_TRUE(slab.ok() && slab->has_value());
      ASSERT_EQ((*slab)->surfel_count, whole[i].surfel_count);
      ASSERT_EQ((*slab)->bricks.size(), whole[i].bricks.size());
      for (std::size_t b = 0; b < whole[i].bricks.size(); ++b) {
        ASSERT_EQ((*slab)->bricks[b].end, whole[i].bricks[b].end);
        ASSERT_EQ((*slab)->bricks[b].level, whole[i].bricks[b].level);
        ASSERT_EQ((*slab)->bricks[b].boundary_level, whole[i].bricks[b].boundary_level);
      }
    }
    // What is before does not ask for what is behind
    KeyStream front(all.first(place), 7000);
    SlabCutter front_cutter(front, {0, level});
    for (std::size_t i = 0; i < s; ++i) {
      const Result<std::optional<Slab>> slab = front_cutter.next();
      ASSERT_TRUE(slab.ok() && slab->has_value());
      ASSERT_EQ((*slab)->surfel_count, whole[i].surfel_count);
      ASSERT_EQ((*slab)->bricks.back().level, whole[i].bricks.back().level);
      ASSERT_EQ((*slab)->bricks.back().boundary_level, whole[i].bricks.back().boundary_level);
    }
  }
  EXPECT_GE(cuts, 3u);
}

}  // namespace
}  // namespace surfeit
