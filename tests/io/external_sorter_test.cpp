#include "storage/external_sorter.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <random>
#include <span>
#include <vector>

#include "io/spill_test.h"

namespace surfeit {
namespace {

constexpr std::size_t kUnitRecords = 511;               // with one checksum
constexpr std::size_t kRunRecords = 36 * kUnitRecords;  // in the least memory

// As large as receivers.
struct SortedRecord {
  std::uint64_t key = 0, index = 0;
  std::array<float, 10> content{};

  bool operator<(const SortedRecord& other) const {
    return key != other.key ? key < other.key : index < other.index;
  }
};
static_assert(sizeof(SortedRecord) == 56);

// Records in random order, `ties` to a key on average.
std::vector<SortedRecord> randomRecords(std::size_t count, std::size_t ties, unsigned seed) {
  std::mt19937_64 random(seed);
  std::vector<SortedRecord> records(count);
  const std::uint64_t keys = count / ties + 1;
  for (std::size_t i = 0; i < count; ++i) {
    const auto x = static_cast<float>(i);
    records[i] = {ties == 1 ? random() : random() % keys, i, {x, -x, 1 / (x + 1)}};
  }
  std::shuffle(records.begin(), records.end(), random);
  return records;
}

std::vector<SortedRecord> sorted(std::vector<SortedRecord> records) {
  std::sort(records.begin(), records.end());
  return records;
}

bool areEqual(std::span<const SortedRecord> a, std::span<const SortedRecord> b) {
  return a.size() == b.size() &&
         (a.empty() || std::memcmp(a.data(), b.data(), a.size_bytes()) == 0);
}

class ExternalSorterTest : public SpillTest {
 protected:
  using Options = ExternalSorter::Options;

  static std::uint64_t leastBytes(std::uint64_t count) {
    return ExternalSorter::leastMemoryBytes(count, sizeof(SortedRecord));
  }

  Options optionsFor(std::uint64_t count, std::uint64_t memory_bytes = 0) const {
    return {.record_bytes = sizeof(SortedRecord),
            .count = count,
            .memory_bytes = std::max(memory_bytes, leastBytes(count)),
            .temporary_directory = directory_.string()};
  }

  static Status addAll(ExternalSorter& sorter, std::span<const SortedRecord> records) {
    for (const SortedRecord& record : records) SURFEIT_RETURN_IF_ERROR(sorter.add(record));
    return sorter.finish();
  }

  // Sorts, and reads with buffers of odd sizes.
  static Status sort(ExternalSorter& sorter, std::span<const SortedRecord> records,
                     std::vector<SortedRecord>& out) {
    SURFEIT_RETURN_IF_ERROR(addAll(sorter, records));
    out.clear();
    std::vector<SortedRecord> buffer;
    for (std::size_t size = 1;; size = size * 3 % 4001) {
      buffer.resize(size);
      SURFEIT_ASSIGN_OR_RETURN(const std::size_t count, sorter.next(buffer));
      out.insert(out.end(), buffer.begin(), buffer.begin() + static_cast<std::ptrdiff_t>(count));
      if (count < size) break;
    }
    SURFEIT_ASSIGN_OR_RETURN(const std::size_t more, sorter.next(buffer));
    EXPECT_EQ(more, 0u);
    EXPECT_EQ(sorter.current(), nullptr);
    return {};
  }

  // Sorts with success; returns the bytes that went to the temporary file.
  std::uint64_t expectSorts(const Options& options, std::span<const SortedRecord> records) {
    ExternalSorter sorter(options);
    std::vector<SortedRecord> out;
    const Status status = sort(sorter, records, out);
    EXPECT_TRUE(status.ok()) << status.message();
    EXPECT_TRUE(areEqual(out, sorted({records.begin(), records.end()})))
        << out.size() << " of " << records.size();
    EXPECT_EQ(sorter.count(), records.size());
    return sorter.temporaryBytes();
  }

  // Sorts again and again in little memory, by several passes.
  std::function<Status()> spillingWork() {
    return [this, records = randomRecords(4 * kRunRecords, 2, 7)]() -> Status {
      Options options = optionsFor(records.size());
      options.most_runs = 2;
      ExternalSorter sorter(options);
      std::vector<SortedRecord> out;
      SURFEIT_RETURN_IF_ERROR(sort(sorter, records, out));
      EXPECT_TRUE(areEqual(out, sorted(records)));
      return {};
    };
  }

