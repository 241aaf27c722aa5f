// Meshes and passes as users have them, from the file to surfels: every shared case of a kind, and
// others of it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "cases/case_files.h"
#include "cloud/cloud_formats.h"
#include "io/row_stream_test.h"
#include "io/test_directory.h"
#include "surfeit/sample.h"
#include "surfels/open_surfel_source.h"

namespace surfeit {
namespace {

using testing::Contains;
using testing::HasSubstr;

class MeshCasesTest : public DirectoryTest {
 protected:
  std::vector<Surfel> sample(const std::string& mesh, std::uint64_t count = 2000) {
    SampleOptions options;
    options.count = count;
    const Result<SampleStats> stats = sampleMeshes({mesh}, path("surfels.ply"), options, notes_);
    status_ = stats.status();
    if (!stats.ok()) return {};
    const auto source = openSurfelSource(path("surfels.ply"), true);
    EXPECT_TRUE(source.ok()) << source.status().message();
    std::vector<Surfel> surfels(stats->surfels);
    EXPECT_EQ(*(*source)->read(surfels), surfels.size());
    return surfels;
  }
  static double areaOf(const std::vector<Surfel>& surfels) {
    double area = 0;
    for (const Surfel& surfel : surfels) area += double(surfel.area);
    return area;
  }

  Notes notes_;
  Status status_;
};

#define SKIP_WITHOUT(file) \
  if (!std::filesystem::exists(file)) GTEST_SKIP() << (file) << " is not here"

TEST_F(MeshCasesTest, ConcavePolygonsHaveTheirAreaAndFaceOneWay) {
  for (const char* name : {"obj/concave.obj", "obj/concave.ply"}) {
    const std::string mesh = sharedCase(name);
    SKIP_WITHOUT(mesh);
    const std::vector<Surfel> surfels = sample(mesh);
    EXPECT_NEAR(areaOf(surfels), 10, 1e-5) << name;
    for (const Surfel& surfel : surfels) EXPECT_EQ(surfel.normal, glm::vec3(0, 0, 1));
  }
}

TEST_F(MeshCasesTest, LeafCardsAreThereWhereTheirMaskIs) {
  const std::string mesh = sharedCase("obj/cards.obj");
  SKIP_WITHOUT(mesh);
  EXPECT_NEAR(areaOf(sample(mesh, 50000)), .25, .002);
}

TEST_F(MeshCasesTest, ContinuedLinesAreOne) {
  const std::string mesh = sharedCase("obj/continued.obj");
  SKIP_WITHOUT(mesh);
  EXPECT_NEAR(areaOf(sample(mesh)), 1, 1e-6);
}

TEST_F(MeshCasesTest, DecimalCommasAreRefusedWithTheWayOut) {
  const std::string mesh = sharedCase("obj/decimal_comma.obj");
  SKIP_WITHOUT(mesh);
  sample(mesh);
  EXPECT_THAT(status_.message(), HasSubstr("line 1: found \"0,25\""));
  EXPECT_THAT(status_.message(), HasSubstr("replace commas by points"));
}

TEST_F(MeshCasesTest, MaterialFilesWithBlanksAreNamed) {
  const std::string mesh = sharedCase("obj/mtl_spaces.obj");
  SKIP_WITHOUT(mesh);
  EXPECT_NEAR(areaOf(sample(mesh)), 1, 1e-6);
  if (!std::filesystem::exists(sharedCase("obj/space name.mtl"))) {
    EXPECT_THAT(notes_.notes, Contains(HasSubstr("\"space name.mtl\" not found")));
  }
}

TEST_F(MeshCasesTest, MeshesOnAMapKeepTheirPlaces) {
  const std::string local = sharedCase("georef/square_local.obj");
  const std::string utm = sharedCase("georef/square_utm.obj");
  SKIP_WITHOUT(utm);
  const auto columns = [&](const std::string& mesh) {
    sample(mesh, 200);
    const auto reader = openRowReader(path("surfels.ply"));
    EXPECT_TRUE(reader.ok());
    const std::vector<std::byte> rows = readAllRows(**reader);
    std::set<double> x, y;
    for (std::size_t i = 0; i < (*reader)->element().count; ++i) {
      x.insert(std::round(1e4 * valueOf(**reader, rows, i, "x")));
      y.insert(std::round(1e4 * valueOf(**reader, rows, i, "y")));
    }
    return std::pair(x.size(), y.size());
  };
  EXPECT_EQ(columns(local), columns(utm));
  EXPECT_EQ(status_.message(), "");
}

TEST_F(MeshCasesTest, PassesHoldPlacesOnTheSurface) {
  const std::string edges = sharedCase("exr/alpha_edges.exr");
  SKIP_WITHOUT(edges);
  const auto reader = openRowReader(edges);
  ASSERT_TRUE(reader.ok()) << reader.status().message();
  const std::vector<std::byte> rows = readAllRows(**reader);
  ASSERT_EQ((*reader)->element().count, 56u);
  for (std::size_t i = 0; i < 56; ++i) {
    EXPECT_EQ(valueOf(**reader, rows, i, "x"), valueOf(**reader, rows, i, "pixel_x"));
    EXPECT_EQ(valueOf(**reader, rows, i, "z"), 5);
  }
  EXPECT_THAT((*reader)->notes(), Contains(HasSubstr("8 of 56 pixels are covered in part")));

  const auto half = openRowReader(sharedCase("exr/half_far.exr"));
  ASSERT_TRUE(half.ok());
  EXPECT_THAT((*half)->notes(),
              Contains(HasSubstr("stored in 16 bits, which stand up to 2 apart")));
}

}  // namespace
}  // namespace surfeit
