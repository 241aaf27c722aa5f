#include "core/first_failure.h"

#include <gtest/gtest.h>

#include <string>
#include <thread>
#include <vector>

namespace surfeit {
namespace {

TEST(FirstFailure, NothingFailedBeforeAFailureIsNoted) {
  FirstFailure failure;
  failure.note({});
  EXPECT_FALSE(failure.happened());
  EXPECT_EQ(failure.place(), FirstFailure::kNowhere);
  EXPECT_TRUE(failure.status().ok());
}

TEST(FirstFailure, FirstInTimeWinsWithoutPlaces) {
  FirstFailure failure;
  failure.note(Status::failed("first"));
  failure.note(Status::failed("second"));
  EXPECT_TRUE(failure.happened());
  EXPECT_EQ(failure.status().message(), "first");
}

TEST(FirstFailure, LowestPlaceWinsFromAnyThread) {
  FirstFailure failure;
  std::vector<std::thread> threads;
  for (std::uint64_t t = 0; t < 4; ++t) {
    threads.emplace_back([&failure, t] {
      for (std::uint64_t i = 0; i < 1000; ++i) {
        const std::uint64_t place = 5 + (i * 389 + t * 97) % 1000;
        failure.note(Status::corruption(std::to_string(place)), place);
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(failure.place(), 5u);
  EXPECT_EQ(failure.status().message(), "5");
}

}  // namespace
}  // namespace surfeit
