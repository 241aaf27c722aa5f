#include "octree/surfel_sorter.h"

#include <gtest/gtest.h>

#include <cstring>

#include "octree/test_scenes.h"

namespace surfeit {
namespace {

class SurfelSorterTest : public DirectoryTest {
 protected:
  // All surfels of a cloud through a sorter, taken `step` at a time.
  std::vector<SortedSurfel> sorted(const std::vector<Surfel>& cloud, std::size_t capacity,
                                   std::size_t step) {
    Result<std::unique_ptr<SurfelSorter>> sorter =
        SurfelSorter::create(capacity, cloud.size(), {}, directory_.string());
    EXPECT_TRUE(sorter.ok());
    for (std::size_t at = 0; at < cloud.size(); at += 1000) {
      const std::size_t count = std::min<std::size_t>(1000, cloud.size() - at);
      EXPECT_TRUE((*sorter)->add(std::span(cloud).subspan(at, count)).ok());
    }
    EXPECT_TRUE((*sorter)->finish().ok());
    EXPECT_EQ((*sorter)->temporaryBytes(), cloud.size() > std::max<std::size_t>(capacity, 1024)
                                               ? cloud.size() * sizeof(SortedSurfel)
                                               : 0);
    std::vector<SortedSurfel> all, batch(step);
    for (;;) {
      const Result<std::size_t> count = (*sorter)->next(batch);
      EXPECT_TRUE(count.ok());
      if (!count.ok() || *count == 0) break;
      all.insert(all.end(), batch.begin(), batch.begin() + static_cast<std::ptrdiff_t>(*count));
    }
    return all;
  }
};

TEST_F(SurfelSorterTest, SpilledRunsMergeToWhatMemoryGives) {
  std::vector<Surfel> cloud = randomCloud(20000);
  for (std::size_t i = 0; i < 5000; ++i) cloud[i].position = cloud[i % 10].position;
  for (std::size_t i = 0; i < 1000; ++i) cloud[i] = cloud[0];
  const std::vector<SortedSurfel> expected = sorted(cloud, 1 << 20, 4096);
  ASSERT_EQ(expected.size(), cloud.size());
  for (std::size_t i = 1; i < expected.size(); ++i) {
    const SortedSurfel& a = expected[i - 1];
    const SortedSurfel& b = expected[i];
    ASSERT_TRUE(a.key < b.key || (a.key == b.key && !contentLess(b.surfel, a.surfel)));
    ASSERT_EQ(b.key, curveKey(b.surfel.position, {}));
  }
  for (const std::size_t capacity : {0u, 1024u, 1025u, 6666u, 19999u, 20000u}) {
    for (const std::size_t step : {1u, 17u, 4096u, 50000u}) {
      const std::vector<SortedSurfel> found = sorted(cloud, capacity, step);
      ASSERT_EQ(found.size(), expected.size());
      ASSERT_EQ(std::memcmp(found.data(), expected.data(), found.size() * sizeof(SortedSurfel)), 0)
          << capacity << ' ' << step;
    }
  }
  EXPECT_EQ(fileCount(), 0);
}

TEST_F(SurfelSorterTest, NothingInNothingOut) { EXPECT_TRUE(sorted({}, 1024, 10).empty()); }

TEST_F(SurfelSorterTest, SpillingWithoutADirectoryIsAnIoError) {
  Result<std::unique_ptr<SurfelSorter>> sorter =
      SurfelSorter::create(1024, 5000, {}, path("nowhere"));
  ASSERT_TRUE(sorter.ok());
  EXPECT_EQ((*sorter)->add(randomCloud(5000)).code(), StatusCode::kIoError);
}

}  // namespace
}  // namespace surfeit
