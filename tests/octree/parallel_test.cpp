#include "core/parallel.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <new>
#include <numeric>
#include <vector>

namespace surfeit {
namespace {

TEST(ParallelFor, DoesEveryIndexOnce) {
  for (const std::size_t count : {0u, 1u, 1000u}) {
    std::vector<int> done(count, 0);
    withThreads(4, [&] { parallelFor(count, [&](std::size_t i) { ++done[i]; }); });
    EXPECT_EQ(std::count(done.begin(), done.end(), 1), std::ptrdiff_t(count));
  }
}

TEST(ParallelFor, ExceptionArrivesAtTheCaller) {
  const auto run = [](std::size_t failing) {
    withThreads(2, [failing] {
      parallelFor(100, [failing](std::size_t i) {
        if (i == failing) throw std::bad_alloc();
      });
    });
  };
  EXPECT_THROW(run(50), std::bad_alloc);
  EXPECT_NO_THROW(run(100));
}

TEST(ParallelSort, SortsByTheOrderGiven) {
  std::vector<int> values(100'000);
  std::iota(values.begin(), values.end(), 0);
  withThreads(2, [&] { parallelSort(values.begin(), values.end(), std::greater<>()); });
  EXPECT_TRUE(std::is_sorted(values.begin(), values.end(), std::greater<>()));
}

// Items are slots of a ring, as the octree builder has them, which no two items may share.
TEST(Pipeline, StagesInOrderSeeItemsInOrderAndSlotsAreTheirOwn) {
  constexpr std::size_t kMost = 5, kItems = 2000;
  struct Slot {
    std::size_t number = 0, squared = 0;
    bool is_taken = false;
  };
  std::array<Slot, kMost> slots;
  std::size_t sent = 0, expected = 0, sum = 0;
  const auto source = [&]() -> std::optional<std::size_t> {
    if (sent == kItems) return std::nullopt;
    const std::size_t slot = sent % kMost;
    EXPECT_FALSE(slots[slot].is_taken);
    slots[slot] = {sent++, 0, true};
    return slot;
  };
  using Mode = PipelineStage::Mode;
  const PipelineStage stages[] = {
      {Mode::kParallel,
       [&](std::size_t slot) { slots[slot].squared = slots[slot].number * slots[slot].number; }},
      {Mode::kInOrder, [&](std::size_t slot) { EXPECT_EQ(slots[slot].number, expected++); }},
      {Mode::kParallel, [&](std::size_t slot) { slots[slot].squared += 1; }},
      {Mode::kInOrder, [&](std::size_t slot) {
         sum += slots[slot].squared;
         slots[slot].is_taken = false;
       }}};
  withThreads(4, [&] { runPipeline(kMost, source, stages); });
  EXPECT_EQ(expected, kItems);
  EXPECT_EQ(sum, (kItems - 1) * kItems * (2 * kItems - 1) / 6 + kItems);
}

TEST(Pipeline, ExceptionOfASourceOrAStageArrivesAtTheCaller) {
  for (const bool in_source : {true, false}) {
    std::size_t sent = 0;
    const auto source = [&]() -> std::optional<std::size_t> {
      if (in_source && sent == 20) throw std::bad_alloc();
      return sent == 100 ? std::nullopt : std::optional(sent++ % 3);
    };
    std::atomic<int> worked{0};
    const PipelineStage stage = {PipelineStage::Mode::kInOrder, [&](std::size_t) {
                                   if (!in_source && worked == 20) throw std::bad_alloc();
                                   ++worked;
                                 }};
    EXPECT_THROW(withThreads(2, [&] { runPipeline(3, source, {&stage, 1}); }), std::bad_alloc);
    EXPECT_LE(worked, 20);
  }
}

}  // namespace
}  // namespace surfeit
