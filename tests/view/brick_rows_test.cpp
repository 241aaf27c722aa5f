#include "view/brick_rows.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "io/test_directory.h"
#include "surfeit/brick.h"
#include "view/channel.h"

namespace surfeit {
namespace {

class BrickRows : public DirectoryTest {
 protected:
  // A cloud in z = 0 with those columns behind x y z nx ny nz radius.
  std::string cloud(const std::string& name, const std::vector<std::string>& properties,
                    const std::vector<std::string>& rows) const {
    std::string text = fmt::format("ply\nformat ascii 1.0\nelement vertex {}\n", rows.size());
    for (const char* property : {"x", "y", "z", "nx", "ny", "nz", "radius"}) {
      text += fmt::format("property float {}\n", property);
    }
    for (const std::string& property : properties) {
      text += fmt::format("property float {}\n", property);
    }
    text += "end_header\n";
    for (const std::string& row : rows) text += row + "\n";
    write(name, text);
    return path(name);
  }

  std::string map() const {
    std::vector<std::string> rows;
    for (int i = 0; i < 400; ++i) {
      rows.push_back(
          fmt::format("{} {} 0 0 0 1 0.03 0.25 1 2 3", (i % 20) / 20.0, (i / 20) / 20.0));
    }
    const std::string points =
        cloud("points.ply", {"occlusion", "irradiance_r", "irradiance_g", "irradiance_b"}, rows);
    Progress progress;
    const Result<BrickStats> stats = brickClouds({points}, path("map.vdb"), {}, progress);
    EXPECT_TRUE(stats.ok()) << stats.status().message();
    return path("map.vdb");
  }
};

TEST_F(BrickRows, ValuesOfTheMapTakeThePlaceOfTheClouds) {
  const std::string file = cloud("cloud.ply", {"occlusion", "albedo_r"},
                                 {"0.5 0.5 0 0 0 1 0.1 0.9 7", "0.5 0.5 0 0 0 -1 0.1 0.9 8",
                                  "9 9 9 0 0 1 0.1 0.9 9", "nan 0 0 0 0 1 0.1 0.9 10"});
  Result<std::unique_ptr<CloudRows>> opened = openCloudRows(file);
  ASSERT_TRUE(opened.ok());
  Result<std::unique_ptr<CloudRows>> rows = addBrickValues(std::move(*opened), map(), {});
  ASSERT_TRUE(rows.ok()) << rows.status().message();
  const RowLayout& element = (*rows)->element();
  const Result<Channel> occlusion = Channel::find(element, "occlusion", file);
  const Result<Channel> irradiance = Channel::find(element, "irradiance", file);
  const RowField albedo = RowField::find(element, "albedo_r");
  ASSERT_TRUE(occlusion.ok() && irradiance.ok() && albedo.exists());

  for (int pass = 0; pass < 2; ++pass) {
    const auto batch = (*rows)->next();
    ASSERT_TRUE(batch.ok()) << batch.status().message();
    ASSERT_EQ(batch->size(), 4 * element.row_bytes);
    EXPECT_NEAR(occlusion->value(batch->data()).x, 0.25f, 1e-6f);
    EXPECT_NEAR(irradiance->value(batch->data()).z, 3, 1e-6f);
    for (std::size_t i = 0; i < 4; ++i) {
      const std::byte* row = batch->data() + i * element.row_bytes;
      EXPECT_EQ(albedo.read(row), 7 + double(i));
      // Behind the surface, far away, and at no place there is nothing
      EXPECT_EQ(std::isnan(occlusion->value(row).x), i > 0) << i;
    }
    ASSERT_TRUE((*rows)->rewind().ok());
  }
}

TEST_F(BrickRows, WhatIsNoMapIsRefused) {
  const std::string file = cloud("cloud.ply", {}, {"0 0 0 0 0 1 0.1"});
  Result<std::unique_ptr<CloudRows>> rows = openCloudRows(file);
  ASSERT_TRUE(rows.ok());
  EXPECT_EQ(addBrickValues(std::move(*rows), file, {}).status().code(), StatusCode::kCorruption);
}

}  // namespace
}  // namespace surfeit
