#include <gmock/gmock.h>

#include <atomic>
#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <string>
#include <vector>

#include "cloud/ply/ply_reader.h"
#include "core/spherical_harmonics.h"
#include "sample/reference.h"
#include "sample/scene_files.h"
#include "surfeit/sample.h"

namespace surfeit {
namespace {

using ::testing::HasSubstr;

struct StoredPhoton {
  glm::vec3 position, normal, power, incident, albedo;
};

class PhotonTracing : public SceneFiles {
 protected:
  std::vector<StoredPhoton> trace(const std::string& mesh, const PhotonTracingOptions& options) {
    const Result<PhotonTracingStats> stats =
        tracePhotons({mesh}, path("photons.ply"), options, notes_);
    EXPECT_TRUE(stats.ok()) << stats.status().message();
    if (!stats.ok()) return {};
    stats_ = *stats;
    return readPhotons();
  }
  std::vector<StoredPhoton> readPhotons() const {
    Result<PlyReader> reader = PlyReader::open(path("photons.ply"));
    EXPECT_TRUE(reader.ok()) << reader.status().message();
    const RowLayout& element = reader->header().elements[0];
    EXPECT_EQ(element.row_bytes, sizeof(StoredPhoton));
    const char* const kNames[] = {"x", "nx", "power_r", "incident_x", "albedo_r"};
    for (std::size_t i = 0; i < 5; ++i) EXPECT_EQ(element.properties[3 * i].name, kNames[i]);
    std::vector<StoredPhoton> photons(element.count);
    const auto bytes = std::as_writable_bytes(std::span(photons));
    EXPECT_TRUE(reader->seekElement(0).ok());
    for (std::size_t at = 0; at < bytes.size();) {
      const Result<std::size_t> rows = reader->readRows(bytes.subspan(at));
      EXPECT_TRUE(rows.ok() && *rows > 0);
      if (!rows.ok() || *rows == 0) break;
      at += *rows * element.row_bytes;
    }
    return photons;
  }

  // A cube that faces inwards, of albedo Kd, and emits the exitance pi Ke everywhere.
  std::string emissiveBox(const std::string& albedo, double exitance) const {
    const std::string radiance = fmt::format("{:.9f}", exitance / double(kPi));
    write("box.mtl",
          "newmtl m\nKd " + albedo + "\nKe " + radiance + " " + radiance + " " + radiance + "\n");
    std::string obj = "mtllib box.mtl\nusemtl m\n";
    for (int i = 0; i < 8; ++i) obj += fmt::format("v {} {} {}\n", i & 1, (i >> 1) & 1, i >> 2);
    return write("box.obj",
                 obj + "f 2 4 3 1\nf 7 8 6 5\nf 5 6 2 1\nf 4 8 7 3\nf 3 7 5 1\nf 6 8 4 2\n");
  }

  // Irradiance in red on the part of the photons' surface that `holds` chooses.
  static double irradiance(const std::vector<StoredPhoton>& photons, double area,
                           const std::function<bool(const glm::vec3&)>& holds) {
    double power = 0;
    for (const StoredPhoton& photon : photons) {
      if (holds(photon.position)) power += double(photon.power.r);
    }
    return power / area;
  }

