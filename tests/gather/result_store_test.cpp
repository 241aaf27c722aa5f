#include "batch/result_store.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>
#include <random>
#include <span>
#include <thread>
#include <vector>

#include "io/spill_test.h"

namespace surfeit {
namespace {

using Entry = ResultStore::Entry;

constexpr std::size_t kSpilled = 300'000;  // many buckets in the least memory

GatherResult resultOf(std::uint64_t index) {
  const auto x = static_cast<float>(index);
  return {.occlusion = 1 / (x + 1), .irradiance = {x, x + 1, -x}};
}

// Entries of three indices in four, in random order.
std::vector<Entry> randomEntries(std::size_t count, unsigned seed) {
  std::mt19937_64 random(seed);
  std::vector<Entry> entries;
  for (std::size_t i = 0; i < count; ++i) {
    if (random() % 4 != 0) entries.push_back({i, resultOf(i)});
  }
  std::shuffle(entries.begin(), entries.end(), random);
  return entries;
}

bool isMissing(const GatherResult& result) {
  return std::isnan(result.occlusion) && std::isnan(result.irradiance.x) &&
         std::isnan(result.irradiance.y) && std::isnan(result.irradiance.z);
}

class ResultStoreTest : public SpillTest {
 protected:
  using Options = ResultStore::Options;

  Options optionsFor(std::size_t count, std::uint64_t memory_bytes = 0) const {
    const std::uint64_t least = ResultStore::leastMemoryBytes(count);
    return {.count = count,
            .memory_bytes = std::max(memory_bytes, least),
            .temporary_directory = directory_.string()};
  }

  // Puts by runs of a few sizes.
  static Status putAll(ResultStore& store, std::span<const Entry> entries) {
    for (std::size_t size = 1; !entries.empty(); size = size * 5 % 509) {
      size = std::min(size, entries.size());
      SURFEIT_RETURN_IF_ERROR(store.put(entries.first(size)));
      entries = entries.subspan(size);
    }
    return {};
  }

  // Takes `count` results by spans of odd sizes; all of `entries` are there, and NaN elsewhere.
  static Status takeAll(ResultStore& store, std::size_t count, std::span<const Entry> entries) {
    SURFEIT_RETURN_IF_ERROR(store.finish());
    std::vector<GatherResult> results(count);
    std::span<GatherResult> left(results);
    for (std::size_t size = 1; !left.empty(); size = size * 3 % 70001) {
      size = std::min(size, left.size());
      SURFEIT_RETURN_IF_ERROR(store.take(left.first(size)));
      left = left.subspan(size);
    }
    SURFEIT_RETURN_IF_ERROR(store.take({}));
    std::vector<bool> was_put(count);
    std::size_t wrong = 0;
    for (const Entry& entry : entries) {
      was_put[entry.index] = true;
      wrong += std::memcmp(&results[entry.index], &entry.result, sizeof entry.result) != 0;
    }
    for (std::size_t i = 0; i < count; ++i) wrong += !was_put[i] && !isMissing(results[i]);
    EXPECT_EQ(wrong, 0u) << "of " << count;
    return {};
  }

  // With success; returns the bytes that went to the temporary file.
  std::uint64_t expectRestores(const Options& options, std::span<const Entry> entries) {
    ResultStore store(options);
    EXPECT_TRUE(putAll(store, entries).ok());
    const Status status = takeAll(store, options.count, entries);
    EXPECT_TRUE(status.ok()) << status.message();
    return store.temporaryBytes();
  }

