#include "batch/receiver_sorter.h"

#include <algorithm>
#include <cstring>
#include <random>
#include <span>
#include <vector>

#include "io/spill_test.h"

namespace surfeit {
namespace {

constexpr std::size_t kRunReceivers = 17857;  // no less than a run in the least memory has

// Receivers in random order, `ties` to a key on average.
std::vector<SortedReceiver> randomReceivers(std::size_t count, std::size_t ties, unsigned seed) {
  std::mt19937_64 random(seed);
  std::vector<SortedReceiver> receivers(count);
  const std::uint64_t keys = count / ties + 1;
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint64_t key = ties == 1 ? random() >> 1 : random() % keys;
    const auto x = static_cast<float>(i);
    receivers[i] = {key, i, {.position = {x, -x, 1 / (x + 1)}, .normal = {0, 0, 1}}};
  }
  std::shuffle(receivers.begin(), receivers.end(), random);
  return receivers;
}

std::vector<SortedReceiver> sorted(std::vector<SortedReceiver> receivers) {
  std::sort(receivers.begin(), receivers.end());
  return receivers;
}

bool areEqual(std::span<const SortedReceiver> a, std::span<const SortedReceiver> b) {
  return a.size() == b.size() &&
         (a.empty() || std::memcmp(a.data(), b.data(), a.size_bytes()) == 0);
}

class ReceiverSorterTest : public SpillTest {
 protected:
  using Options = ReceiverSorter::Options;

  Options optionsFor(std::size_t count, std::uint64_t memory_bytes = 0) const {
    const std::uint64_t least = ReceiverSorter::leastMemoryBytes(count);
    return {.count = count,
            .memory_bytes = std::max(memory_bytes, least),
            .temporary_directory = directory_.string()};
  }

  // Sorts, and reads with buffers of odd sizes.
  static Status sort(ReceiverSorter& sorter, std::span<const SortedReceiver> receivers,
                     std::vector<SortedReceiver>& out) {
    for (const SortedReceiver& receiver : receivers) {
      SURFEIT_RETURN_IF_ERROR(sorter.add(receiver));
    }
    SURFEIT_RETURN_IF_ERROR(sorter.finish());
    out.clear();
    std::vector<SortedReceiver> buffer;
    for (std::size_t size = 1;; size = size * 3 % 4001) {
      buffer.resize(size);
      SURFEIT_ASSIGN_OR_RETURN(const std::size_t count, sorter.next(buffer));
      out.insert(out.end(), buffer.begin(), buffer.begin() + static_cast<std::ptrdiff_t>(count));
      if (count < size) break;
    }
    SURFEIT_ASSIGN_OR_RETURN(const std::size_t more, sorter.next(buffer));
    EXPECT_EQ(more, 0u);
    return {};
  }

  // Sorts with success; returns the bytes that went to the temporary file.
  std::uint64_t expectSorts(const Options& options, std::span<const SortedReceiver> receivers) {
    ReceiverSorter sorter(options);
    std::vector<SortedReceiver> out;
    const Status status = sort(sorter, receivers, out);
    EXPECT_TRUE(status.ok()) << status.message();
    EXPECT_TRUE(areEqual(out, sorted({receivers.begin(), receivers.end()})))
        << out.size() << " of " << receivers.size();
    return sorter.temporaryBytes();
  }

