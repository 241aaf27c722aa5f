#include "octree/build/surfel_block.h"

#include <gtest/gtest.h>

#include <cstring>

#include "octree/test_scenes.h"

namespace surfeit {
namespace {

bool sameBytes(std::span<const Surfel> a, std::span<const Surfel> b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size_bytes()) == 0;
}

TEST(SurfelBlock, ComesBackBitByBit) {
  for (const std::size_t count : {1u, 2u, 3u, 100u, 2048u}) {
    const std::vector<Surfel> cloud = randomCloud(count);
    std::vector<std::byte> packed;
    packSurfels(cloud, packed);
    EXPECT_LE(packed.size(), maxPackedBytes(count));
    EXPECT_EQ(packedCount(packed), count);
    std::vector<Surfel> found(count);
    ASSERT_TRUE(unpackSurfels(packed, found).ok());
    EXPECT_TRUE(sameBytes(found, cloud)) << count;
  }
}

TEST(SurfelBlock, WhatSurfelsShareTakesNoRoom) {
  TestRandom random(3);
  std::vector<Surfel> cloud(1000);
  for (Surfel& surfel : cloud) {
    surfel.position = {random.between(1, 1.5f), 2, 3};
    surfel.radius = surfel.area = 0.25f;
    surfel.normal = {0, 0, 1};
  }
  std::vector<std::byte> packed;
  packSurfels(cloud, packed);
  // Three of the four bytes of x; its exponent is the same for all
  EXPECT_LT(packed.size(), 3 * cloud.size() + 200);
}

TEST(SurfelBlock, EveryDamagedByteIsNoticed) {
  const std::vector<Surfel> cloud = randomCloud(20);
  std::vector<std::byte> packed;
  packSurfels(cloud, packed);
  std::vector<Surfel> found(cloud.size());
  for (std::size_t i = 0; i < packed.size(); ++i) {
    std::vector<std::byte> damaged = packed;
    damaged[i] ^= std::byte{1};
    EXPECT_EQ(unpackSurfels(damaged, found).code(), StatusCode::kCorruption) << i;
    EXPECT_EQ(unpackSurfels(Bytes(packed).first(i), found).code(), StatusCode::kCorruption) << i;
  }
}

TEST(SurfelBlock, AnotherCountIsNoticed) {
  std::vector<std::byte> packed;
  packSurfels(randomCloud(20), packed);
  std::vector<Surfel> found(19);
  EXPECT_EQ(unpackSurfels(packed, found).code(), StatusCode::kCorruption);
}

}  // namespace
}  // namespace surfeit
