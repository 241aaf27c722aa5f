// Opacities of colors in files of many kinds.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "cloud/rows/channels.h"
#include "io/surfel_cloud_test.h"
#include "surfeit/convert.h"
#include "surfels/open_surfel_source.h"

namespace surfeit {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;

class TintedClouds : public SurfelCloudTest {
 protected:
  std::string tinted(const std::string& type, const std::string& values) {
    return cloud({"float x", "float y", "float z", "float radius", type + " opacity_r",
                  type + " opacity_g", type + " opacity_b"},
                 {"1 2 3 .5 " + values, "2 3 4 .5 " + values});
  }
  static void expectOpacity(const Surfel& surfel, float red, float green, float blue,
                            const std::string& where, float error = 1e-5f) {
    EXPECT_NEAR(surfel.opacity(0), red, error) << where;
    EXPECT_NEAR(surfel.opacity(1), green, error) << where;
    EXPECT_NEAR(surfel.opacity(2), blue, error) << where;
  }
};

TEST_F(TintedClouds, ConvertKeepsThemInEveryFormat) {
  tinted("float", ".25 .5 1");
  Progress progress;
  for (const char* file : {"b.ply", "b.csv", "b.ptc", "b.prt", "b.bgeo", "b.vdb", "b.las"}) {
    const auto stats = convertClouds({path("a.ply")}, path(file), {}, progress);
    ASSERT_TRUE(stats.ok()) << stats.status().message();
    const auto source = open(path(file));
    ASSERT_NE(source, nullptr) << file;
    EXPECT_TRUE(source->channels().opacity && source->channels().tint) << file;
    const std::vector<Surfel> surfels = readAll(*source);
    ASSERT_EQ(surfels.size(), 2u) << file;
    for (const Surfel& surfel : surfels) expectOpacity(surfel, .25f, .5f, 1, file);
  }
}

TEST_F(TintedClouds, IntegersArePartsOfTheLargest) {
  expectOpacity(readAll(*open(tinted("uchar", "51 0 255")))[0], .2f, 0, 1, "uchar", 2e-5f);
  expectOpacity(readAll(*open(tinted("ushort", "13107 0 65535")))[0], .2f, 0, 1, "ushort", 2e-5f);
  // Whole reals up to 255, as opacity is
  expectOpacity(readAll(*open(tinted("float", "51 0 255")))[0], .2f, 0, 1, "float", 2e-5f);
}

TEST_F(TintedClouds, SurfelsComeBackFromTheirRows) {
  std::vector<Surfel> surfels = randomSurfels(50);
  for (std::size_t i = 0; i < surfels.size(); ++i) {
    surfels[i].transparency = std::uint16_t(i * 1000);
    surfels[i].tint = tintOf(surfels[i].transparency, std::uint16_t(i * 10), kMostTransparency);
  }
  CloudChannels channels;
  channels.normal = channels.radius = channels.area = channels.opacity = channels.tint = true;
  Result<SurfelWriter> writer = SurfelWriter::create(path("b.ply"), channels);
  ASSERT_TRUE(writer.ok());
  ASSERT_TRUE(writer->write(surfels).ok());
  ASSERT_TRUE(writer->finish().ok());
  const std::vector<Surfel> found = readAll(*open(path("b.ply")));
  ASSERT_EQ(found.size(), surfels.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    EXPECT_EQ(found[i].transparency, surfels[i].transparency) << i;
    EXPECT_EQ(found[i].tint, surfels[i].tint) << i;
  }
}

TEST_F(TintedClouds, AnIncompleteOneIsAnError) {
  const Result<std::unique_ptr<SurfelSource>> source = openSurfelSource(
      cloud({"float x", "float y", "float z", "float opacity_r", "float opacity_b"}, {"1 2 3 1 1"}),
      false);
  ASSERT_FALSE(source.ok());
  EXPECT_THAT(source.status().message(), HasSubstr("without opacity_g"));
}

TEST_F(TintedClouds, NothingIsToldWhereAllIsUsed) {
  EXPECT_THAT(open(tinted("float", ".25 .5 1"))->notes(),
              testing::Not(Contains(HasSubstr("opacity"))));
}

// As its surfels are where the clouds are indexed side by side.
TEST_F(TintedClouds, MergedWithOneOpacityItIsThatOfAllColors) {
  tinted("float", ".25 .5 1");
  write("b.ply",
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty "
        "float z\nproperty float radius\nproperty float opacity\nend_header\n5 5 5 .5 .75\n");
  Progress progress;
  ASSERT_TRUE(convertClouds({path("a.ply"), path("b.ply")}, path("c.ply"), {}, progress).ok());
  const std::vector<Surfel> surfels = readAll(*open(path("c.ply")));
  ASSERT_EQ(surfels.size(), 3u);
  expectOpacity(surfels[0], .25f, .5f, 1, "colors");
  expectOpacity(surfels[2], .75f, .75f, .75f, "one");
  EXPECT_FALSE(surfels[2].isTinted());
}

}  // namespace
}  // namespace surfeit