  RecordedNotes notes_;
  PhotonTracingStats stats_;
};

bool isAtMiddle(const glm::vec3& p) { return std::abs(p.x) < 0.2f && std::abs(p.z) < 0.2f; }

// Power arrives once, and albedo times, and albedo^2 times ...: emitted / (1 - albedo) in all.
TEST_F(PhotonTracing, InAClosedBoxStoredPowerIsTheGeometricSeries) {
  PhotonTracingOptions options;
  options.photons = 100000;
  const std::vector<StoredPhoton> photons =
      trace(emissiveBox("0.75 0.5 0", /* exitance= */ 2), options);
  EXPECT_EQ(stats_.emitted, 100000u);
  EXPECT_EQ(stats_.escaped, 0u);
  EXPECT_LT(stats_.lost_at_backs, 10u);  // through the cracks of edges
  EXPECT_EQ(stats_.stored, photons.size());
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(stats_.emitted_power[i], 12, 1e-6);
  // A chain has 4 links on average, give or take 3.5: a hundredth is 3 standard deviations
  EXPECT_NEAR(stats_.stored_power.r, 12 / (1 - 0.75), 0.01 * 48);
  EXPECT_NEAR(stats_.stored_power.g, 12 / (1 - 0.5), 0.01 * 24);
  EXPECT_NEAR(stats_.stored_power.b, 12, 0.001 * 12);

  glm::dvec3 sum(0);
  for (const StoredPhoton& photon : photons) {
    sum += glm::dvec3(photon.power);
    ASSERT_LT(glm::dot(photon.incident, photon.normal), 0);
    ASSERT_NEAR(glm::length(photon.incident), 1, 1e-5);
    ASSERT_EQ(photon.albedo, glm::vec3(0.75f, 0.5f, 0));
  }
  EXPECT_NEAR(glm::length(sum - stats_.stored_power), 0, 1e-9);
}

TEST_F(PhotonTracing, PowersStayAlikeWhereAlbedosAre) {
  PhotonTracingOptions options;
  options.photons = 5000;
  for (const StoredPhoton& photon : trace(emissiveBox("0.6 0.6 0.6", 1), options)) {
    ASSERT_NEAR(photon.power.r / (6.0f / 5000), 1, 1e-3);
  }
}

// Nothing is absorbed, so that only the limit on survival ends the paths.
TEST_F(PhotonTracing, PathsEndInAWhiteBox) {
  PhotonTracingOptions options;
  options.photons = 200;
  trace(emissiveBox("1 1 1", 1), options);
  EXPECT_GT(stats_.stored, 200u * 20);
  EXPECT_LT(stats_.stored, 200u * 60);
}

TEST_F(PhotonTracing, PointLightFallsOffWithTheSquareAndTheCosine) {
  PhotonTracingOptions options;
  options.photons = 400000;
  options.surroundings.default_albedo = glm::vec3(0);
  options.surroundings.lights.points.push_back({{0, 2, 0}, {3, 2, 1}});
  const auto photons = trace(write("floor.ply", floorPly(8)), options);
  EXPECT_NEAR(stats_.emitted_power.r, 12 * double(kPi), 1e-4);
  EXPECT_EQ(stats_.stored + stats_.escaped, 400000u);
  // The floor's solid angle: 4 atan(a^2 / (h sqrt(2 a^2 + h^2)))
  EXPECT_NEAR(stats_.stored_power.r, 3 * 4 * std::atan(16 / (2 * std::sqrt(36.0))), 0.05);
  EXPECT_NEAR(irradiance(photons, 0.16, isAtMiddle), 3.0 / 4, 0.05 * 0.75);
  const double far = irradiance(photons, 1, [](const glm::vec3& p) {
    return std::abs(p.x - 2) < 0.5f && std::abs(p.z) < 0.5f;
  });
  EXPECT_NEAR(far, 3 * 2 / std::pow(8, 1.5), 0.04 * 0.265);
}

TEST_F(PhotonTracing, DirectionalLightIsEvenWhateverItsAngle) {
  PhotonTracingOptions options;
  options.photons = 200000;
  options.surroundings.default_albedo = glm::vec3(0);
  options.surroundings.lights.directionals.push_back({{3, -4, 0}, {5, 5, 5}});
  const auto photons = trace(write("floor.ply", floorPly(4)), options);
  EXPECT_NEAR(stats_.stored_power.r / (16 * 5 * 0.8), 1, 0.01);
  const auto isAtCorner = [](const glm::vec3& p) { return p.x > 1.5f && p.z > 1.5f; };
  EXPECT_NEAR(irradiance(photons, 0.25, isAtCorner), 4, 0.1 * 4);
  ASSERT_FALSE(photons.empty());
  EXPECT_NEAR(glm::distance(photons[0].incident, glm::vec3(0.6f, -0.8f, 0)), 0, 1e-5);
}

// Area light and emissive triangles against the direct light of surfels, which samples them by
// shadow rays.
TEST_F(PhotonTracing, AreaLightsAgreeWithDirectLight) {
  PhotonTracingOptions options;
  options.photons = 3000000;
  options.surroundings.default_albedo = glm::vec3(0);
  options.surroundings.lights.areas.push_back(
      {{0.4f, 1, 0}, {0.3f, 0.1f, 0}, {0, 0, -0.5f}, {2, 2, 2}});
  write("lamp.mtl", "newmtl black\nKd 0 0 0\nnewmtl lamp\nKd 0 0 0\nKe 3 3 3\n");
  const std::string mesh = write("lamp.obj",
                                 "mtllib lamp.mtl\nusemtl black\n"
                                 "v -4 0 4\nv 4 0 4\nv 4 0 -4\nv -4 0 -4\nf 1 2 3 4\n"
                                 "usemtl lamp\n"
                                 "v -1 1 0\nv -0.5 1 0\nv -1 1.2 0.5\nf 5 6 7\n");
  const auto photons = trace(mesh, options);
  const Result<ReferenceScene> scene =
      ReferenceScene::load({mesh}, options.surroundings, 1, notes_);
  ASSERT_TRUE(scene.ok());
  for (const glm::vec2& place : {glm::vec2(0, 0), glm::vec2(0.5f, 0.1f), glm::vec2(-1, 0.8f)}) {
    double expected = 0;
    constexpr int kGrid = 8;
    const auto at = [&](int i, float c) { return c + 0.3f * ((float(i) + 0.5f) / kGrid - 0.5f); };
    for (int i = 0; i < kGrid * kGrid; ++i) {
      SurfacePoint point;
      point.position = {at(i % kGrid, place.x), 0, at(i / kGrid, place.y)};
      point.normal = point.geometric_normal = {0, 1, 0};
      expected += double(scene->light().irradiance(point, std::uint64_t(i), 256).r) / kGrid / kGrid;
    }
    const double found = irradiance(photons, 0.09, [&](const glm::vec3& p) {
      return p.y < 0.1f && std::abs(p.x - place.x) < 0.15f && std::abs(p.z - place.y) < 0.15f;
    });
    EXPECT_NEAR(found / expected, 1, 0.03) << place.x << " " << place.y;
  }
}

TEST_F(PhotonTracing, BacksBlockAndStoreNothing) {
  PhotonTracingOptions options;
  options.photons = 10000;
  options.surroundings.lights.points.push_back({{0, -2, 0}, {1, 1, 1}});  // below the floor
  options.surroundings.ground.enabled = false;
  const Result<PhotonTracingStats> stats =
      tracePhotons({write("floor.ply", floorPly(4))}, path("photons.ply"), options, notes_);
  EXPECT_EQ(stats.status().code(), StatusCode::kInvalidArgument);
  EXPECT_THAT(stats.status().message(), HasSubstr("none of 10000 photons met the front"));
  EXPECT_FALSE(std::filesystem::exists(path("photons.ply")));
}

TEST_F(PhotonTracing, ThreadsDoNotChangeABitAndSeedsDo) {
  PhotonTracingOptions options;
  options.photons = 20000;
  const std::string mesh = emissiveBox("0.5 0.4 0.3", 1);
  std::string bytes;
  for (const int threads : {1, 2, 5}) {
    options.threads = threads;
    trace(mesh, options);
    const std::string now = read(path("photons.ply"));
    EXPECT_TRUE(bytes.empty() || bytes == now) << threads << " threads";
    bytes = now;
  }
  options.seed = 1;
  trace(mesh, options);
  EXPECT_NE(read(path("photons.ply")), bytes);
}

TEST_F(PhotonTracing, NoLightAndBadOptionsAreRefusedAndLeaveNothing) {
  const std::string floor = write("floor.ply", floorPly(4));
  const auto status = [&](const PhotonTracingOptions& options) {
    return tracePhotons({floor}, path("photons.ply"), options, notes_).status();
  };
  EXPECT_EQ(status({}).code(), StatusCode::kInvalidArgument);
  EXPECT_THAT(status({}).message(), HasSubstr("no light and nothing emits"));
  PhotonTracingOptions options;
  options.surroundings.lights.points.push_back({{0, 2, 0}, {1, 1, 1}});
  options.photons = 0;
  EXPECT_THAT(status(options).message(), HasSubstr("photons 0: expected 1 to 2^40"));
  options.photons = 1;
  options.surroundings.lights.areas.emplace_back();
  EXPECT_EQ(status(options).code(), StatusCode::kInvalidArgument);
  EXPECT_FALSE(std::filesystem::exists(path("photons.ply")));
}

TEST_F(PhotonTracing, CancelledWorkLeavesNothing) {
  CancelAfter progress(5000);
  PhotonTracingOptions options;
  options.photons = 1'000'000;
  const Result<PhotonTracingStats> stats =
      tracePhotons({emissiveBox("0.5 0.5 0.5", 1)}, path("photons.ply"), options, progress);
  EXPECT_EQ(stats.status().code(), StatusCode::kInterrupted);
  EXPECT_FALSE(std::filesystem::exists(path("photons.ply")));
}

}  // namespace
}  // namespace surfeit
