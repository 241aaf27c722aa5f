#include "octree/read/group_set.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "octree/test_scenes.h"

namespace surfeit {
namespace {

using testing::HasSubstr;

std::uint64_t parsed(std::string_view text) {
  const Result<std::uint64_t> groups = parseGroups(text);
  EXPECT_TRUE(groups.ok()) << groups.status().message();
  return groups.ok() ? *groups : 0;
}

TEST(GroupSet, ListsAndRangesAreParsed) {
  EXPECT_EQ(parsed("0"), 1u);
  EXPECT_EQ(parsed("63"), groupBit(63));
  EXPECT_EQ(parsed("0,2-5"), 0b111101u);
  EXPECT_EQ(parsed("2-5,0,3-3,4"), 0b111101u);
  EXPECT_EQ(parsed("0-63"), kAllGroups);
}

TEST(GroupSet, AnythingElseIsRefusedWithTheReason) {
  for (const char* text : {"", ",", "1,", ",1", "64", "-1", "1-", "5-2", "1-64", "1--2", "1-2-3",
                           "a", "1 ", "0x1", "1.5", "+1", "1;2", "99999999999999999999"}) {
    const Status status = parseGroups(text).status();
    EXPECT_EQ(status.code(), StatusCode::kInvalidArgument) << text;
    EXPECT_THAT(status.message(), HasSubstr("expected groups from 0 to 63"));
  }
}

TEST(GroupSet, DescriptionsAreParsedBack) {
  EXPECT_EQ(describeGroups(0), "none");
  EXPECT_EQ(describeGroups(1), "0");
  EXPECT_EQ(describeGroups(0b11), "0,1");
  EXPECT_EQ(describeGroups(0b111101), "0,2-5");
  EXPECT_EQ(describeGroups(kAllGroups), "0-63");
  EXPECT_EQ(describeGroups(groupBit(63) | groupBit(62)), "62,63");
  TestRandom random(5);
  for (int i = 0; i < 1000; ++i) {
    const std::uint64_t groups =
        std::uint64_t{random.bits() | random.bits()} << 32 | (random.bits() & random.bits()) | 2;
    EXPECT_EQ(parsed(describeGroups(groups)), groups);
  }
}

class GroupedSceneTest : public SceneTest {
 protected:
  static Status check(const std::string& path, std::uint64_t groups) {
    SURFEIT_ASSIGN_OR_RETURN(const SceneFile scene, SceneFile::open(path));
    return checkGroups(scene, groups);
  }
};

TEST_F(GroupedSceneTest, SurfelsAndNodesKeepTheGroupsOfTheCloud) {
  const std::vector<Surfel> cloud = inGroups(randomCloud(5000), 20);
  for (const bool full_precision : {false, true}) {
    IndexOptions options;
    options.full_precision = full_precision;
    const Result<ReadScene> scene = readScene(index(cloud, kAllAndGroups, options));
    ASSERT_TRUE(scene.ok()) << scene.status().message();
    std::vector<int> expected(kMaxGroups), found(kMaxGroups);
    for (const Surfel& surfel : cloud) ++expected[surfel.group];
    for (const Surfel& surfel : scene->surfels) ++found[surfel.group];
    EXPECT_EQ(found, expected);
    for (const auto& [node, first] : scene->nodes) {
      std::uint64_t groups = 0;
      for (std::size_t i = 0; i < node.surfel_count; ++i) {
        groups |= groupBit(scene->surfels[first + i].group);
      }
      ASSERT_EQ(node.groups, groups);
    }
  }
}

// Sizes from neighbours take the surfels through an octree of their own.
TEST_F(GroupedSceneTest, CloudsOfPositionsAndGroupsKeepThem) {
  CloudChannels channels = kPositionsOnly;
  channels.group = true;
  const Result<ReadScene> scene = readScene(index(inGroups(randomCloud(3000), 20), channels));
  ASSERT_TRUE(scene.ok()) << scene.status().message();
  for (const Surfel& surfel : scene->surfels) {
    ASSERT_NEAR(surfel.position.x * 20, float(surfel.group) + .5f, .51f);
  }
}

TEST_F(GroupedSceneTest, CloudsWithoutGroupsJoinOnesWithThemAsGroupZero) {
  std::vector<Surfel> cloud = randomCloud(500);
  writeCloud(path("plain.ply"), cloud);
  for (Surfel& surfel : cloud) surfel.group = 9;
  writeCloud(path("nine.ply"), cloud, kAllAndGroups);
  indexFiles({path("plain.ply"), path("nine.ply")}, path("both.sft"));
  const Result<SceneInfo> info = readSceneInfo(path("both.sft"));
  ASSERT_TRUE(info.ok()) << info.status().message();
  EXPECT_EQ(info->groups, groupBit(0) | groupBit(9));
}

TEST_F(GroupedSceneTest, RecordsOfNoGroupAreSkippedAndCounted) {
  writeBytes(path("a.ply"),
             "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
             "property float z\nproperty float radius\nproperty int light_group\nend_header\n"
             "0 0 0 1 5\n1 0 0 1 64\n2 0 0 1 -1\n3 0 0 1 63\n");
  EXPECT_EQ(indexFiles({path("a.ply")}, path("a.sft")).skipped_records, 2u);
  EXPECT_THAT(progress_.notes,
              testing::Contains(HasSubstr("2 records with a group that is not 0 to 63 (first: "
                                          "record 1, whose light_group is 64)")));
  IndexOptions strict;
  strict.strict = true;
  EXPECT_THAT(indexClouds({path("a.ply")}, path("b.sft"), strict, progress_).status().message(),
              HasSubstr("light_group is 64, expected 0 to 63"));
}

TEST_F(GroupedSceneTest, GroupsAreChosenFromThoseThatAreThere) {
  const std::string plain = index(randomCloud(100));
  EXPECT_TRUE(check(plain, kAllGroups).ok());
  EXPECT_EQ(check(plain, groupBit(0)).code(), StatusCode::kCorruption);
  EXPECT_THAT(check(plain, groupBit(0)).message(), HasSubstr("found no groups"));

  const std::string grouped = index(inGroups(randomCloud(300), 4), kAllAndGroups);
  EXPECT_TRUE(check(grouped, kAllGroups).ok());
  EXPECT_TRUE(check(grouped, groupBit(3) | groupBit(60)).ok());
  for (const std::uint64_t groups : {groupBit(4), std::uint64_t{0}}) {
    const Status status = check(grouped, groups);
    EXPECT_EQ(status.code(), StatusCode::kInvalidArgument);
    EXPECT_THAT(status.message(), HasSubstr("found groups 0-3"));
  }
}

}  // namespace
}  // namespace surfeit
