// What several clouds say of themselves when they become one: names of groups stay, and what does
// not agree is told.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
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

// Points at z = 0, in an n by n grid of edge 1, with what `properties` and `values` add.
std::string gridCloud(int n, double x, double y, const std::string& properties,
                      const std::string& values) {
  std::string text = "ply\nformat ascii 1.0\nelement vertex " + std::to_string(n * n) +
                     "\nproperty double x\nproperty double y\nproperty double z\nproperty float "
                     "radius\n" +
                     properties + "end_header\n";
  for (int i = 0; i < n * n; ++i) {
    text += std::to_string(x + double(i % n) / n) + " " + std::to_string(y + double(i / n) / n) +
            " 0 .01" + values + "\n";
  }
  return text;
}

TEST_F(MergedClouds, CloudsThatStayDarkBesideOthersAreToldOnce) {
  const std::string rgb = "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  const std::string radiosity =
      "property float radiosity_r\nproperty float radiosity_g\nproperty float radiosity_b\n";
  const std::string albedo =
      "property float albedo_r\nproperty float albedo_g\nproperty float albedo_b\n";
  write("colors.ply", gridCloud(3, 0, 0, rgb, " 1 2 3"));
  write("plain.ply", gridCloud(2, 0, 2, "", ""));
  write("plain2.ply", gridCloud(1, 0, 4, "", ""));
  write("light.ply", gridCloud(1, 0, 6, radiosity, " 1 1 1"));
  write("matte.ply", gridCloud(1, 0, 8, albedo, " 1 1 1"));
  const auto dark = testing::HasSubstr("records have no");

  index({path("plain.ply"), path("colors.ply"), path("plain2.ply")});
  EXPECT_THAT(notes_.notes,
              Contains(testing::AllOf(HasSubstr("plain.ply and 1 more: 5 of 14 records have no "
                                                "colors, which "),
                                      HasSubstr("colors.ply has: they send and reflect no light"),
                                      HasSubstr("--set \"radiosity = 0.5\""))));
  EXPECT_EQ(std::count_if(
                notes_.notes.begin(), notes_.notes.end(),
                [](const std::string& note) { return note.find("records have no") != note.npos; }),
            1);
  index({path("colors.ply"), path("light.ply"), path("matte.ply")});
  EXPECT_THAT(notes_.notes, Contains(HasSubstr("light.ply: 1 of 11 records have no albedo")));
  EXPECT_THAT(notes_.notes, Contains(HasSubstr("matte.ply: 1 of 11 records have no radiosity")));
  index({path("colors.ply"), path("colors.ply")});
  EXPECT_THAT(notes_.notes, Not(Contains(dark)));
  index({path("plain.ply"), path("plain2.ply")});
  EXPECT_THAT(notes_.notes, Not(Contains(dark)));

  // The way out works
  ConvertOptions options;
  options.assignments = {"radiosity = 0.5", "albedo = 0.5"};
  ASSERT_TRUE(convert({path("plain.ply")}, "lit.ply", options).ok());
  index({path("colors.ply"), path("lit.ply")});
  EXPECT_THAT(notes_.notes, Not(Contains(dark)));
}

TEST_F(MergedClouds, PlacesTooFarApartForFloatsAreTold) {
  write("here.ply", gridCloud(30, 0, 0, "", ""));
  write("map.ply", gridCloud(30, 500000, 5000000, "", ""));
  write("near.ply", gridCloud(30, 40, 90, "", ""));
  const auto loss = HasSubstr("of the surfels are rounded to");
  index({path("here.ply"), path("map.ply")});
  EXPECT_THAT(notes_.notes, Contains(testing::AllOf(loss, HasSubstr("50 %"))));
  // One cloud with both places, too
  ASSERT_TRUE(convert({path("map.ply"), path("here.ply")}, "both.ply").ok());
  index({path("both.ply")});
  EXPECT_THAT(notes_.notes, Contains(loss));
  for (const char* other : {"near.ply", "here.ply"}) {
    index({path("here.ply"), path(other)});
    EXPECT_THAT(notes_.notes, Not(Contains(loss))) << other;
  }
  index({path("map.ply")});
  EXPECT_THAT(notes_.notes, Not(Contains(loss)));
}

TEST_F(MergedClouds, ScenesKeepNamesOfGroupsAndTheReferenceSystem) {
  index({cloud("lamp.ply", "comment crs EPSG:32610\ncomment group 1 lamp\n", 1)});
  for (const char* name : {"back.ply", "back.xyz", "back.las"}) {
    ASSERT_TRUE(convert({path("scene.sft")}, name).ok());
    const auto reader = openRowReader(path(name));
    ASSERT_TRUE(reader.ok());
    EXPECT_THAT((*reader)->comments(), Contains("crs EPSG:32610")) << name;
  }
  index({path("back.ply")});
  EXPECT_THAT(groupsOfScene(), testing::ElementsAre("1 lamp"));
}

TEST_F(MergedClouds, CloudsWithoutGroupsAreNotTakenForAGroupWithAName) {
  write("plain.ply", gridCloud(1, 0, 6, "", ""));
  index({cloud("lamp.ply", "comment group 0 lamp\n", 0), path("plain.ply")});
  EXPECT_THAT(notes_.notes, Contains(HasSubstr("plain.ply: no object groups, so its surfels are of "
                                               "group 0, which is \"lamp\"")));
}

TEST_F(MergedClouds, WhatACloudLacksIsWhatItsAbsenceMeans) {
  const std::string rgb = "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  const std::string radiosity =
      "property float radiosity_r\nproperty float radiosity_g\nproperty float radiosity_b\n";
  write("pane.ply", gridCloud(1, 0, 0, radiosity + "property float opacity\n", " 2 3 4 .25"));
  write("wall.ply", gridCloud(1, 0, 2, rgb, " 255 0 0"));
  ASSERT_TRUE(convert({path("pane.ply"), path("wall.ply")}, "all.ply").ok());
  EXPECT_THAT(columnOf(path("all.ply"), "opacity"), testing::ElementsAre(.25, 1));
  EXPECT_THAT(columnOf(path("all.ply"), "radiosity_r"), testing::ElementsAre(2, 1));
  EXPECT_THAT(columnOf(path("all.ply"), "radiosity_g"), testing::ElementsAre(3, 0));
  EXPECT_THAT(notes_.notes, Contains(HasSubstr("1 or the largest code is written: opacity")));
  EXPECT_THAT(notes_.notes, Contains(HasSubstr("the color is written: radiosity_r")));
  // So that the scene of the merged cloud is that of the clouds
  ASSERT_TRUE(indexClouds({path("all.ply")}, path("all.sft"), {}, notes_).ok());
  index({path("pane.ply"), path("wall.ply")});
  ASSERT_TRUE(convert({path("scene.sft")}, "one.ply").ok());
  ASSERT_TRUE(convert({path("all.sft")}, "two.ply").ok());
  for (const char* name : {"x", "radiosity_r", "radiosity_b", "opacity"}) {
    EXPECT_EQ(columnOf(path("one.ply"), name), columnOf(path("two.ply"), name)) << name;
  }
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
