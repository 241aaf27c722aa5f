#include "cache/frame_pool.h"

#include <gtest/gtest.h>

#include <cstring>
#include <utility>

namespace surfeit {
namespace {

TEST(FramePool, StrideIsAnOddNumberOfCacheLines) {
  for (const std::size_t bytes : {0, 1, 63, 64, 65, 128, 4096, 16384, 16385}) {
    const std::size_t stride = FramePool::strideFor(bytes);
    EXPECT_GE(stride, bytes);
    EXPECT_LE(stride, bytes + 128);
    EXPECT_EQ(stride % 128, 64u);
  }
}

TEST(FramePool, GivesBackWholeFramesAndNoByteOfOthers) {
  constexpr std::size_t kFrames = 1000;
  const std::size_t stride = FramePool::strideFor(5000);
  Result<FramePool> created = FramePool::create(stride, kFrames);
  ASSERT_TRUE(created.ok());
  FramePool pool(std::move(*created));  // it may move
  EXPECT_EQ(pool.frames(), kFrames);
  pool.setLimit(kFrames);
  for (std::uint32_t frame = 0; frame < kFrames; ++frame) {
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(pool.data(frame)) % 64, 0u);
    std::memset(pool.data(frame), 7, stride);
  }
  const auto isWhole = [&](std::uint32_t frame) {
    for (std::size_t i = 0; i < stride; ++i) {
      if (pool.data(frame)[i] != std::byte{7}) return false;
    }
    return true;
  };

  pool.setLimit(100);
  pool.giveBackBetween(100, 500);
  pool.giveBackBetween(100, 100);
  pool.giveBackFrom(501);
  for (std::uint32_t frame = 0; frame < 100; ++frame) EXPECT_TRUE(isWhole(frame));
  EXPECT_TRUE(isWhole(500));
  for (std::uint32_t frame = 101; frame < 499; ++frame) {
    EXPECT_EQ(pool.data(frame)[stride / 2], std::byte{0});
  }
  EXPECT_EQ(pool.data(kFrames - 1)[stride - 1], std::byte{0});

  // They may be used again
  pool.setLimit(kFrames);
  std::memset(pool.data(kFrames - 1), 7, stride);
  EXPECT_TRUE(isWhole(kFrames - 1));
}

TEST(FramePool, FailsWithoutAddressSpace) {
  EXPECT_EQ(FramePool::create(std::size_t{1} << 40, std::size_t{1} << 31).status().code(),
            StatusCode::kFailed);
  EXPECT_EQ(FramePool::create(64, ~std::size_t{0} / 64).status().code(), StatusCode::kFailed);
}

}  // namespace
}  // namespace surfeit
