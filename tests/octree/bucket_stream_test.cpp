#include "octree/build/bucket_stream.h"

#include <gtest/gtest.h>

#include <cstring>

#include "index/steps/index_plan.h"
#include "octree/test_scenes.h"

namespace surfeit {
namespace {

constexpr RootCube kUnitCube;

class BucketStreamTest : public DirectoryTest {
 protected:
  struct Options {
    std::size_t buckets = 1;
    std::size_t capacity = 1 << 20;
    std::uint64_t memory_bytes = 0;
    std::size_t block_surfels = 100;
    std::uint64_t spare_memory = 0;
  };

  // The cloud through a store and a stream.
  std::vector<Surfel> sorted(const std::vector<Surfel>& cloud, const Options& options,
                             std::uint64_t* temporary_bytes = nullptr) {
    SurfelStore::Plan plan;
    plan.splitters = splittersOf(cloud, kUnitCube, options.buckets);
    plan.memory_bytes = options.memory_bytes;
    plan.block_surfels = options.block_surfels;
    plan.temporary_directory = directory_.string();
    auto store = std::make_unique<SurfelStore>(plan);
    for (std::size_t at = 0; at < cloud.size(); at += 1000) {
      const auto batch =
          std::span(cloud).subspan(at, std::min<std::size_t>(1000, cloud.size() - at));
      std::vector<CurveKey> keys(batch.size());
      curveKeys(&batch.front().position, sizeof(Surfel), kUnitCube, keys);
      EXPECT_TRUE(store->add(batch, keys).ok());
    }
    EXPECT_TRUE(store->finish().ok());
    if (temporary_bytes != nullptr) *temporary_bytes = store->temporaryBytes();
    const Progress progress;
    BucketStream stream(std::move(store),
                        {kUnitCube, options.capacity, options.spare_memory, directory_.string()},
                        progress);
    std::vector<Surfel> all;
    for (;;) {
      const Result<std::shared_ptr<const SortedBatch>> batch = stream.next();
      EXPECT_TRUE(batch.ok()) << batch.status().message();
      stream_temporary_bytes_ = stream.temporaryBytes();
      if (!batch.ok() || *batch == nullptr) return all;
      EXPECT_FALSE((*batch)->tickets.empty());
      for (const Ticket& ticket : (*batch)->tickets) {
        const Surfel& surfel = (*batch)->surfels[ticket.index];
        EXPECT_EQ(ticket.key, curveKey(surfel.position, kUnitCube));
        all.push_back(surfel);
      }
    }
  }

  std::uint64_t stream_temporary_bytes_ = 0;

  static void expectSame(const std::vector<Surfel>& found, const std::vector<Surfel>& expected) {
    ASSERT_EQ(found.size(), expected.size());
    EXPECT_EQ(std::memcmp(found.data(), expected.data(), found.size() * sizeof(Surfel)), 0);
  }

  // In curve order, by comparison.
  static std::vector<Surfel> reference(std::vector<Surfel> cloud) {
    std::sort(cloud.begin(), cloud.end(), [](const Surfel& a, const Surfel& b) {
      const CurveKey key_a = curveKey(a.position, kUnitCube);
      const CurveKey key_b = curveKey(b.position, kUnitCube);
      return key_a != key_b ? key_a < key_b : contentLess(a, b);
    });
    return cloud;
  }
};

TEST_F(BucketStreamTest, EveryPlanGivesTheSameOrder) {
  std::vector<Surfel> cloud = randomCloud(20000);
  for (std::size_t i = 0; i < 500; ++i) cloud[i].position = cloud[5000].position;  // ties
  const std::vector<Surfel> expected = reference(cloud);
  expectSame(sorted(cloud, {}), expected);
  expectSame(sorted(cloud, {.buckets = 7}), expected);
  expectSame(sorted(cloud, {.buckets = 300, .block_surfels = 64}), expected);
  expectSame(sorted(cloud, {.buckets = 20, .memory_bytes = 64 << 20}), expected);
  expectSame(sorted(cloud, {.buckets = 20, .capacity = 2000}), expected);
}

TEST_F(BucketStreamTest, NothingIsSpilledWhileMemoryLasts) {
  const std::vector<Surfel> cloud = randomCloud(20000);
  std::uint64_t bytes = 1;
  sorted(cloud, {.buckets = 5, .memory_bytes = 64 << 20}, &bytes);
  EXPECT_EQ(bytes, 0u);
  sorted(cloud, {.buckets = 5, .memory_bytes = 0}, &bytes);
  EXPECT_GT(bytes, cloud.size() * 40);
  EXPECT_LT(bytes, cloud.size() * 64);
}

TEST_F(BucketStreamTest, BucketsThatAreTooLargeAreDistributedAgain) {
  const std::vector<Surfel> cloud = randomCloud(20000);
  expectSame(sorted(cloud, {.buckets = 2, .capacity = 300}), reference(cloud));
}

TEST_F(BucketStreamTest, WhatFitsInMemoryIsDistributedThere) {
  const std::vector<Surfel> cloud = randomCloud(20000);
  const Options options = {
      .buckets = 2, .capacity = 300, .memory_bytes = 64 << 20, .spare_memory = 64 << 20};
  expectSame(sorted(cloud, options), reference(cloud));
  EXPECT_EQ(stream_temporary_bytes_, 0u);
}

TEST_F(BucketStreamTest, OneKeyWithMoreSurfelsThanFit) {
  std::vector<Surfel> cloud = randomCloud(5000);
  for (std::size_t i = 0; i < 4000; ++i) cloud[i].position = glm::vec3(0.5f);
  expectSame(sorted(cloud, {.buckets = 4, .capacity = 200}), reference(cloud));
}

TEST_F(BucketStreamTest, MoreEqualSurfelsThanFit) {
  std::vector<Surfel> cloud = randomCloud(5000);
  for (std::size_t i = 0; i < 4000; ++i) cloud[i] = cloud[4500];
  expectSame(sorted(cloud, {.buckets = 4, .capacity = 200}), reference(cloud));
  std::fill(cloud.begin(), cloud.end(), cloud[0]);
  expectSame(sorted(cloud, {.buckets = 1, .capacity = 200}), cloud);
}

TEST_F(BucketStreamTest, SpillingWithoutADirectoryIsAnIoError) {
  SurfelStore::Plan plan;
  plan.block_surfels = 64;
  plan.temporary_directory = path("nowhere");
  SurfelStore store(plan);
  const std::vector<Surfel> cloud = randomCloud(100);
  const std::vector<SortWord> words(cloud.size());
  EXPECT_EQ(store.add(cloud, words).code(), StatusCode::kIoError);
}

}  // namespace
}  // namespace surfeit
