// Final gathering from photon maps: trace photons, estimate radiosity, index, gather; against what
// is known exactly and against traced paths.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <glm/geometric.hpp>
#include <random>
#include <string>
#include <vector>

#include "core/spherical_harmonics.h"
#include "core/tangent_frame.h"
#include "fidelity/baked_rows.h"
#include "io/test_directory.h"
#include "sample/reference.h"
#include "surfeit/bake.h"
#include "surfeit/index.h"
#include "surfeit/radiance.h"
#include "surfeit/sample.h"

namespace surfeit {
namespace {

struct Gathered {
  glm::vec3 position, normal, irradiance;
};

class PhotonMap : public DirectoryTest {
 protected:
  // Irradiance at `receivers` places of the mesh from a photon map of it.
  std::vector<Gathered> gather(const std::string& mesh, std::uint64_t photons,
                               std::uint64_t receivers) {
    PhotonTracingOptions tracing;
    tracing.photons = photons;
    EXPECT_TRUE(tracePhotons({mesh}, path("photons.ply"), tracing, progress_).ok());
    RadianceOptions radiance;
    radiance.memory_bytes = 256 << 20;
    const Result<RadianceStats> estimated =
        radianceCloud({path("photons.ply")}, path("radiosity.ply"), radiance, progress_);
    EXPECT_TRUE(estimated.ok()) << estimated.status().message();
    if (!estimated.ok()) return {};
    stats_ = *estimated;
    EXPECT_TRUE(indexClouds({path("radiosity.ply")}, path("scene.sft"), {}, progress_).ok());
    SampleOptions sampling;
    sampling.count = receivers;
    EXPECT_TRUE(sampleMeshes({mesh}, path("receivers.ply"), sampling, progress_).ok());
    GatherOptions options;
    options.mode = GatherMode::kBleeding;
    options.quality.sides = GatherSides::kBoth;  // backs stop photons and traced paths
    EXPECT_TRUE(
        gatherCloud(path("scene.sft"), path("receivers.ply"), path("baked.ply"), options, progress_)
            .ok());
    return readBaked();
  }

  std::vector<Gathered> readBaked() const {
    const BakedRows rows = readBakedRows(path("baked.ply"));
    const auto triple = [&](std::size_t row, const char* x, const char* y, const char* z) {
      return glm::vec3(rows.value(row, x), rows.value(row, y), rows.value(row, z));
    };
    std::vector<Gathered> baked(rows.element.count);
    for (std::size_t i = 0; i < baked.size(); ++i) {
      baked[i] = {triple(i, "x", "y", "z"), triple(i, "nx", "ny", "nz"),
                  triple(i, "irradiance_r", "irradiance_g", "irradiance_b")};
    }
    return baked;
  }

  Progress progress_;
  RadianceStats stats_;
};

// Where exitance e and albedo rho are the same everywhere on a closed surface, so is all else: the
// radiosity without the emission is rho e / (1 - rho), and that is what arrives of it.
TEST_F(PhotonMap, InAClosedBoxIrradianceIsTheGeometricSeries) {
  write("box.mtl", "newmtl m\nKd 0.5 0.75 0.25\nKe 0.318309886 0.318309886 0.318309886\n");
  std::string obj = "mtllib box.mtl\nusemtl m\n";
  for (int i = 0; i < 8; ++i) obj += fmt::format("v {} {} {}\n", i & 1, (i >> 1) & 1, i >> 2);
  write("box.obj", obj + "f 2 4 3 1\nf 7 8 6 5\nf 5 6 2 1\nf 4 8 7 3\nf 3 7 5 1\nf 6 8 4 2\n");
  const std::vector<Gathered> baked = gather(path("box.obj"), 100000, 500);
  EXPECT_NEAR(stats_.area, 6, 0.02 * 6);
  const glm::dvec3 expected = {0.5 / 0.5, 0.75 / 0.25, 0.25 / 0.75};
  glm::dvec3 mean(0), rms(0);
  for (const Gathered& receiver : baked) {
    const glm::dvec3 error = glm::dvec3(receiver.irradiance) / expected - 1.0;
    mean += error / double(baked.size());
    rms += error * error / double(baked.size());
  }
  rms = glm::sqrt(rms);
  fmt::print(
      "closed box: {} photons, area {:.4f} of 6, irradiance bias {:+.4f} {:+.4f} {:+.4f}, "
      "RMS {:.4f} {:.4f} {:.4f}\n",
      stats_.photons, stats_.area, mean.r, mean.g, mean.b, rms.r, rms.g, rms.b);
  for (int i = 0; i < 3; ++i) {
    EXPECT_LE(std::abs(mean[i]), 0.02);
    EXPECT_LE(rms[i], 0.025);
  }
}

// Indirect irradiance by tracing paths: at each hit the direct light, and one more ray.
class IndirectPaths {
 public:
  explicit IndirectPaths(const ReferenceScene& scene) : scene_(scene) {}

