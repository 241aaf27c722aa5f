#include "surfeit/view.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>
#include <vector>

#include "view/read_exr.h"

namespace surfeit {
namespace {

using testing::HasSubstr;

// Clouds and pictures in a folder of their own, seen from (0, 0, 10) towards the origin.
class View : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::path(testing::TempDir()) /
              fmt::format("surfeit_view_{}_{}", getpid(),
                          testing::UnitTest::GetInstance()->current_test_info()->name());
    std::filesystem::create_directories(folder_);
    options_.width = 64;
    options_.height = 48;
    options_.camera.eye = glm::dvec3(0, 0, 10);
    options_.camera.look_at = glm::dvec3(0);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string path(const std::string& name) const { return (folder_ / name).string(); }

  std::string writePly(const std::string& properties, const std::vector<std::string>& rows) {
    const std::string file = path(fmt::format("cloud{}.ply", ++clouds_));
    std::ofstream out(file);
    out << "ply\nformat ascii 1.0\nelement vertex " << rows.size() << "\n";
    for (std::size_t at = 0; at < properties.size();) {
      const std::size_t end = std::min(properties.find(' ', at), properties.size());
      out << "property float " << properties.substr(at, end - at) << "\n";
      at = end + 1;
    }
    out << "end_header\n";
    for (const std::string& row : rows) out << row << "\n";
    return file;
  }

  ExrPicture draw(const std::string& cloud) {
    const Result<ViewStats> stats = viewCloud(cloud, path("picture.exr"), options_, progress_);
    EXPECT_TRUE(stats.ok()) << stats.status().message();
    if (!stats.ok()) return {};
    stats_ = *stats;
    return readExr(path("picture.exr"));
  }

  StatusCode failure(const std::string& cloud, const std::string& picture = "picture.png") {
    return viewCloud(cloud, path(picture), options_, progress_).status().code();
  }

  // A noisy sphere of overlapping disks with random values.
  std::vector<std::string> noisySphere(int count) const {
    std::mt19937 random(7);
    std::normal_distribution<float> normal;
    std::vector<std::string> rows;
    for (int i = 0; i < count; ++i) {
      const glm::vec3 v(normal(random), normal(random), normal(random));
      const float length = std::sqrt(v.x * v.x + v.y * v.y + v.z * v.z);
      const glm::vec3 n = v / length;
      rows.push_back(fmt::format("{} {} {} {} {} {} 0.2 {} 0.5 {}", 2 * n.x, 2 * n.y, 2 * n.z, n.x,
                                 n.y, n.z, std::abs(n.x), std::abs(normal(random))));
    }
    return rows;
  }

