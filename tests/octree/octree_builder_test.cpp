// The octree against its definition: a cell with more surfels than a leaf holds has its occupied
// children below it, cells with one child are left out, and the root is the smallest of all.
#include "octree/build/octree_builder.h"

#include <gtest/gtest.h>

#include "octree/test_scenes.h"

namespace surfeit {
namespace {

class OctreeBuilderTest : public SceneTest {
 protected:
  // Child and surfel counts of the nodes below a run of sorted surfels, depth first.
  struct Shape {
    std::size_t children = 0, surfels = 0, first_surfel = 0;
    bool operator==(const Shape&) const = default;
  };

  static void define(std::span<const CurveKey> keys, std::size_t begin, std::size_t end,
                     std::size_t capacity, std::vector<Shape>& shapes) {
    const std::size_t self = shapes.size();
    shapes.push_back({0, end - begin, begin});
    if (end - begin <= capacity || keys[begin] == keys[end - 1]) return;
    const int level = firstDifferentLevel(keys[begin], keys[end - 1]);
    for (std::size_t at = begin; at < end;) {
      std::size_t next = at + 1;
      while (next < end && firstDifferentLevel(keys[at], keys[next]) > level) ++next;
      ++shapes[self].children;
      define(keys, at, next, capacity, shapes);
      at = next;
    }
  }

  void expectDefinition(const std::vector<Surfel>& cloud, std::uint32_t leaf_capacity) {
    IndexOptions options;
    options.leaf_capacity = leaf_capacity;
    options.full_precision = true;
    const Result<ReadScene> scene = readScene(index(cloud, kAllChannels, options));
    ASSERT_TRUE(scene.ok()) << scene.status().message();
    ASSERT_EQ(scene->surfels.size(), cloud.size());
    std::vector<CurveKey> keys;
    for (const Surfel& surfel : scene->surfels) {
      keys.push_back(curveKey(surfel.position, scene->header.cube));
    }
    ASSERT_TRUE(std::is_sorted(keys.begin(), keys.end()));
    std::vector<Shape> expected;
    define(keys, 0, keys.size(), leaf_capacity, expected);
    ASSERT_EQ(scene->nodes.size(), expected.size());
    for (std::size_t i = 0; i < expected.size(); ++i) {
      const ReadScene::ReadNode& read = scene->nodes[i];
      const Shape found = {read.node.child_count, std::size_t(read.node.surfel_count),
                           read.first_surfel};
      ASSERT_EQ(found, expected[i]) << "node " << i;
    }
    EXPECT_EQ(findingsOf(path("scene" + std::to_string(scenes_) + ".sft")),
              std::vector<std::string>{});
  }
};

TEST_F(OctreeBuilderTest, HasTheDefinedShape) {
  for (const std::size_t count : {1u, 16u, 17u, 1000u, 16384u, 16385u, 100000u}) {
    SCOPED_TRACE(count);
    expectDefinition(randomCloud(count), 16);
  }
}

TEST_F(OctreeBuilderTest, LargeAndSmallLeaves) {
  const std::vector<Surfel> cloud = sphereCloud(50000);
  for (const std::uint32_t capacity : {1u, 100u, 4096u}) {
    SCOPED_TRACE(capacity);
    expectDefinition(cloud, capacity);
  }
}

TEST_F(OctreeBuilderTest, ManySurfelsAtOnePlace) {
  for (const std::size_t count : {20u, 600u, 16384u, 16385u, 50000u}) {
    SCOPED_TRACE(count);
    std::vector<Surfel> cloud = randomCloud(20000 + count);
    for (std::size_t i = 0; i < count; ++i) cloud[i].position = cloud.back().position;
    expectDefinition(cloud, 16);
  }
}

TEST_F(OctreeBuilderTest, AllSurfelsAtOnePlace) {
  std::vector<Surfel> cloud = randomCloud(40000);
  for (Surfel& surfel : cloud) surfel.position = {1, 2, 3};
  expectDefinition(cloud, 16);
}

TEST_F(OctreeBuilderTest, DenseAndFarAway) {
  // Most surfels in a few cells of the finest level, one far away
  std::vector<Surfel> cloud = moved(randomCloud(40000), 1e-6f, glm::vec3(0.3f));
  cloud.push_back(cloud[0]);
  cloud.back().position = {1e6f, 0, 0};
  expectDefinition(cloud, 16);
}

}  // namespace
}  // namespace surfeit
