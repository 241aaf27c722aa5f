#include "surfeit/composite.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "io/exr_test_picture.h"
#include "io/test_directory.h"
#include "view/read_exr.h"

namespace surfeit {
namespace {

using testing::HasSubstr;

const Imath::Box2i kWindow({2, 1}, {7, 4});  // within the display window from -2 -3 to 40 30

class CompositeTest : public DirectoryTest {
 protected:
  void SetUp() override {
    DirectoryTest::SetUp();
    ExrTestPart passes = floorPasses(kWindow);
    passes.add("A", [](int x, int) { return x == 0 ? 0 : 1; });
    passes.add("Z", [](int x, int) { return 3 + x; });
    addColor(passes, "albedo", 0.5f);
    addColor(passes, "radiosity", 0.25f);
    writeExrTest(path("passes.exr"), {passes});
    ExrTestPart result = floorPasses(kWindow);
    result.add("A", [](int x, int) { return x <= 1 ? 0 : 1; });
    addColor(result, "irradiance", 0.75f);
    result.add("occlusion", [](int, int y) { return 0.25 * y; });
    writeExrTest(path("result.exr"), {result});
  }

  static void addColor(ExrTestPart& part, const std::string& layer, float value) {
    part.add(layer + ".R", [&](int, int) { return value; });
    part.add(layer + ".G", [&](int x, int) { return value * float(x); });
    part.add(layer + ".B", [&](int, int y) { return value * float(y); });
  }

  Status compose(const std::vector<std::string>& inputs, const std::string& channel) {
    std::vector<std::string> paths;
    for (const std::string& input : inputs) paths.push_back(path(input));
    options_.channel = channel;
    SURFEIT_ASSIGN_OR_RETURN(stats_,
                             compositePicture(paths, path("picture.exr"), options_, progress_));
    picture_ = readExr(path("picture.exr"));
    return {};
  }
  // Index of a pixel of the data window.
  std::size_t pixel(int x, int y) const { return picture_.at(x + 2 + 2, y + 1 + 3); }

  CompositeOptions options_;
  CompositeStats stats_;
  ExrPicture picture_;
  Progress progress_;
};

TEST_F(CompositeTest, MultipliesAndAddsTheLayersOfSeveralPictures) {
  ASSERT_TRUE(compose({"passes.exr", "result.exr"}, "lit").ok());
  EXPECT_EQ(picture_.width, 43);
  EXPECT_EQ(picture_.height, 34);
  EXPECT_EQ(stats_.pixels, 20u);
  EXPECT_EQ(picture_.r[pixel(3, 2)], 0.25f + 0.5f * 0.75f);
  EXPECT_EQ(picture_.g[pixel(3, 2)], 3 * 0.25f + 9 * 0.5f * 0.75f);
  EXPECT_EQ(picture_.a[pixel(3, 2)], 1);
  EXPECT_EQ(picture_.z[pixel(3, 2)], 6);
  EXPECT_EQ(picture_.a[pixel(0, 2)], 0);
  // Where the second has no pixel, it adds nothing
  EXPECT_EQ(picture_.r[pixel(1, 2)], 0.25f);
  ASSERT_TRUE(compose({"passes.exr", "result.exr"}, "indirect").ok());
  EXPECT_EQ(picture_.b[pixel(3, 2)], 4 * 0.5f * 0.75f);
  EXPECT_EQ(picture_.b[pixel(1, 2)], 0);
  ASSERT_TRUE(compose({"passes.exr", "result.exr"}, "radiosity").ok());
  EXPECT_EQ(picture_.b[pixel(3, 2)], 0.5f);
}

TEST_F(CompositeTest, ThePixelsAreThoseOfTheFirst) {
  ASSERT_TRUE(compose({"result.exr", "passes.exr"}, "").ok());
  EXPECT_EQ(stats_.channel, "lit");
  EXPECT_EQ(stats_.pixels, 16u);
  EXPECT_EQ(picture_.a[pixel(1, 2)], 0);
  EXPECT_EQ(picture_.r[pixel(3, 2)], 0.25f + 0.5f * 0.75f);
  ASSERT_TRUE(compose({"result.exr"}, "ao").ok());
  EXPECT_EQ(picture_.r[pixel(3, 2)], 0.5f);
}

TEST_F(CompositeTest, ReducedPixelsAreMeans) {
  options_.reduce = 2;
  ASSERT_TRUE(compose({"passes.exr"}, "radiosity").ok());
  EXPECT_EQ(picture_.width, 22);
  // Columns 4 and 5 of the display window are 0 and 1 of the data window, of which 0 is empty
  EXPECT_EQ(picture_.a[picture_.at(2, 3)], 0.5f);
  EXPECT_EQ(picture_.r[picture_.at(2, 3)], 0.125f);
  EXPECT_EQ(picture_.g[picture_.at(3, 3)], 0.625f);  // of 2 and 3
}

TEST_F(CompositeTest, ValuesThatAreNoNumbersAreMagenta) {
  ExrTestPart part = floorPasses(kWindow);
  part.add("occlusion",
           [](int x, int) { return x == 4 ? std::numeric_limits<float>::quiet_NaN() : 0; });
  writeExrTest(path("bad.exr"), {part});
  ASSERT_TRUE(compose({"bad.exr"}, "ao").ok());
  EXPECT_EQ(stats_.non_finite_values, 4u);
  EXPECT_EQ(picture_.r[pixel(4, 1)], 1);
  EXPECT_EQ(picture_.g[pixel(4, 1)], 0);
}

TEST_F(CompositeTest, RefusesWhatCannotWork) {
  EXPECT_THAT(compose({"passes.exr"}, "lit").message(), HasSubstr("no channel \"lit\""));
  writeExrTest(path("other.exr"), {floorPasses()});
  EXPECT_THAT(compose({"passes.exr", "other.exr"}, "lit").message(),
              HasSubstr("another data window"));
  write("cloud.ply",
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
        "property float z\nend_header\n0 0 0\n");
  EXPECT_THAT(compose({"cloud.ply"}, "position").message(),
              HasSubstr("expected an OpenEXR picture"));
  options_.memory_bytes = 1 << 20;
  EXPECT_EQ(compose({"passes.exr"}, "albedo").code(), StatusCode::kBudgetTooSmall);
  options_.memory_bytes = 0;
  options_.reduce = 0;
  EXPECT_EQ(compose({"passes.exr"}, "albedo").code(), StatusCode::kInvalidArgument);
  EXPECT_EQ(compose({}, "albedo").code(), StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace surfeit
