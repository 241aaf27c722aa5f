#include "engine/window_record.h"

#include <gtest/gtest.h>

#include <vector>

namespace surfeit {
namespace {

// Second i: i receivers, 10 i requests so far; a working set of i % 7.
WindowRecord::Moment momentAt(std::uint64_t i) {
  WindowRecord::Moment moment;
  moment.seconds = double(i);
  moment.receivers = i;
  moment.run_receivers = i % 5;
  moment.nodes.requests = 10 * i;
  moment.nodes.stall_ns = i * 1'000'000'000;
  moment.node_working_set_bytes = i % 7;
  return moment;
}

TEST(WindowRecord, WindowsHoldWhatHappenedInThem) {
  WindowRecord record(momentAt(3), 1);
  record.add(momentAt(5));
  record.add(momentAt(9));
  const std::vector<GatherWindow> windows = record.windows();
  ASSERT_EQ(windows.size(), 2u);
  EXPECT_EQ(windows[0].begin_seconds, 3);
  EXPECT_EQ(windows[0].end_seconds, 5);
  EXPECT_EQ(windows[1].receivers, 4u);
  EXPECT_EQ(windows[1].run_receivers, 4u);
  EXPECT_EQ(windows[1].node_cache.requests, 40u);
  EXPECT_EQ(windows[1].node_cache.stall_seconds, 4);
  EXPECT_EQ(windows[1].node_cache.working_set_bytes, 2u);
}

TEST(WindowRecord, TooManyWindowsJoinInPairsAndStillAddUp) {
  WindowRecord record(momentAt(0), 1);
  constexpr std::uint64_t kSeconds = 10 * WindowRecord::kMostWindows;
  for (std::uint64_t i = 1; i <= kSeconds; ++i) {
    if (record.isDue(double(i))) record.add(momentAt(i));
  }
  const std::vector<GatherWindow> windows = record.windows();
  ASSERT_LE(windows.size(), WindowRecord::kMostWindows);
  ASSERT_GE(windows.size(), WindowRecord::kMostWindows / 2);
  double end = 0;
  std::uint64_t requests = 0;
  for (const GatherWindow& window : windows) {
    EXPECT_EQ(window.begin_seconds, end);
    end = window.end_seconds;
    requests += window.node_cache.requests;
  }
  EXPECT_EQ(double(requests), 10 * end);
  EXPECT_EQ(windows[0].node_cache.working_set_bytes, 6u);  // the largest of those that joined
  EXPECT_GT(end, kSeconds - 20);
  EXPECT_FALSE(record.isDue(end + 8));
}

}  // namespace
}  // namespace surfeit