  glm::dvec3 indirect(const glm::vec3& position, const glm::vec3& normal, int paths) {
    glm::dvec3 sum(0);
    for (int i = 0; i < paths; ++i) sum += trace(position, normal);
    return sum / double(paths);
  }

 private:
  glm::dvec3 trace(glm::vec3 position, glm::vec3 normal) {
    glm::dvec3 sum(0), weight(1);
    for (;;) {
      const float r = std::sqrt(unit_(random_)), phi = 2 * kPi * unit_(random_);
      const TangentFrame frame(normal);
      const glm::vec3 direction = r * std::cos(phi) * frame.tangent +
                                  r * std::sin(phi) * frame.bitangent +
                                  std::sqrt(std::max(0.0f, 1 - r * r)) * normal;
      const auto hit = scene_.rays().closestHit(position + scene_.rays().surfaceOffset() * normal,
                                                direction, 0, 1e30f);
      if (!hit) return sum;
      const SurfacePoint point = surfacePoint(scene_.mesh(), hit->triangle, hit->u, hit->v);
      if (glm::dot(point.geometric_normal, direction) >= 0) return sum;
      weight *= glm::dvec3(point.albedo);
      sum += weight * glm::dvec3(scene_.light().irradiance(point, random_(), 1));
      constexpr double kSurvival = 0.6;
      if (double(unit_(random_)) >= kSurvival) return sum;
      weight /= kSurvival;
      position = point.position;
      normal = point.normal;
    }
  }

  const ReferenceScene& scene_;
  std::mt19937_64 random_{1};
  std::uniform_real_distribution<float> unit_{0, 1};
};

TEST_F(PhotonMap, OfTheCornellBoxMatchesTracedPaths) {
  ASSERT_EQ(std::system(fmt::format("'{}' '{}' >/dev/null", CORNELL_SCENE, path("")).c_str()), 0);
  const std::vector<Gathered> baked = gather(path("cornell.obj"), 200000, 200);
  const Result<ReferenceScene> scene =
      ReferenceScene::load({path("cornell.obj")}, {}, 2, progress_);
  ASSERT_TRUE(scene.ok()) << scene.status().message();
  IndirectPaths tracer(*scene);
  glm::dvec3 mean(0), error_sum(0), square_sum(0);
  for (const Gathered& receiver : baked) {
    const glm::dvec3 truth = tracer.indirect(receiver.position, receiver.normal, 2000);
    const glm::dvec3 error = glm::dvec3(receiver.irradiance) - truth;
    mean += truth / double(baked.size());
    error_sum += error / double(baked.size());
    square_sum += error * error / double(baked.size());
  }
  const glm::dvec3 bias = error_sum / mean, rms = glm::sqrt(square_sum) / mean;
  fmt::print(
      "cornell: {} photons, irradiance bias {:+.4f} {:+.4f} {:+.4f}, RMS {:.4f} {:.4f} {:.4f}\n",
      stats_.photons, bias.r, bias.g, bias.b, rms.r, rms.g, rms.b);
  for (int i = 0; i < 3; ++i) {
    EXPECT_LE(std::abs(bias[i]), 0.05);
    EXPECT_LE(rms[i], 0.09);
  }
}

}  // namespace
}  // namespace surfeit