  static constexpr const char* kDisk = "x y z nx ny nz radius radiosity_r radiosity_g radiosity_b";
  std::filesystem::path folder_;
  int clouds_ = 0;
  ViewOptions options_;
  ViewStats stats_;
  Progress progress_;
};

TEST_F(View, NearDiskHidesTheFarOneInEitherOrder) {
  const std::string near = "0 0 2 0 0 1 1 1 0 0", far = "0 0 -2 0 0 1 3 0 0 1";
  for (const auto& rows : {std::vector{near, far}, std::vector{far, near}}) {
    const ExrPicture picture = draw(writePly(kDisk, rows));
    const std::size_t middle = picture.at(32, 24);
    EXPECT_EQ(picture.r[middle], 1);
    EXPECT_EQ(picture.b[middle], 0);
    EXPECT_NEAR(picture.z[middle], 8, 1e-4);
    const std::size_t beside = picture.at(32 + 14, 24);
    EXPECT_EQ(picture.r[beside], 0);
    EXPECT_EQ(picture.b[beside], 1);
    EXPECT_NEAR(picture.z[beside], 12, 1e-4);
  }
}

// Pieces of a square of 2 by 2, of any shape, turned by an angle, at any scale: disks circumscribe
// them, and their areas are known. Before a far wall, they end where the square ends, and nothing
// of the wall shines through.
TEST_F(View, DisksEndAtTheEdgesOfTheirSurface) {
  options_.width = options_.height = 256;
  const double half_fov = options_.camera.fov_degrees * 3.14159265358979 / 360;
  const double edge = 128 * 0.1 / std::tan(half_fov);  // of the square, pixels from the middle
  constexpr int kPieces = 8;
  constexpr double kSide = 2.0 / kPieces;
  struct Case {
    double slant, turn, scale;
  };
  for (const Case& one : {Case{0, 0, 1}, Case{0.3, 0, 1}, Case{1, 0, 1}, Case{1, 0.4, 1},
                          Case{0, 1.1, 1e-4}, Case{1, 0.7, 1e5}}) {
    const double cosine = std::cos(one.turn), sine = std::sin(one.turn), scale = one.scale;
    options_.camera.eye = glm::dvec3(0, 0, 10 * scale);
    std::vector<std::string> rows = {
        fmt::format("0 0 {} 0 0 1 {} {} 0 0 1", -5 * scale, 40 * scale, 5000 * scale * scale)};
    const auto add = [&](double x, double y, double radius, double area) {
      rows.push_back(fmt::format("{} {} 0 0 0 1 {} {} 1 0 0", scale * (cosine * x - sine * y),
                                 scale * (sine * x + cosine * y), scale * radius,
                                 scale * scale * area));
    };
    for (int i = 0; i < kPieces * kPieces; ++i) {
      // Squares, or their halves
      const double x = -1 + (i % kPieces + 0.5) * kSide, y = -1 + (i / kPieces + 0.5) * kSide;
      const double shift = one.slant * kSide / 6, area = kSide * kSide;
      if (one.slant > 0) {
        add(x - shift, y - shift, 0.75 * kSide, area / 2);
        add(x + shift, y + shift, 0.75 * kSide, area / 2);
      } else {
        add(x, y, 0.7072 * kSide, area);
      }
    }
    const ExrPicture picture =
        draw(writePly("x y z nx ny nz radius area radiosity_r radiosity_g radiosity_b", rows));
    int most_beyond = 0;
    for (int y = 0; y < 256; ++y) {
      for (int x = 0; x < 256; ++x) {
        const double u = x + 0.5 - 128, v = 128 - (y + 0.5);
        const double off =
            std::max(std::abs(cosine * u + sine * v), std::abs(cosine * v - sine * u));
        const std::size_t at = picture.at(x, y);
        if (off < edge - 3) {
          EXPECT_EQ(picture.b[at], 0) << x << " " << y << " turned " << one.turn;
        }
        if (picture.r[at] > 0) most_beyond = std::max(most_beyond, int(std::ceil(off - edge)));
      }
    }
    // Circles around the pieces reach 3 to 5 pixels beyond
    EXPECT_LE(most_beyond, 2) << one.slant << " turned " << one.turn << " scale " << scale;
  }
}

TEST_F(View, OverlappingNeighboursOfOneSurfaceBlend) {
  const ExrPicture picture =
      draw(writePly(kDisk, {"-0.5 0 0.01 0 0 1 2 1 0 0", "0.5 0 0 0 0 1 2 0 0 1"}));
  const std::size_t middle = picture.at(32, 24);
  EXPECT_NEAR(picture.r[middle], 0.5, 0.06);
  EXPECT_NEAR(picture.b[middle], 0.5, 0.06);
  EXPECT_GT(picture.r[picture.at(26, 24)], picture.b[picture.at(26, 24)]);
}

TEST_F(View, BackOfAThinWallDoesNotShowThrough) {
  const ExrPicture picture =
      draw(writePly(kDisk, {"0 0 0 0 0 1 2 1 0 0", "0 0 -0.1 0 0 -1 2 0 0 1"}));
  EXPECT_NEAR(picture.r[picture.at(32, 24)], 1, 0.01);
  EXPECT_NEAR(picture.b[picture.at(32, 24)], 0, 0.01);
}

TEST_F(View, CullingLeavesOutBacks) {
  const std::string cloud = writePly(kDisk, {"0 0 0 0 0 -1 2 1 0 0"});
  EXPECT_EQ(draw(cloud).a[64 * 24 + 32], 1);
  options_.cull_back = true;
  EXPECT_EQ(draw(cloud).a[64 * 24 + 32], 0);
}

TEST_F(View, ThreadsDoNotChangeThePicture) {
  const std::string cloud = writePly(kDisk, noisySphere(3000));
  options_.threads = 1;
  const ExrPicture one = draw(cloud);
  options_.threads = 2;
  const ExrPicture two = draw(cloud);
  EXPECT_EQ(one.r, two.r);
  EXPECT_EQ(one.b, two.b);
  EXPECT_EQ(one.a, two.a);
  EXPECT_EQ(one.z, two.z);
}

TEST_F(View, OrderOfTheRecordsChangesRoundingOnly) {
  std::vector<std::string> rows = noisySphere(3000);
  const ExrPicture first = draw(writePly(kDisk, rows));
  std::shuffle(rows.begin(), rows.end(), std::mt19937(3));
  const ExrPicture second = draw(writePly(kDisk, rows));
  EXPECT_EQ(first.a, second.a);
  EXPECT_EQ(first.z, second.z);
  for (std::size_t i = 0; i < first.b.size(); ++i) {
    EXPECT_NEAR(first.b[i], second.b[i], 2e-3f * std::max(1.f, first.b[i]));  // a half's rounding
  }
}

TEST_F(View, CloudsWithoutRadiusCloseTheirSurface) {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> place(-3, 3);
  std::vector<std::string> rows;
  for (int i = 0; i < 4000; ++i) {
    rows.push_back(fmt::format("{} {} 0 0 0 1", place(random), place(random)));
  }
  options_.channel = "normal";
  const ExrPicture picture = draw(writePly("x y z nx ny nz", rows));
  EXPECT_TRUE(stats_.radius_estimated);
  int holes = 0;
  for (int y = 10; y < 38; ++y) {
    for (int x = 18; x < 46; ++x) holes += picture.a[picture.at(x, y)] < 1 ? 1 : 0;
  }
  EXPECT_LE(holes, 28 * 28 / 20);
}

TEST_F(View, RecordsWithoutNormalAreSpheres) {
  options_.mode = ViewMode::kNormals;
  const ExrPicture picture = draw(writePly("x y z radius", {"0 0 0 2"}));
  const std::size_t middle = picture.at(32, 24);
  EXPECT_NEAR(picture.z[middle], 8, 0.02);
  EXPECT_NEAR(picture.r[middle], 0.5, 0.05);
  EXPECT_NEAR(picture.b[middle], 1, 0.01);  // faces +z
  EXPECT_GT(picture.r[picture.at(40, 24)], 0.6f);
}

TEST_F(View, PointsHaveTheirSizeInPixels) {
  options_.mode = ViewMode::kPoints;
  options_.point_size = 3;
  draw(writePly("x y z", {"0.01 0.02 0", "2 1 0"}));
  EXPECT_NEAR(stats_.coverage * 64 * 48, 18, 1e-3);
}

TEST_F(View, ValuesThatAreNoNumbersAreMagenta) {
  const ExrPicture picture =
      draw(writePly("x y z nx ny nz radius occlusion", {"0 0 0 0 0 1 2 nan"}));
  EXPECT_EQ(stats_.channel, "ao");
  EXPECT_EQ(stats_.non_finite_values, 1u);
  EXPECT_EQ(picture.r[picture.at(32, 24)], 1);
  EXPECT_EQ(picture.g[picture.at(32, 24)], 0);
  EXPECT_EQ(picture.b[picture.at(32, 24)], 1);
}

TEST_F(View, RecordsThatCannotBeDrawnAreCounted) {
  draw(writePly(kDisk, {"0 0 0 0 0 1 2 1 0 0", "nan 0 0 0 0 1 2 1 0 0", "0 0 0 0 0 1 -1 1 0 0",
                        "0 0 0 0 inf 1 1 1 0 0"}));
  EXPECT_EQ(stats_.records, 4u);
  EXPECT_EQ(stats_.skipped_records, 3u);
  EXPECT_EQ(stats_.drawn_surfels, 1u);
  EXPECT_EQ(failure(writePly(kDisk, {"nan 0 0 0 0 1 2 1 0 0"})), StatusCode::kCorruption);
  EXPECT_EQ(failure(writePly(kDisk, {})), StatusCode::kCorruption);
}

TEST_F(View, DegenerateCloudsAreDrawn) {
  options_.camera = {};
  for (const auto& rows : {std::vector<std::string>{"5 6 7"},
                           {"0 0 0", "0 0 0"},
                           {"0 0 0", "1 0 0", "2 0 0", "3 0 0"},
                           {"0 0 0", "9e17 0 0"},
                           {"1e-30 0 0", "0 1e-30 0"},
                           {"0 0 0", "1e38 0 0"}}) {
    const ExrPicture picture = draw(writePly("x y z", rows));
    EXPECT_GT(stats_.coverage, 0) << rows.back();
  }
}

TEST_F(View, RangeMapsBlackAndWhite) {
  options_.channel = "height";
  options_.range = glm::dvec2(10, 30);
  const ExrPicture picture = draw(writePly("x y z nx ny nz radius height", {"0 0 0 0 0 1 2 15"}));
  EXPECT_NEAR(picture.g[picture.at(32, 24)], 0.25, 1e-3);
}

TEST_F(View, CloudsFarFromTheOriginStaySharp) {
  // The same disk at UTM-like coordinates, in doubles
  const std::string file = path("far.ply");
  std::ofstream(file) << "ply\nformat ascii 1.0\nelement vertex 1\nproperty double x\nproperty "
                         "double y\nproperty double z\nproperty float nx\nproperty float ny\n"
                         "property float nz\nproperty float radius\nend_header\n"
                         "500000.03 4649776.01 0.5 0 0 1 0.01\n";
  options_.camera.eye = glm::dvec3(500000.03, 4649776.01, 0.6);
  options_.camera.look_at = glm::dvec3(500000.03, 4649776.01, 0.5);
  const ExrPicture picture = draw(file);
  EXPECT_EQ(picture.a[picture.at(32, 24)], 1);
  EXPECT_EQ(picture.a[picture.at(31, 23)], 1);
  EXPECT_NEAR(picture.z[picture.at(32, 24)], 0.1, 1e-6);
  EXPECT_EQ(picture.a[picture.at(45, 24)], 0);
}

TEST_F(View, FailuresLeaveNoPicture) {
  const std::string cloud = writePly(kDisk, {"0 0 0 0 0 1 2 1 0 0"});
  options_.channel = "temperature";
  const Result<ViewStats> unknown = viewCloud(cloud, path("picture.png"), options_, progress_);
  EXPECT_EQ(unknown.status().code(), StatusCode::kInvalidArgument);
  EXPECT_THAT(unknown.status().message(), HasSubstr("position, normal, radius, radiosity"));
  options_.channel.clear();
  EXPECT_EQ(failure(cloud, "picture.bmp"), StatusCode::kInvalidArgument);
  EXPECT_EQ(failure(path("missing.ply")), StatusCode::kIoError);
  EXPECT_EQ(failure(writePly("x y radius", {"0 0 1"})), StatusCode::kCorruption);
  options_.memory_bytes = 1 << 20;
  EXPECT_EQ(failure(cloud), StatusCode::kBudgetTooSmall);
  options_.memory_bytes = 0;
  options_.samples = 9;
  EXPECT_EQ(failure(cloud), StatusCode::kInvalidArgument);
  EXPECT_FALSE(std::filesystem::exists(path("picture.png")));
}

TEST_F(View, CancellingLeavesNoPicture) {
  struct Cancelled : Progress {
    bool isCancelled() const override { return true; }
  } cancelled;
  const std::string cloud = writePly(kDisk, {"0 0 0 0 0 1 2 1 0 0"});
  EXPECT_EQ(viewCloud(cloud, path("picture.png"), options_, cancelled).status().code(),
            StatusCode::kInterrupted);
  EXPECT_FALSE(std::filesystem::exists(path("picture.png")));
}

}  // namespace
}  // namespace surfeit