  std::function<Status()> spillingWork() {
    std::vector<Entry> some = randomEntries(kSpilled, 3);
    some.resize(60'000);
    return [this, entries = std::move(some)]() -> Status {
      ResultStore store(optionsFor(kSpilled));
      SURFEIT_RETURN_IF_ERROR(putAll(store, entries));
      return takeAll(store, kSpilled, entries);
    };
  }
};

TEST_F(ResultStoreTest, RestoresTheOrderOfAnyNumberInAnyMemory) {
  for (const std::size_t count : {0, 1, 2, 1000, 150'001, 300'000, 700'001}) {
    SCOPED_TRACE(count);
    const std::vector<Entry> entries = randomEntries(count, static_cast<unsigned>(count));
    const std::uint64_t bytes = count * (4 * sizeof(float));
    EXPECT_EQ(expectRestores(optionsFor(count), entries) == 0,
              bytes <= ResultStore::leastMemoryBytes(count));
    EXPECT_EQ(expectRestores(optionsFor(count, 3 << 20), entries) == 0, bytes <= 3 << 20);
    EXPECT_EQ(expectRestores(optionsFor(count, 8 << 20), entries) == 0, bytes <= 8 << 20);
    EXPECT_EQ(expectRestores(optionsFor(count, kPlenty), entries), 0u);
  }
}

TEST_F(ResultStoreTest, WritesCompactRecords) {
  const std::vector<Entry> entries = randomEntries(500'000, 2);
  const std::uint64_t written = expectRestores(optionsFor(500'000, 4 << 20), entries);
  EXPECT_LT(written, entries.size() * 21);
}

TEST_F(ResultStoreTest, WhatWasNeverPutIsNan) {
  const Options options = optionsFor(kSpilled);
  EXPECT_EQ(expectRestores(options, {}), 0u);
  const std::vector<Entry> ends = {{kSpilled - 1, resultOf(1)}, {0, resultOf(2)}};
  EXPECT_GT(expectRestores(options, ends), 0u);
}

TEST_F(ResultStoreTest, ReadsInMoreOrLessMemoryThanItWritesIn) {
  const std::vector<Entry> entries = randomEntries(kSpilled, 5);
  const std::uint64_t least = ResultStore::leastMemoryBytes(kSpilled);
  Options options = optionsFor(kSpilled);
  options.reading_bytes = kPlenty;
  EXPECT_GT(expectRestores(options, entries), 0u);
  options.memory_bytes = kPlenty;
  options.reading_bytes = least;
  EXPECT_GT(expectRestores(options, entries), 0u);
}

TEST_F(ResultStoreTest, ThreadsPutAtOnce) {
  constexpr std::size_t kThreads = 8;
  const std::vector<Entry> entries = randomEntries(kSpilled, 6);
  for (const std::uint64_t memory_bytes : {std::uint64_t{0}, kPlenty}) {
    ResultStore store(optionsFor(kSpilled, memory_bytes));
    std::vector<std::thread> threads;
    for (std::size_t t = 0; t < kThreads; ++t) {
      const std::size_t begin = entries.size() * t / kThreads;
      const std::size_t end = entries.size() * (t + 1) / kThreads;
      threads.emplace_back([&store, part = std::span(entries).subspan(begin, end - begin)] {
        EXPECT_TRUE(putAll(store, part).ok());
        EXPECT_LT(store.temporaryBytes(), kPlenty);
      });
    }
    for (std::thread& thread : threads) thread.join();
    EXPECT_TRUE(takeAll(store, kSpilled, entries).ok());
  }
}

TEST_F(ResultStoreTest, LeastMemoryGrowsWithTheSquareRootOfTheCount) {
  EXPECT_EQ(ResultStore::leastMemoryBytes(0), 0u);
  EXPECT_EQ(ResultStore::leastMemoryBytes(1000), 16000u);
  EXPECT_LE(ResultStore::leastMemoryBytes(1'000'000), std::uint64_t{3} << 20);
  EXPECT_LE(ResultStore::leastMemoryBytes(500'000'000), std::uint64_t{14} << 20);
  EXPECT_LT(ResultStore::leastMemoryBytes(~std::uint64_t{0}), std::uint64_t{1} << 50);
  std::uint64_t before = 0;
  for (std::uint64_t count = 1; count < std::uint64_t{1} << 40; count += count / 7 + 1) {
    const std::uint64_t least = ResultStore::leastMemoryBytes(count);
    EXPECT_GE(least, before) << count;
    before = least;
  }
}

// Any memory from the least on is accepted, before and after
TEST_F(ResultStoreTest, AcceptsEveryMemoryFromTheLeastOn) {
  constexpr std::uint64_t kMuch = std::uint64_t{1} << 26;
  for (const std::uint64_t count : {400'000ull, 7'654'321ull, 1'000'000'000ull}) {
    const std::uint64_t least = ResultStore::leastMemoryBytes(count);
    for (std::uint64_t bytes = least; bytes < least + (1 << 20); bytes += 10007) {
      Options options{.count = count,
                      .memory_bytes = bytes,
                      .reading_bytes = kMuch,
                      .temporary_directory = directory_.string()};
      const ResultStore more_later(options);
      std::swap(options.memory_bytes, options.reading_bytes);
      const ResultStore less_later(options);
    }
  }
}

TEST_F(ResultStoreTest, KeepsToItsMemory) {
  const std::vector<Entry> entries = randomEntries(800'000, 7);
  std::vector<GatherResult> slice(1000);
  for (const std::uint64_t memory_bytes :
       {std::uint64_t{0}, std::uint64_t{4} << 20, std::uint64_t{9} << 20, kPlenty}) {
    const Options options = optionsFor(800'000, memory_bytes);
    const std::uint64_t most = std::min(options.memory_bytes, options.count * (4 * sizeof(float)));
    PeakMemory peak;
    const Faults faults({&peak});
    ResultStore store(options);
    peak.look();
    ASSERT_TRUE(putAll(store, entries).ok());
    peak.look();
    ASSERT_TRUE(store.finish().ok());
    for (std::size_t i = 0; i < options.count; i += slice.size()) {
      ASSERT_TRUE(store.take(slice).ok());
      peak.look();
    }
    EXPECT_LE(peak.bytes(), most + (16 << 10));  // a mapping's last page; messages
    if (!kHasSanitizer) {
      EXPECT_GT(peak.bytes(), most - most / 5);
    }
  }
}

TEST_F(ResultStoreTest, GivesTheSpaceOfWhatWasTakenBack) {
  const std::vector<Entry> entries = randomEntries(kSpilled, 8);
  ResultStore store(optionsFor(kSpilled));
  ASSERT_TRUE(putAll(store, entries).ok());
  ASSERT_TRUE(takeAll(store, kSpilled, entries).ok());
  EXPECT_GT(store.temporaryBytes(), std::uint64_t{4} << 20);
  EXPECT_LT(diskBytes(), std::uint64_t{1} << 18);
}

TEST_F(ResultStoreTest, EveryCallMayFail) { failEveryCall(spillingWork()); }

TEST_F(ResultStoreTest, FullDiskIsReported) { expectFullDiskError(spillingWork()); }

TEST_F(ResultStoreTest, DamageToTheFileIsFound) {
  expectChecksumError(0, spillingWork());   // of the checksum
  expectChecksumError(8, spillingWork());   // of the way to the block before
  expectChecksumError(16, spillingWork());  // of the first record
}

TEST_F(ResultStoreTest, RunningOutOfMemoryLeavesNothing) {
  expectBadAlloc(Call::kOpen, spillingWork());
  expectBadAlloc(Call::kPread, spillingWork());
  if (kHasSanitizer) return;
  const std::uint64_t count = std::uint64_t{1} << 58;
  EXPECT_THROW(ResultStore(optionsFor(count, std::uint64_t{1} << 62)), std::bad_alloc);
}

}  // namespace
}  // namespace surfeit
