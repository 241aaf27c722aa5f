// Scenes whose bytes are all valid and whose references are not: a gather must end soon and say so.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>

#include "gather/packet/packet_gatherer.h"
#include "io/test_directory.h"
#include "octree/build/scene_writer.h"
#include "octree/node/node_sums.h"
#include "octree/page/surfel_group.h"
#include "octree/read/paged_octree.h"
#include "storage/page_codec.h"

namespace surfeit {
namespace {

class HostileScene : public DirectoryTest {
 protected:
  // Two nodes on every level, each with both of the next level as children: 43 nodes that a
  // traversal would meet two million times.
  void writeSharedChildren() {
    SceneHeader header;
    header.leaf_capacity = 16;
    header.node_group_capacity = kDefaultNodeGroup;
    header.surfel_group_capacity = kDefaultSurfelGroup;
    header.flatness_limit = kDefaultFlatnessLimit;
    header.bounds.add(glm::vec3(0));
    header.bounds.add(glm::vec3(1));
    header.cube = rootCube(header.bounds);
    header.full_precision = true;
    Result<std::unique_ptr<SceneWriter>> writer = SceneWriter::create(path("scene.sft"), header, 1);
    ASSERT_TRUE(writer.ok()) << writer.status().message();

    Surfel surfel;
    surfel.position = {0.5f, 0.5f, 0.5f};
    surfel.normal = {0, 0, -1};
    surfel.radius = surfel.area = 0.1f;
    NodeSums sums;
    sums.add(surfel);
    LevelNode node;
    // The radius holds every receiver, so that nothing is far enough
    node.node = sums.toNode(kDefaultFlatnessLimit, 10);
    std::vector<std::byte> payload, stored;
    encodeSurfelGroup({&surfel, 1}, header.pageForm(), payload);
    ASSERT_TRUE(compressPage(payload, stored).ok());
    EncodedPages surfel_page;
    surfel_page.add(stored, payload.size());
    ASSERT_TRUE((*writer)->addSurfelPages(surfel_page, 1).ok());
    GroupPlace place;
    for (int level = kCurveLevels; level >= 0; --level) {
      node.node.page = place.page;
      node.node.first = place.first;
      const std::array<LevelNode, 2> pair = {node, node};
      place = (*writer)->addSiblings(level, std::span(pair).first(level == 0 ? 1 : 2));
      node.node.child_count = 2;
      node.child_level = static_cast<std::uint8_t>(level);
    }
    for (const FullNodePage& page : (*writer)->takeOpenNodePages()) {
      EncodedPages encoded;
      ASSERT_TRUE(encodeNodePage(page, header.pageForm(), encoded).ok());
      ASSERT_TRUE(
          (*writer)->addNodePage(page.level, encoded.bytes, encoded.pages[0].payload_bytes).ok());
    }
    ASSERT_TRUE((*writer)->finish("{}").ok());
  }
};

TEST_F(HostileScene, SharedChildrenAreRefusedSoon) {
  writeSharedChildren();
  Result<SceneFile> file = SceneFile::open(path("scene.sft"));
  ASSERT_TRUE(file.ok()) << file.status().message();
  const Result<PagedOctree::Memory> memory =
      PagedOctree::planMemory(*file, PagedOctree::unlimitedCacheBytes(*file), 1);
  ASSERT_TRUE(memory.ok());
  const auto octree = PagedOctree::create(std::move(*file), *memory);
  ASSERT_TRUE(octree.ok());
  PagedOctree::Reader reader(**octree);
  PacketGatherer gatherer(GatherMode::kOcclusion, GatherQuality());
  const LocalReceiver receiver = {{0.5f, 0.5f, 0}, {0, 0, 1}};
  GatherResult result;
  const Status status = gatherer.gather({&receiver, 1}, reader, {&result, 1});
  EXPECT_EQ(status.code(), StatusCode::kCorruption);
  EXPECT_THAT(status.message(), testing::HasSubstr("no tree"));
  EXPECT_LT(gatherer.work().nodes_visited, 100u);
}

}  // namespace
}  // namespace surfeit
