// What a scene says of itself, each thing by itself: verify names what does not hold.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <functional>
#include <string>
#include <vector>

#include "core/long_side.h"
#include "io/page_file_damage.h"
#include "octree/scene_damage.h"
#include "octree/test_scenes.h"

namespace surfeit {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;

class VerifyClaimsTest : public SceneTest {
 protected:
  std::string sceneOf(std::vector<Surfel> cloud, const CloudChannels& channels = kAllChannels) {
    IndexOptions options;
    options.leaf_capacity = 4;
    options.full_precision = true;
    return index(cloud, channels, options);
  }
  // Of the first node of a page.
  std::vector<std::string> findingsAfter(const std::string& scene, std::uint32_t page,
                                         const std::function<void(Node&)>& edit) {
    const Status status =
        editNodes(scene, path("edited.sft"), page, [&](auto& nodes) { edit(nodes[0].node); });
    EXPECT_TRUE(status.ok()) << status.message();
    return findingsOf(path("edited.sft"));
  }
  std::uint32_t lastNodePage(const std::string& scene) {
    const Result<SceneInfo> info = readSceneInfo(scene);
    EXPECT_TRUE(info.ok());
    return info.ok() ? info->node_pages - 1 : 0;
  }
};

TEST_F(VerifyClaimsTest, NodesAreToldByWhatTheyClaimWrongly) {
  std::vector<Surfel> cloud = randomCloud(400);
  for (Surfel& surfel : cloud) surfel.transparency = 20000;
  CloudChannels channels = kAllChannels;
  channels.opacity = true;
  const std::string scene = sceneOf(cloud, channels);
  const std::uint32_t leaves = lastNodePage(scene);
  ASSERT_THAT(findingsAfter(scene, leaves, [](Node& n) { ASSERT_TRUE(n.isLeaf()); }), IsEmpty());

  for (const float times : {.99f, 1.01f}) {
    EXPECT_THAT(findingsAfter(scene, 0, [&](Node& n) { n.area *= times; }),
                Contains(AllOf(HasSubstr(": area "), HasSubstr("from what lies below"))));
  }
  for (const std::uint16_t transparency : {10000, 30000}) {
    EXPECT_THAT(findingsAfter(scene, 0, [&](Node& n) { n.transparency = transparency; }),
                Contains(AllOf(HasSubstr(": opacity "), HasSubstr("from what lies below"))));
  }
  // Nodes that are not tinted, of what is
  channels.tint = true;
  for (Surfel& surfel : cloud) surfel.tint = {0, 5000};
  const std::string tinted = sceneOf(cloud, channels);
  ASSERT_THAT(findingsAfter(tinted, 0, [](Node&) {}), IsEmpty());
  EXPECT_THAT(findingsAfter(tinted, 0,
                            [](Node& n) {
                              n.tint = {5000, 5000};
                            }),
              Contains(AllOf(HasSubstr(": green opacity "), HasSubstr("from what lies below"))));
  EXPECT_THAT(findingsAfter(tinted, 0,
                            [](Node& n) {
                              n.tint = {0, 10000};
                            }),
              Contains(AllOf(HasSubstr(": blue opacity "), HasSubstr("from what lies below"))));
  EXPECT_THAT(findingsAfter(scene, 0, [](Node& n) { n.position.x += 10; }),
              Contains(HasSubstr("for the centres of its children")));
  EXPECT_THAT(findingsAfter(scene, leaves, [](Node& n) { n.radius *= .5f; }),
              Contains(HasSubstr("for the disks of its surfels")));
}

TEST_F(VerifyClaimsTest, LeavesOfMoreSurfelsThanThereAreAreNoTree) {
  const std::string scene = sceneOf(randomCloud(4));
  EXPECT_THAT(findingsAfter(scene, 0, [](Node& n) { n.surfel_count = 500; }),
              Contains(HasSubstr("leaves refer to more than 4 surfels")));
}

TEST_F(VerifyClaimsTest, CountsOfTheHeaderAreThoseOfThePages) {
  const std::string scene = sceneOf(randomCloud(400));
  constexpr std::size_t kSurfelCountAt = 8, kNodeCountAt = 16;  // of the scene fields
  for (const std::size_t at : {kSurfelCountAt, kNodeCountAt}) {
    const Status status = rewriteScene(scene, path("edited.sft"), {}, [&](auto& fields) {
      std::uint64_t count;
      std::memcpy(&count, &fields[at], sizeof count);
      ++count;
      std::memcpy(&fields[at], &count, sizeof count);
    });
    ASSERT_TRUE(status.ok()) << status.message();
    EXPECT_THAT(findingsOf(path("edited.sft")), Contains(HasSubstr("the header says")));
  }
}

// Programs that do not know a feature bit must refuse what has it.
TEST_F(VerifyClaimsTest, MarksOfSurfelsHaveTheirFeatureBits) {
  const std::string scene = sceneOf(randomCloud(400), kAllAndLongSides);
  const struct {
    std::uint32_t bit;
    std::function<void(Surfel&)> mark;
  } kinds[] = {{4, [](Surfel& surfel) { surfel.flags = kSurfelHiddenFront; }},
               {4, [](Surfel& surfel) { surfel.flags = kSurfelTwoSided | kSurfelHiddenBack; }},
               {8, [](Surfel& surfel) { surfel.flags = kSurfelTwoSided | kSurfelLoose; }},
               {32, [](Surfel& surfel) { setSharers(4, surfel); }},
               {64, [](Surfel& surfel) { setTile(2 * surfel.area, surfel); }}};
  for (const auto& kind : kinds) {
    const Status marked = editSurfels(scene, path("marked.sft"), 0, [&](auto& surfels) {
      surfels[7].flags = 0;
      surfels[7].normal = {0, 0, 1};
      surfels[7].long_side = kNoLongSide;
      surfels[7].elongation = 0;
      kind.mark(surfels[7]);
    });
    ASSERT_TRUE(marked.ok()) << marked.message();
    const auto told = Contains(HasSubstr(fmt::format("expected feature bit {} of", kind.bit)));
    const auto bits = [&](bool has) {
      return [&kind, has](std::vector<std::byte>& fields) {
        std::uint32_t features;  // at the begin
        std::memcpy(&features, fields.data(), sizeof features);
        features = has ? features | kind.bit : features & ~kind.bit;
        std::memcpy(fields.data(), &features, sizeof features);
      };
    };
    ASSERT_TRUE(rewriteScene(path("marked.sft"), path("with.sft"), {}, bits(true)).ok());
    ASSERT_TRUE(rewriteScene(path("marked.sft"), path("without.sft"), {}, bits(false)).ok());
    EXPECT_THAT(findingsOf(path("with.sft")), testing::Not(told)) << kind.bit;
    EXPECT_THAT(findingsOf(path("without.sft")), told) << kind.bit;
  }
}

// One page begins a byte before the one ahead of it ends; all bytes are those of some page still.
TEST_F(VerifyClaimsTest, PagesThatOverlapAreFound) {
  std::string file = bytesOf(sceneOf(randomCloud(400)));
  const std::size_t directory = getAt<std::uint64_t>(file, footerAt(file) + kDirectoryOffsetAt);
  ASSERT_GE((footerAt(file) - directory) / kEntryBytes, 2u);
  const std::size_t stored = 8, end = footerAt(file) - kEntryBytes;
  ASSERT_EQ(getAt<std::uint64_t>(file, end), kFileHeaderBytes) << "the surfels come first";
  setAt(file, end + stored, getAt<std::uint32_t>(file, end + stored) + 1);
  setAt(file, directory + stored, getAt<std::uint32_t>(file, directory + stored) - 1);
  sealPages(file);
  sealFile(file);
  replaceContents(path("overlap.sft"), file);
  EXPECT_THAT(findingsOf(path("overlap.sft")), Contains(HasSubstr("expected at")));
}

TEST_F(VerifyClaimsTest, ColumnsOfALaterVersionAreRefused) {
  const struct {
    const char* name;
    std::uint32_t version;
    const char* told;
  } scenes[] = {{"v3_opacity.sft", 2, "opacity in version 2"},
                {"v4_lobes.sft", 3, "lobes in version 3"}};
  for (const auto& scene : scenes) {
    std::string file = bytesOf(SURFEIT_TEST_SOURCE_DIR "/golden/" + std::string(scene.name));
    ASSERT_EQ(getAt<std::uint32_t>(file, 8), scene.version + 1);
    setAt(file, 8, scene.version);
    sealFile(file);
    replaceContents(path("older.sft"), file);
    EXPECT_THAT(findingsOf(path("older.sft")), Contains(HasSubstr(scene.told)));
  }
}

}  // namespace
}  // namespace surfeit
