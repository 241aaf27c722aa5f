#include "batch/receiver_queue.h"

#include <gtest/gtest.h>

#include <memory>
#include <mutex>
#include <set>
#include <thread>
#include <vector>

namespace surfeit {
namespace {

// A sorter of so many receivers; number i has key, index and x i.
class ReceiverQueueTest : public testing::Test {
 protected:
  void fill(std::uint64_t count) {
    sorter_ = std::make_unique<ExternalSorter>(
        ExternalSorter::Options{.record_bytes = sizeof(SortedReceiver),
                                .count = count,
                                .memory_bytes = count * sizeof(SortedReceiver),
                                .temporary_directory = "."});
    for (std::uint64_t i = count; i-- > 0;) {
      ASSERT_TRUE(sorter_->add(SortedReceiver{i, i, {{float(i), 0, 0}, {0, 0, 1}}}).ok());
    }
    ASSERT_TRUE(sorter_->finish().ok());
  }
  std::vector<std::uint64_t> takeAll(ReceiverQueue& queue, std::size_t count) {
    std::vector<std::uint64_t> indices;
    std::vector<SortedReceiver> run;
    for (;;) {
      EXPECT_TRUE(queue.take(run, count).ok());
      if (run.empty()) return indices;
      for (const SortedReceiver& receiver : run) indices.push_back(receiver.index);
    }
  }

  std::unique_ptr<ExternalSorter> sorter_;
};

TEST_F(ReceiverQueueTest, HandsOutAllInOrder) {
  for (const std::uint64_t count : {0, 1, 15, 16, 1000}) {
    for (const std::size_t run : {16, 48, 512}) {
      fill(count);
      ReceiverQueue queue(*sorter_, 512);
      const std::vector<std::uint64_t> indices = takeAll(queue, run);
      ASSERT_EQ(indices.size(), count);
      for (std::uint64_t i = 0; i < count; ++i) ASSERT_EQ(indices[i], i);
    }
  }
}

TEST_F(ReceiverQueueTest, LooksAheadOfWhatIsTakenOnceAtEachPlace) {
  fill(1000);
  ReceiverQueue queue(*sorter_, 512);
  EXPECT_FALSE(queue.lookAhead(100, 32)) << "nothing has been read yet";
  std::vector<SortedReceiver> run;
  ASSERT_TRUE(queue.take(run, 16).ok());
  EXPECT_EQ(queue.lookAhead(100, 32)->position.x, 16);
  EXPECT_EQ(queue.lookAhead(100, 32)->position.x, 48);
  EXPECT_EQ(queue.lookAhead(100, 32)->position.x, 80);
  EXPECT_EQ(queue.lookAhead(100, 32)->position.x, 112);
  EXPECT_FALSE(queue.lookAhead(100, 32));
  EXPECT_EQ(queue.lookAhead(1000, 32)->position.x, 144);

  // Those that have been taken meanwhile are passed over
  for (int i = 0; i < 20; ++i) ASSERT_TRUE(queue.take(run, 16).ok());
  EXPECT_EQ(queue.lookAhead(100, 32)->position.x, 336);
}

TEST_F(ReceiverQueueTest, ThreadsShareAllReceivers) {
  fill(20000);
  ReceiverQueue queue(*sorter_, 1024);
  std::mutex mutex;
  std::set<std::uint64_t> seen;
  {
    std::vector<std::jthread> threads;
    for (int t = 0; t < 8; ++t) {
      threads.emplace_back([&] {
        std::vector<SortedReceiver> run;
        for (;;) {
          EXPECT_TRUE(queue.take(run, 32).ok());
          (void)queue.lookAhead(200, 32);
          if (run.empty()) return;
          const std::lock_guard lock(mutex);
          for (const SortedReceiver& receiver : run) seen.insert(receiver.index);
        }
      });
    }
  }
  EXPECT_EQ(seen.size(), 20000u);
}

}  // namespace
}  // namespace surfeit