  // Sorts again and again in little memory, by several passes.
  std::function<Status()> spillingWork() {
    return [this, receivers = randomReceivers(4 * kRunReceivers, 2, 7)]() -> Status {
      Options options = optionsFor(receivers.size());
      options.most_runs = 2;
      ReceiverSorter sorter(options);
      std::vector<SortedReceiver> out;
      SURFEIT_RETURN_IF_ERROR(sort(sorter, receivers, out));
      EXPECT_TRUE(areEqual(out, sorted(receivers)));
      return {};
    };
  }
};

TEST_F(ReceiverSorterTest, SortsAnyNumberInAnyMemory) {
  const std::size_t unit = 511;  // receivers of a checksum
  for (const std::size_t count :
       {std::size_t{0}, std::size_t{1}, std::size_t{2}, unit - 1, unit, unit + 1,
        3 * kRunReceivers - 1, 3 * kRunReceivers + 5000, 10 * kRunReceivers}) {
    for (const std::size_t ties : {1, 30}) {
      SCOPED_TRACE(testing::Message() << count << " receivers, " << ties << " per key");
      const auto receivers = randomReceivers(count, ties, static_cast<unsigned>(count + ties));
      const bool fits = count * sizeof(SortedReceiver) <= ReceiverSorter::leastMemoryBytes(count);
      EXPECT_EQ(expectSorts(optionsFor(count), receivers) == 0, fits);
      EXPECT_EQ(expectSorts(optionsFor(count, 5 << 20), receivers) == 0,
                count * sizeof(SortedReceiver) <= 5 << 20);
      EXPECT_EQ(expectSorts(optionsFor(count, kPlenty), receivers), 0u);
    }
  }
}

TEST_F(ReceiverSorterTest, SortsWhatIsSortedReversedOrAllEqual) {
  auto receivers = sorted(randomReceivers(5 * kRunReceivers, 3, 1));
  EXPECT_GT(expectSorts(optionsFor(receivers.size()), receivers), 0u);
  std::reverse(receivers.begin(), receivers.end());
  EXPECT_GT(expectSorts(optionsFor(receivers.size()), receivers), 0u);
  for (SortedReceiver& receiver : receivers) receiver.key = 12345;
  EXPECT_GT(expectSorts(optionsFor(receivers.size()), receivers), 0u);
}

// 30 runs are the most that the least memory merges at once
TEST_F(ReceiverSorterTest, MergesInSeveralPassesWhatIsTooManyForOne) {
  const auto receivers = randomReceivers(40 * kRunReceivers, 2, 3);
  const std::uint64_t bytes = receivers.size() * sizeof(SortedReceiver);
  const std::uint64_t written = expectSorts(optionsFor(receivers.size()), receivers);
  EXPECT_GT(written, bytes + bytes / 5);
  EXPECT_LT(written, 2 * bytes);
}

TEST_F(ReceiverSorterTest, MergesWhileAddingWhenRunsBecomeTooMany) {
  const auto receivers = randomReceivers(12 * kRunReceivers, 2, 4);
  for (const std::size_t most_runs : {2, 3, 5, 100}) {
    SCOPED_TRACE(most_runs);
    Options options = optionsFor(receivers.size());
    options.most_runs = most_runs;
    const std::uint64_t written = expectSorts(options, receivers);
    EXPECT_EQ(written > 3 * receivers.size() * sizeof(SortedReceiver) / 2, most_runs < 100);
  }
}

TEST_F(ReceiverSorterTest, NeedsNoFileForWhatFits) {
  CountCalls calls;
  const Faults faults({&calls});
  const auto receivers = randomReceivers(3 * kRunReceivers, 2, 5);
  EXPECT_EQ(expectSorts(optionsFor(receivers.size()), receivers), 0u);
  // More were told of than came
  EXPECT_EQ(
      expectSorts(optionsFor(1000 * kRunReceivers), std::span(receivers).first(kRunReceivers)), 0u);
  EXPECT_EQ(calls.count(), 0);
}

TEST_F(ReceiverSorterTest, ReadsInLessMemoryThanItSortsIn) {
  const auto receivers = randomReceivers(20 * kRunReceivers, 2, 6);
  Options options = optionsFor(receivers.size(), 24 << 20);
  EXPECT_EQ(expectSorts(options, receivers), 0u);
  options.reading_bytes = ReceiverSorter::leastMemoryBytes(receivers.size());
  EXPECT_GT(expectSorts(options, receivers), receivers.size() * sizeof(SortedReceiver));
  options.memory_bytes = 6 << 20;
  EXPECT_GT(expectSorts(options, receivers), receivers.size() * sizeof(SortedReceiver));
}

TEST_F(ReceiverSorterTest, LeastMemoryDoesNotGrowWithTheCount) {
  EXPECT_EQ(ReceiverSorter::leastMemoryBytes(0), 0u);
  EXPECT_EQ(ReceiverSorter::leastMemoryBytes(1000), 56000u);
  EXPECT_EQ(ReceiverSorter::leastMemoryBytes(1'000'000), std::uint64_t{25} << 17);
  EXPECT_EQ(ReceiverSorter::leastMemoryBytes(~std::uint64_t{0}), std::uint64_t{25} << 17);
}

TEST_F(ReceiverSorterTest, KeepsToItsMemory) {
  const auto receivers = randomReceivers(20 * kRunReceivers, 2, 8);
  std::vector<SortedReceiver> out;
  {
    ReceiverSorter sorter(optionsFor(receivers.size()));  // what the first allocates once for all
    ASSERT_TRUE(sort(sorter, receivers, out).ok());
  }
  for (const std::uint64_t memory_bytes :
       {std::uint64_t{0}, std::uint64_t{4} << 20, std::uint64_t{9} << 20, kPlenty}) {
    for (const std::size_t most_runs : {std::size_t{3}, ReceiverSorter::kMostRuns}) {
      Options options = optionsFor(receivers.size(), memory_bytes);
      options.most_runs = most_runs;
      const std::uint64_t most =
          std::min(options.memory_bytes, receivers.size() * sizeof(SortedReceiver));
      PeakMemory peak;
      const Faults faults({&peak});
      ReceiverSorter sorter(options);
      peak.look();
      ASSERT_TRUE(sort(sorter, receivers, out).ok());
      EXPECT_LE(peak.bytes(), most + (16 << 10));  // a mapping's last page; messages
      if (!kHasSanitizer) {
        EXPECT_GT(peak.bytes(), most - most / 10);
      }
    }
  }
}

// The disk holds what is still to be read, and a megabyte or so of every run
TEST_F(ReceiverSorterTest, GivesTheSpaceOfWhatWasReadBack) {
  const auto receivers = randomReceivers(20 * kRunReceivers, 2, 9);
  for (const std::size_t most_runs : {std::size_t{4}, ReceiverSorter::kMostRuns}) {
    Options options = optionsFor(receivers.size());
    options.most_runs = most_runs;
    ReceiverSorter sorter(options);
    for (const SortedReceiver& receiver : receivers) ASSERT_TRUE(sorter.add(receiver).ok());
    ASSERT_TRUE(sorter.finish().ok());
    const std::uint64_t bytes = receivers.size() * sizeof(SortedReceiver);
    EXPECT_LT(diskBytes(), bytes + bytes / 10);
    std::vector<SortedReceiver> out(receivers.size());
    ASSERT_TRUE(sorter.next(out).ok());
    EXPECT_LT(diskBytes(), bytes / 10);
  }
}

TEST_F(ReceiverSorterTest, EveryCallMayFail) { failEveryCall(spillingWork()); }

TEST_F(ReceiverSorterTest, FullDiskIsReported) { expectFullDiskError(spillingWork()); }

TEST_F(ReceiverSorterTest, DamageToTheFileIsFound) {
  expectChecksumError(0, spillingWork());           // of the checksum
  expectChecksumError(56, spillingWork());          // of the first receiver
  expectChecksumError(28671 - 48, spillingWork());  // between units
}

TEST_F(ReceiverSorterTest, RunningOutOfMemoryLeavesNothing) {
  expectBadAlloc(Call::kOpen, spillingWork());
  expectBadAlloc(Call::kPread, spillingWork());
  if (kHasSanitizer) return;
  const std::uint64_t count = std::uint64_t{1} << 56;
  EXPECT_THROW(ReceiverSorter(optionsFor(count, std::uint64_t{1} << 62)), std::bad_alloc);
}

}  // namespace
}  // namespace surfeit
