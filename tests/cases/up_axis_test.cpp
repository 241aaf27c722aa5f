// The axis that is up goes from clouds to scenes, results and pictures of the sky.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "cases/case_files.h"
#include "cloud/cloud_formats.h"
#include "core/up_comment.h"
#include "gather/environment_pictures.h"
#include "io/row_stream_test.h"
#include "io/test_directory.h"
#include "surfeit/bake.h"
#include "surfeit/convert.h"
#include "surfeit/index.h"
#include "surfeit/scene.h"

namespace surfeit {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;

class UpAxisTest : public DirectoryTest {
 protected:
  // Receivers of three orientations, which are surfels too; z is up, if anything.
  std::string cloud(const std::string& name, const std::string& comment) const {
    write(name, "ply\nformat ascii 1.0\n" + comment +
                    "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
                    "property float nx\nproperty float ny\nproperty float nz\nproperty float "
                    "radius\nend_header\n0 0 0 0 0 1 .1\n5 0 0 .8 0 .6 .1\n0 5 1 0 -1 0 .1\n");
    return path(name);
  }
  UpAxis upOfScene(const std::vector<std::string>& clouds, const IndexOptions& options = {}) {
    const auto stats = indexClouds(clouds, path("scene.sft"), options, notes_);
    EXPECT_TRUE(stats.ok()) << stats.status().message();
    const Result<SceneInfo> info = readSceneInfo(path("scene.sft"));
    EXPECT_TRUE(info.ok());
    return info->up;
  }
  std::string convert(const std::string& from, const std::string& to,
                      const ConvertOptions& options = {}) {
    const auto stats = convertClouds({from}, path(to), options, notes_);
    EXPECT_TRUE(stats.ok()) << stats.status().message();
    return path(to);
  }
  std::optional<UpAxis> statedBy(const std::string& file) {
    const auto reader = openRowReader(file);
    EXPECT_TRUE(reader.ok()) << reader.status().message();
    return statedUpAxis((*reader)->comments());
  }
  Notes notes_;
};

TEST_F(UpAxisTest, ScenesHaveWhatTheirCloudsSay) {
  EXPECT_EQ(upOfScene({cloud("plain.ply", "")}), UpAxis::kY);
  EXPECT_EQ(upOfScene({cloud("z.ply", "comment up z\n")}), UpAxis::kZ);
  EXPECT_EQ(upOfScene({cloud("x.ply", "comment of one\ncomment up x\n")}), UpAxis::kX);
  IndexOptions asked;
  asked.up = UpAxis::kY;
  EXPECT_EQ(upOfScene({path("z.ply")}, asked), UpAxis::kY);
  EXPECT_EQ(upOfScene({convert(path("z.ply"), "z.las")}), UpAxis::kZ);
  EXPECT_TRUE(std::none_of(notes_.notes.begin(), notes_.notes.end(), [](const std::string& note) {
    return note.find(" up") != std::string::npos;
  }));
  // The first of those that disagree
  EXPECT_EQ(upOfScene({path("z.ply"), path("plain.ply")}), UpAxis::kZ);
  EXPECT_THAT(notes_.notes, Contains(HasSubstr("plain.ply: y is up, but z in")));
}

TEST_F(UpAxisTest, ItStaysThroughFormatsThatHaveAPlaceForIt) {
  const std::string z = cloud("z.ply", "comment up z\n");
  for (const char* name : {"a.ply", "a.txt", "a.vdb", "a.las", "a.ply.gz"}) {
    notes_.notes.clear();
    EXPECT_EQ(statedBy(convert(z, name)), UpAxis::kZ) << name;
    EXPECT_THAT(notes_.notes, Not(Contains(HasSubstr("up axis")))) << name;
  }
  for (const char* name : {"a.ptc", "a.bgeo", "a.pdb", "a.prt", "a.csv"}) {
    notes_.notes.clear();
    convert(z, name);
    EXPECT_THAT(notes_.notes, Contains(HasSubstr("no place for the up axis, z: give --up z")))
        << name;
  }
  notes_.notes.clear();
  convert(cloud("y.ply", "comment up y\n"), "y.las");
  EXPECT_THAT(notes_.notes, Contains(HasSubstr("LAS has no place for the up axis, y")));
  upOfScene({z});
  EXPECT_EQ(statedBy(convert(path("scene.sft"), "back.ply")), UpAxis::kZ);
}

TEST_F(UpAxisTest, ConvertTurnsFromWhatIsStated) {
  const std::string z = cloud("z.ply", "comment up z\n"), plain = cloud("plain.ply", "");
  ConvertOptions to_y, to_z;
  to_y.up = UpAxis::kY;
  to_z.up = UpAxis::kZ;
  for (const std::string& from : {z, plain}) {
    const std::string turned = convert(from, "turned.ply", to_y);
    EXPECT_THAT(columnOf(turned, "y"), ElementsAre(0, 0, 1));
    EXPECT_THAT(columnOf(turned, "z"), ElementsAre(0, 0, -5));
    EXPECT_EQ(statedBy(turned), UpAxis::kY);
    EXPECT_EQ(columnOf(convert(turned, "again.ply", to_y), "y"), columnOf(turned, "y"));
    EXPECT_EQ(columnOf(convert(turned, "back.ply", to_z), "y"), columnOf(z, "y"));
  }
  EXPECT_EQ(columnOf(convert(z, "same.ply", to_z), "y"), columnOf(z, "y"));
}

TEST_F(UpAxisTest, TheSkyStandsOnIt) {
  // Light from above alone, the same all around
  const TestPicture sky(64, 32, [](int, int row) { return glm::vec3(row < 16 ? 1.f : 0.f); });
  writeExr(sky, path("sky.exr"));
  const auto lightOf = [&](const std::string& surfels, std::optional<UpAxis> up) {
    upOfScene({surfels});
    GatherOptions options;
    options.mode = GatherMode::kBleeding;
    options.environment.path = path("sky.exr");
    options.environment.up = up;
    const auto stats = gatherCloud(path("scene.sft"), surfels, path("lit.ply"), options, notes_);
    EXPECT_TRUE(stats.ok()) << stats.status().message();
    return columnOf(path("lit.ply"), "environment_r");
  };
  const std::string z = cloud("z.ply", "comment up z\n");
  ConvertOptions to_y;
  to_y.up = UpAxis::kY;
  const std::string y = convert(z, "y.ply", to_y);
  const std::vector<double> upright = lightOf(z, std::nullopt);
  EXPECT_NEAR(upright[0], 3.14159, .01);
  EXPECT_NEAR(upright[2], 3.14159 / 2, .05);
  const std::vector<double> turned = lightOf(y, std::nullopt);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(turned[i], upright[i], .01) << i;
  // Who says otherwise lays it down
  EXPECT_NEAR(lightOf(z, UpAxis::kY)[0], 3.14159 / 2, .05);
}

}  // namespace
}  // namespace surfeit
