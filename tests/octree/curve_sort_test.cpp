#include "octree/build/curve_sort.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "octree/test_scenes.h"

namespace surfeit {
namespace {

// Sorts keys both ways; equal keys must stay in order, which the indices show.
void expectSorted(const std::vector<CurveKey>& keys, const std::string& what) {
  std::vector<Ticket> tickets, scratch(keys.size());
  for (std::size_t i = 0; i < keys.size(); ++i) tickets.push_back({keys[i], i});
  std::vector<Ticket> expected = tickets;
  std::stable_sort(expected.begin(), expected.end(),
                   [](const Ticket& a, const Ticket& b) { return a.key < b.key; });
  sortByKey(tickets, scratch);
  for (std::size_t i = 0; i < keys.size(); ++i) {
    ASSERT_EQ(tickets[i].key, expected[i].key) << what << " " << i;
    ASSERT_EQ(tickets[i].index, expected[i].index) << what << " " << i;
  }
}

TEST(CurveSort, SortsLikeAComparisonSort) {
  TestRandom random(5);
  for (const std::size_t count : {0u, 1u, 2u, 192u, 193u, 5000u, 40000u, 300000u}) {
    std::vector<CurveKey> keys(count);
    for (CurveKey& key : keys) key = (CurveKey{random.bits()} << 31 | random.bits()) >> 1;
    expectSorted(keys, "random " + std::to_string(count));
    for (CurveKey& key : keys) key &= 0xff00000f00ull;
    expectSorted(keys, "few digits " + std::to_string(count));
    for (CurveKey& key : keys) key &= 0x100;
    expectSorted(keys, "two values " + std::to_string(count));
    std::fill(keys.begin(), keys.end(), 77);
    expectSorted(keys, "one value " + std::to_string(count));
    for (std::size_t i = 0; i < count; ++i) keys[i] = count - i;
    expectSorted(keys, "falling " + std::to_string(count));
  }
}

// One bucket of the first pass holds nearly everything, again and again.
TEST(CurveSort, SkewedKeysSortToo) {
  TestRandom random(6);
  std::vector<CurveKey> keys(200000);
  for (CurveKey& key : keys) key = CurveKey{1} << (random.bits() % 62) | (random.bits() & 15);
  keys[0] = CurveKey{1} << 62;
  expectSorted(keys, "powers");
}

TEST(CurveSort, EqualKeysAreOrderedByContent) {
  std::vector<Surfel> cloud = randomCloud(1000);
  std::vector<Ticket> tickets, scratch(cloud.size());
  for (std::size_t i = 0; i < cloud.size(); ++i) tickets.push_back({i % 3, i});
  sortAlongCurve(tickets, scratch, cloud);
  for (std::size_t i = 1; i < tickets.size(); ++i) {
    ASSERT_LE(tickets[i - 1].key, tickets[i].key);
    if (tickets[i - 1].key < tickets[i].key) continue;
    ASSERT_FALSE(contentLess(cloud[tickets[i].index], cloud[tickets[i - 1].index])) << i;
  }
}

}  // namespace
}  // namespace surfeit
