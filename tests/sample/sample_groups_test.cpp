// Object groups with names, from meshes to scenes.
#include <gmock/gmock.h>

#include <cmath>
#include <cstring>
#include <map>
#include <string>
#include <vector>

#include "sample/meshes/mesh.h"
#include "sample/scene_files.h"
#include "surfeit/group_names.h"
#include "surfeit/index.h"
#include "surfeit/sample.h"

namespace surfeit {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

// Squares of edge 1 at x = 0, 2, 4, ..., so that a place tells the square.
constexpr const char* kSquares = R"(mtllib squares.mtl
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
v 2 0 0
v 3 0 0
v 3 1 0
v 2 1 0
v 4 0 0
v 5 0 0
v 5 1 0
v 4 1 0
v 6 0 0
v 7 0 0
v 7 1 0
v 6 1 0
f 1 2 3 4
o left wall
usemtl red
f 5 6 7 8
o 3rd, lamp
f 9 10 11 12
o left wall
usemtl green
f 13 14 15 16
)";

class SampleGrouping : public SceneFiles {
 protected:
  void SetUp() override {
    SceneFiles::SetUp();
    write("squares.mtl", "newmtl red\nKd 1 0 0\nnewmtl green\nKd 0 1 0\n");
    squares_ = write("squares.obj", kSquares);
  }
  std::vector<Surfel> sampled(const std::vector<std::string>& meshes, SampleGroups groups) {
    SampleOptions options;
    options.count = 400;
    options.groups = groups;
    const auto stats = sampleMeshes(meshes, path("out.ply"), options, notes_);
    EXPECT_TRUE(stats.ok()) << stats.status().message();
    return stats.ok() ? readCloud(path("out.ply")) : std::vector<Surfel>();
  }
  // Groups of the squares, each of which must have one.
  std::vector<int> groupsOfSquares(const std::vector<Surfel>& surfels) {
    std::map<int, int> groups;
    for (const Surfel& surfel : surfels) {
      const int square = int(std::floor(surfel.position.x / 2));
      const auto [known, is_new] = groups.emplace(square, int(surfel.group));
      EXPECT_EQ(known->second, int(surfel.group)) << square;
    }
    std::vector<int> list;
    for (const auto& [square, group] : groups) list.push_back(group);
    return list;
  }
  std::vector<std::string> namesOfScene(const std::vector<std::string>& clouds,
                                        const IndexOptions& options = {}) {
    const auto stats = indexClouds(clouds, path("scene.sft"), options, notes_);
    EXPECT_TRUE(stats.ok()) << stats.status().message();
    const auto names = readGroupNames(path("scene.sft"));
    EXPECT_TRUE(names.ok());
    std::vector<std::string> list;
    for (const GroupName& name : *names) {
      list.push_back(std::to_string(name.group) + " " + name.name);
    }
    return list;
  }

  std::string squares_;
  RecordedNotes notes_;
};

TEST_F(SampleGrouping, ObjectsOfOneNameAreOneGroup) {
  EXPECT_THAT(groupsOfSquares(sampled({squares_}, SampleGroups::kObject)), ElementsAre(0, 1, 2, 1));
  EXPECT_THAT(namesOfScene({path("out.ply")}), ElementsAre("1 left wall", "2 _3rd_ lamp"));
}

TEST_F(SampleGrouping, MaterialsAreGroups) {
  const std::vector<Surfel> surfels = sampled({squares_}, SampleGroups::kMaterial);
  EXPECT_THAT(groupsOfSquares(surfels), ElementsAre(0, 1, 1, 2));
  for (const Surfel& surfel : surfels) {
    if (surfel.group == 2) {
      EXPECT_EQ(surfel.albedo, glm::vec3(0, 1, 0));
    }
  }
  EXPECT_THAT(namesOfScene({path("out.ply")}), ElementsAre("1 red", "2 green"));
}

TEST_F(SampleGrouping, FilesAreGroupsAndOtherMeshesHaveNoOther) {
  write("floor.ply", plyText({{10, 0, 0}, {11, 0, 0}, {11, 1, 0}, {10, 1, 0}}, {{0, 1, 2, 3}}));
  EXPECT_THAT(groupsOfSquares(sampled({squares_, path("floor.ply")}, SampleGroups::kFile)),
              ElementsAre(1, 1, 1, 1, 2));
  EXPECT_THAT(namesOfScene({path("out.ply")}), ElementsAre("1 squares", "2 floor"));
  EXPECT_THAT(groupsOfSquares(sampled({squares_, path("floor.ply")}, SampleGroups::kObject)),
              ElementsAre(0, 1, 2, 1, 3));
  EXPECT_THAT(namesOfScene({path("out.ply")}),
              ElementsAre("1 left wall", "2 _3rd_ lamp", "3 floor"));
}

TEST_F(SampleGrouping, GroupsChangeNothingElse) {
  const std::vector<Surfel> plain = sampled({squares_}, SampleGroups::kNone);
  std::vector<Surfel> grouped = sampled({squares_}, SampleGroups::kObject);
  ASSERT_EQ(grouped.size(), plain.size());
  for (std::size_t i = 0; i < plain.size(); ++i) {
    grouped[i].group = 0;
    EXPECT_EQ(std::memcmp(&grouped[i], &plain[i], sizeof(Surfel)), 0) << i;
  }
}

TEST_F(SampleGrouping, TooManyNamesAreRefused) {
  std::string many = "v 0 0 0\nv 1 0 0\nv 1 1 0\n";
  for (int i = 0; i < 64; ++i) many += "o part" + std::to_string(i) + "\nf 1 2 3\n";
  SampleOptions options;
  options.groups = SampleGroups::kObject;
  const auto stats = sampleMeshes({write("many.obj", many)}, path("none.ply"), options, notes_);
  EXPECT_EQ(stats.status().code(), StatusCode::kInvalidArgument);
  EXPECT_THAT(stats.status().message(), HasSubstr("\"part63\" is name 64"));
  EXPECT_FALSE(std::filesystem::exists(path("none.ply")));
}

// Two clouds with names for the same group.
TEST_F(SampleGrouping, NamesAtOddsAreToldAndTheFirstStays) {
  sampled({squares_}, SampleGroups::kMaterial);
  std::filesystem::rename(path("out.ply"), path("first.ply"));
  sampled({squares_}, SampleGroups::kObject);
  EXPECT_THAT(namesOfScene({path("first.ply"), path("out.ply")}), ElementsAre("1 red", "2 green"));
  EXPECT_THAT(notes_.notes, Contains(HasSubstr("group 1 is \"left wall\", but \"red\"")));
  // Names of the options come first, and clouds with one have no other
  IndexOptions options;
  options.named = {{"all", path("first.ply")}};
  EXPECT_THAT(namesOfScene({path("out.ply")}, options), ElementsAre("1 all", "2 _3rd_ lamp"));
  EXPECT_THAT(notes_.notes, Contains(HasSubstr("group 1 of the clouds is \"left wall\"")));
}

}  // namespace
}  // namespace surfeit
