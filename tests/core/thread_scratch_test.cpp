#include "core/thread_scratch.h"

#include <gtest/gtest.h>

#include <atomic>
#include <thread>
#include <vector>

namespace surfeit {
namespace {

std::atomic<int> alive{0};
struct Counted {
  Counted() { ++alive; }
  ~Counted() { --alive; }
  std::vector<int> values;
};

Counted& here() {
  return threadScratch<Counted>([] {});
}
Counted& there() {
  return threadScratch<Counted>([] {});
}

TEST(ThreadScratch, APlaceHasOneObjectPerThreadThatKeepsWhatItHolds) {
  std::thread([] {
    here().values.assign(5, 7);
    EXPECT_EQ(here().values.size(), 5u);
    EXPECT_EQ(&here(), &here());
    EXPECT_NE(&here(), &there());
    EXPECT_TRUE(there().values.empty());
    std::thread([other = &here()] {
      EXPECT_NE(&here(), other);
      EXPECT_TRUE(here().values.empty());
    }).join();
    EXPECT_EQ(here().values.size(), 5u);
  }).join();
}

TEST(ThreadScratch, ObjectsGoWithTheirThread) {
  const int before = alive;
  for (int i = 0; i < 3; ++i) {
    std::thread([before] {
      here();
      there();
      EXPECT_EQ(alive, before + 2);
    }).join();
    EXPECT_EQ(alive, before);
  }
}

}  // namespace
}  // namespace surfeit
