// What several clouds say of themselves when they become one: names of groups stay, and what does
// not agree is told.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "cases/case_files.h"
#include "core/crs_comment.h"
#include "io/test_directory.h"
#include "surfeit/convert.h"
#include "surfeit/group_names.h"
#include "surfeit/index.h"

namespace surfeit {
namespace {

using testing::Contains;
using testing::Each;
using testing::HasSubstr;
using testing::Not;

class MergedClouds : public DirectoryTest {
 protected:
  // A point of one group, with comments.
  std::string cloud(const std::string& name, const std::string& comments, int group = 1) const {
    write(name, "ply\nformat ascii 1.0\n" + comments +
                    "element vertex 1\nproperty float x\nproperty float y\nproperty float z\n"
                    "property float radius\nproperty uchar group\nend_header\n1 2 5 .5 " +
                    std::to_string(group) + "\n");
    return path(name);
  }
  Status convert(const std::vector<std::string>& from, const std::string& to,
                 const ConvertOptions& options = {}) {
    notes_.notes.clear();
    return convertClouds(from, path(to), options, notes_).status();
  }
  void index(const std::vector<std::string>& from) {
    notes_.notes.clear();
    const auto stats = indexClouds(from, path("scene.sft"), {}, notes_);
    ASSERT_TRUE(stats.ok()) << stats.status().message();
  }
  std::vector<std::string> groupsOfScene() const {
    std::vector<std::string> names;
    const auto found = readGroupNames(path("scene.sft"));
    if (!found.ok()) return {found.status().message()};
    for (const GroupName& name : *found) {
      names.push_back(std::to_string(name.group) + " " + name.name);
    }
    return names;
  }
  Notes notes_;
};

TEST_F(MergedClouds, NamesOfGroupsOfAllCloudsStay) {
  const std::string lamp = cloud("lamp.ply", "comment group 1 lamp\n", 1),
                    tree = cloud("tree.ply", "comment group 2 tree\n", 2),
                    plain = cloud("plain.ply", "", 3);
  for (const char* name : {"all.ply", "all.txt", "all.vdb"}) {
    ASSERT_TRUE(convert({lamp, plain, tree}, name).ok());
    EXPECT_THAT(notes_.notes, Not(Contains(HasSubstr("group")))) << name;
    index({path(name)});
    EXPECT_THAT(groupsOfScene(), testing::ElementsAre("1 lamp", "2 tree")) << name;
  }
}

TEST_F(MergedClouds, ANumberWithTwoNamesIsTold) {
  const std::string lamp = cloud("lamp.ply", "comment group 1 lamp\n"),
                    tree = cloud("tree.ply", "comment group 1 tree\n");
  ASSERT_TRUE(convert({lamp, tree}, "all.ply").ok());
  EXPECT_THAT(notes_.notes, Contains(HasSubstr("tree.ply: group 1 is \"tree\", but \"lamp\"")));
}

TEST_F(MergedClouds, AxesThatDifferAreToldAndNotTurnedAlike) {
  const std::string y = cloud("y.ply", "comment up y\n"), z = cloud("z.ply", "comment up z\n"),
                    plain = cloud("plain.ply", "");
  ASSERT_TRUE(convert({y, z}, "all.ply").ok());
  EXPECT_THAT(notes_.notes, Contains(HasSubstr("z.ply: z is up, but y in")));
  ASSERT_TRUE(convert({y, plain}, "all.ply").ok());
  EXPECT_THAT(notes_.notes, Each(Not(HasSubstr(" is up"))));

  ConvertOptions up_z;
  up_z.up = UpAxis::kZ;
  const Status status = convert({y, z}, "turned.ply", up_z);
  EXPECT_EQ(status.code(), StatusCode::kInvalidArgument);
  EXPECT_THAT(status.message(), HasSubstr("convert them one by one with --up z"));
  // One that does not say is taken for what has to be turned
  ASSERT_TRUE(convert({y, plain}, "turned.ply", up_z).ok());
  EXPECT_EQ(columnOf(path("turned.ply"), "z"), (std::vector<double>{2, 2}));
}

TEST_F(MergedClouds, CoordinateReferenceSystemsThatDifferAreTold) {
  const std::string ten = cloud("ten.ply", "comment crs EPSG:32610 WGS 84 / UTM zone 10N\n"),
                    eleven = cloud("eleven.ply", "comment crs EPSG:32611\n"),
                    text = cloud("text.ply",
                                 "comment crs PROJCS[\"WGS 84 / UTM zone 10N\",GEOGCS[\"WGS 84\","
                                 "AUTHORITY[\"EPSG\",\"4326\"]],AUTHORITY[\"EPSG\",\"32610\"]]\n"),
                    none = cloud("none.ply", "");
  const auto told = HasSubstr(
      "eleven.ply: the coordinate reference system is EPSG:32611, but "
      "EPSG:32610");
  ASSERT_TRUE(convert({ten, eleven}, "all.ply").ok());
  EXPECT_THAT(notes_.notes, Contains(told));
  index({none, ten, eleven});
  EXPECT_THAT(notes_.notes, Contains(told));
  for (const auto& same : {std::vector{ten, text}, std::vector{none, text, ten}}) {
    ASSERT_TRUE(convert(same, "all.ply").ok());
    EXPECT_THAT(notes_.notes, Each(Not(HasSubstr("reference system"))));
    index(same);
    EXPECT_THAT(notes_.notes, Each(Not(HasSubstr("reference system"))));
  }
}

TEST_F(MergedClouds, OnePlaceIsNotCoarse) {
  index({cloud("one.ply", "")});
  EXPECT_THAT(notes_.notes, Each(Not(HasSubstr("positions are floats"))));
}

TEST(CrsComment, CodesAreThoseOfTheWhole) {
  EXPECT_EQ(epsgCodeOf("EPSG:32610+5703 WGS 84"), "32610");
  EXPECT_EQ(epsgCodeOf("geographic EPSG:4326"), "4326");
  EXPECT_EQ(epsgCodeOf("PROJCRS[\"x\",BASEGEOGCRS[\"y\",ID[\"EPSG\",4326]],ID[\"EPSG\",32610]]"),
            "32610");
  EXPECT_EQ(epsgCodeOf("by GeoTIFF keys without a code"), "");
  EXPECT_FALSE(isSameCrs("of one kind", "of another"));
}

}  // namespace
}  // namespace surfeit