  // What comes from the current record on, one by one.
  static std::vector<std::byte> rest(ExternalSorter& sorter, std::size_t record_bytes) {
    std::vector<std::byte> all;
    while (sorter.current() != nullptr) {
      all.insert(all.end(), sorter.current(), sorter.current() + record_bytes);
      EXPECT_TRUE(sorter.advance().ok());
    }
    return all;
  }
};

TEST_F(ExternalSorterTest, SortsAnyNumberInAnyMemory) {
  for (const std::size_t count :
       {std::size_t{0}, std::size_t{1}, std::size_t{2}, kUnitRecords - 1, kUnitRecords,
        kUnitRecords + 1, 3 * kRunRecords - 1, 3 * kRunRecords + 5000, 10 * kRunRecords}) {
    for (const std::size_t ties : {1, 30}) {
      SCOPED_TRACE(testing::Message() << count << " records, " << ties << " per key");
      const auto records = randomRecords(count, ties, static_cast<unsigned>(count + ties));
      const std::uint64_t bytes = count * sizeof(SortedRecord);
      EXPECT_EQ(expectSorts(optionsFor(count), records) == 0, bytes <= leastBytes(count));
      EXPECT_EQ(expectSorts(optionsFor(count, 5 << 20), records) == 0, bytes <= 5 << 20);
      EXPECT_EQ(expectSorts(optionsFor(count, kPlenty), records), 0u);
    }
  }
}

TEST_F(ExternalSorterTest, SortsWhatIsSortedReversedOrAllEqual) {
  auto records = sorted(randomRecords(5 * kRunRecords, 3, 1));
  EXPECT_GT(expectSorts(optionsFor(records.size()), records), 0u);
  std::reverse(records.begin(), records.end());
  EXPECT_GT(expectSorts(optionsFor(records.size()), records), 0u);
  for (SortedRecord& record : records) record.key = ~std::uint64_t{0};
  EXPECT_GT(expectSorts(optionsFor(records.size()), records), 0u);
  for (SortedRecord& record : records) record = records.front();
  EXPECT_GT(expectSorts(optionsFor(records.size()), records), 0u);
}

// Both keys have ties, which the bytes behind order. Going back to a mark brings the same again.
TEST_F(ExternalSorterTest, SortsAnySizeByKeysAndThenByBytes) {
  for (const std::size_t bytes : {16, 20, 40, 512, 30000}) {
    for (const std::size_t all_bytes : {std::size_t{1} << 19, std::size_t{12} << 20}) {
      SCOPED_TRACE(testing::Message() << bytes << " bytes, " << all_bytes);
      std::mt19937_64 random(4);
      std::vector<Bytes> order(all_bytes / bytes);
      std::vector<std::byte> records(order.size() * bytes), expected;
      for (std::byte& byte : records) byte = std::byte(random() % 2 * 255);
      ExternalSorter sorter({.record_bytes = bytes,
                             .memory_bytes = ExternalSorter::kLeastMemory,
                             .temporary_directory = directory_.string()});
      for (std::size_t i = 0; i < order.size(); ++i) {
        std::byte* const record = &records[i * bytes];
        const std::uint64_t keys[2] = {random() % (order.size() / 3), random() % 2};
        std::memcpy(record, keys, sizeof keys);
        order[i] = {record, bytes};
        ASSERT_TRUE(sorter.add(record).ok());
      }
      ASSERT_TRUE(sorter.finish().ok());
      EXPECT_EQ(sorter.temporaryBytes() > 0, all_bytes > ExternalSorter::kLeastMemory);
      std::sort(order.begin(), order.end(),
                [&](Bytes a, Bytes b) { return recordLess(a.data(), b.data(), bytes); });
      for (const Bytes r : order) expected.insert(expected.end(), r.begin(), r.end());

      const ExternalSorter::Mark begin = sorter.mark();
      std::vector<std::byte> half(order.size() / 2 * bytes);
      ASSERT_TRUE(sorter.read(half).ok());
      const ExternalSorter::Mark middle = sorter.mark();
      half = rest(sorter, bytes);
      const ExternalSorter::Mark end = sorter.mark();
      ASSERT_TRUE(sorter.reset(begin).ok());
      EXPECT_TRUE(rest(sorter, bytes) == expected);
      ASSERT_TRUE(sorter.reset(middle).ok());
      EXPECT_TRUE(rest(sorter, bytes) == half);
      ASSERT_TRUE(sorter.reset(end).ok());
      EXPECT_EQ(sorter.current(), nullptr);
    }
  }
}

// Were each digit a call in the one before, the stack would not do
TEST_F(ExternalSorterTest, SortsWhatNoDigitDividesWell) {
  constexpr std::size_t kBytes = 8192;
  std::vector<std::byte> records(kBytes * kBytes);
  for (std::size_t i = 0; i < kBytes; ++i) records[i * kBytes + i] = std::byte(1);
  sortRecords(records.data(), kBytes, kBytes);
  for (std::size_t i = 0; i < kBytes - kRecordKeyBytes; ++i) {
    ASSERT_EQ(records[i * kBytes + kBytes - 1 - i], std::byte(1)) << i;
  }
}

// 30 runs are the most that the least memory merges at once
TEST_F(ExternalSorterTest, MergesInSeveralPassesWhatIsTooManyForOne) {
  const auto records = randomRecords(40 * kRunRecords, 2, 3);
  const std::uint64_t bytes = records.size() * sizeof(SortedRecord);
  const std::uint64_t written = expectSorts(optionsFor(records.size()), records);
  EXPECT_GT(written, bytes + bytes / 5);
  EXPECT_LT(written, 2 * bytes);
  // A quarter of this is the least
  EXPECT_EQ(expectSorts(optionsFor(ExternalSorter::kAnyCount), records), written);
}

TEST_F(ExternalSorterTest, MergesWhileAddingWhenRunsBecomeTooMany) {
  const auto records = randomRecords(12 * kRunRecords, 2, 4);
  for (const std::size_t most_runs : {2, 3, 5, 100}) {
    SCOPED_TRACE(most_runs);
    Options options = optionsFor(records.size());
    options.most_runs = most_runs;
    const std::uint64_t written = expectSorts(options, records);
    EXPECT_EQ(written > 3 * records.size() * sizeof(SortedRecord) / 2, most_runs < 100);
  }
}

TEST_F(ExternalSorterTest, NeedsNoFileForWhatFits) {
  CountCalls calls;
  const Faults faults({&calls});
  const auto records = randomRecords(3 * kRunRecords, 2, 5);
  EXPECT_EQ(expectSorts(optionsFor(records.size()), records), 0u);
  // More were told of than came
  EXPECT_EQ(expectSorts(optionsFor(1000 * kRunRecords), std::span(records).first(kRunRecords)), 0u);
  EXPECT_EQ(calls.count(), 0);
}

TEST_F(ExternalSorterTest, ReadsInLessMemoryThanItSortsIn) {
  const auto records = randomRecords(20 * kRunRecords, 2, 6);
  Options options = optionsFor(records.size(), 24 << 20);
  EXPECT_EQ(expectSorts(options, records), 0u);
  options.reading_bytes = leastBytes(records.size());
  EXPECT_GT(expectSorts(options, records), records.size() * sizeof(SortedRecord));
  options.memory_bytes = 6 << 20;
  EXPECT_GT(expectSorts(options, records), records.size() * sizeof(SortedRecord));
}

TEST_F(ExternalSorterTest, LeastMemoryDoesNotGrowWithTheCount) {
  EXPECT_EQ(leastBytes(0), 0u);
  EXPECT_EQ(leastBytes(1000), 56000u);
  EXPECT_EQ(leastBytes(1'000'000), std::uint64_t{25} << 17);
  EXPECT_EQ(leastBytes(ExternalSorter::kAnyCount), std::uint64_t{25} << 17);
}

TEST_F(ExternalSorterTest, KeepsToItsMemory) {
  const auto records = randomRecords(20 * kRunRecords, 2, 8);
  std::vector<SortedRecord> out;
  {
    ExternalSorter sorter(optionsFor(records.size()));  // what the first allocates once for all
    ASSERT_TRUE(sort(sorter, records, out).ok());
  }
  for (const std::uint64_t memory_bytes :
       {std::uint64_t{0}, std::uint64_t{4} << 20, std::uint64_t{9} << 20, kPlenty}) {
    for (const std::size_t most_runs : {std::size_t{3}, ExternalSorter::kMostRuns}) {
      Options options = optionsFor(records.size(), memory_bytes);
      options.most_runs = most_runs;
      const std::uint64_t most =
          std::min(options.memory_bytes, records.size() * sizeof(SortedRecord));
      PeakMemory peak;
      const Faults faults({&peak});
      ExternalSorter sorter(options);
      peak.look();
      ASSERT_TRUE(sort(sorter, records, out).ok());
      EXPECT_LE(peak.bytes(), most + (16 << 10));  // a mapping's last page; messages
      if (!kHasSanitizer) {
        EXPECT_GT(peak.bytes(), most - most / 10);
      }
    }
  }
}

TEST_F(ExternalSorterTest, ReadsInAQuarterOfItsMemoryUnlessTold) {
  const auto records = randomRecords(40 * kRunRecords, 2, 10);
  for (const std::uint64_t reading_bytes : {std::uint64_t{0}, std::uint64_t{6} << 20}) {
    Options options = optionsFor(ExternalSorter::kAnyCount, 20 << 20);
    options.reading_bytes = reading_bytes;
    const std::size_t most = reading_bytes > 0 ? reading_bytes : options.memory_bytes / 4;
    PeakMemory memory;
    ExternalSorter sorter(options);
    ASSERT_TRUE(addAll(sorter, records).ok());
    memory.look();
    EXPECT_GT(sorter.temporaryBytes(), 0u);
    EXPECT_LE(memory.bytes(), most + (16 << 10));
  }
}

// The disk holds what is still to be read, and a megabyte or so of every run
TEST_F(ExternalSorterTest, GivesTheSpaceOfWhatWasReadBack) {
  const auto records = randomRecords(20 * kRunRecords, 2, 9);
  for (const std::size_t most_runs : {std::size_t{4}, ExternalSorter::kMostRuns}) {
    for (const bool is_marked : {false, true}) {
      Options options = optionsFor(records.size());
      options.most_runs = most_runs;
      ExternalSorter sorter(options);
      ASSERT_TRUE(addAll(sorter, records).ok());
      const std::uint64_t bytes = records.size() * sizeof(SortedRecord);
      EXPECT_LT(diskBytes(), bytes + bytes / 10);
      if (is_marked) (void)sorter.mark();
      std::vector<SortedRecord> out(records.size());
      ASSERT_TRUE(sorter.next(out).ok());
      EXPECT_EQ(diskBytes() < bytes / 10, !is_marked);
    }
  }
}

TEST_F(ExternalSorterTest, EveryCallMayFail) { failEveryCall(spillingWork()); }

TEST_F(ExternalSorterTest, FullDiskIsReported) { expectFullDiskError(spillingWork()); }

TEST_F(ExternalSorterTest, DamageToTheFileIsFound) {
  expectChecksumError(0, spillingWork());                                        // of the checksum
  expectChecksumError(8, spillingWork());                                        // of the first
  expectChecksumError(7 + kUnitRecords * sizeof(SortedRecord), spillingWork());  // and last record
}

// Threads that share a sorter may ask again before they hear of what happened to another
TEST_F(ExternalSorterTest, TheFirstFailureIsFinal) {
  const auto records = randomRecords(10 * kRunRecords, 2, 11);
  std::vector<SortedRecord> out(records.size());
  FailCall first_read(1, EIO, FailCall::Repeat::kOnce, only(Call::kPread));
  FailCall later_read(50, EIO, FailCall::Repeat::kOnce, only(Call::kPread));
  FailCall write(1, EIO, FailCall::Repeat::kOnce, only(Call::kPwrite));
  ThrowAtCall memory(only(Call::kPread));
  for (FaultInjector* fault :
       std::initializer_list<FaultInjector*>{&first_read, &later_read, &write, &memory}) {
    ExternalSorter sorter(optionsFor(records.size() + 1));
    Status failure = Status::failed("out of memory");
    try {
      const Faults faults({fault});
      failure = sort(sorter, records, out);
      EXPECT_EQ(failure.code(), StatusCode::kIoError);
    } catch (const std::bad_alloc&) {
    }
    EXPECT_EQ(sorter.current(), nullptr);
    for (const Status& status :
         {sorter.next(out).status(), sorter.next(out).status(), sorter.advance(), sorter.reset({0}),
          sorter.add(records[0]), sorter.finish()}) {
      EXPECT_EQ(status.code(), failure.code());
      EXPECT_EQ(status.message(), failure.message());
    }
  }
}

TEST_F(ExternalSorterTest, RunningOutOfMemoryLeavesNothing) {
  expectBadAlloc(Call::kOpen, spillingWork());
  expectBadAlloc(Call::kPread, spillingWork());
  if (kHasSanitizer) return;
  const std::uint64_t count = std::uint64_t{1} << 56;
  EXPECT_THROW(ExternalSorter(optionsFor(count, std::uint64_t{1} << 62)), std::bad_alloc);
}

}  // namespace
}  // namespace surfeit
