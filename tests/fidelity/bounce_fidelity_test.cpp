// Several bounces against paths traced on the true triangles.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <glm/geometric.hpp>
#include <random>
#include <string>
#include <vector>

#include "cloud/ply/ply_reader.h"
#include "io/test_directory.h"
#include "sample/reference.h"
#include "surfeit/bake.h"
#include "surfeit/bounce.h"
#include "surfeit/index.h"
#include "surfeit/sample.h"

namespace surfeit {
namespace {

// Irradiance from light that has left an emitter and been reflected 1 to `reflections` times, by
// random walks: at every hit the direct light there, by what is left of the walk. Rays pass through
// backs, as in ReferenceGather.
class PathTracer {
 public:
  PathTracer(const ReferenceScene& scene, int reflections)
      : scene_(scene), reflections_(reflections) {}

  glm::dvec3 irradiance(glm::vec3 position, glm::vec3 normal, int paths, unsigned seed) {
    random_.seed(seed);
    glm::dvec3 sum(0);
    for (int i = 0; i < paths; ++i) sum += walk(position, normal);
    return sum / double(paths);
  }

 private:
  // Weights of cosine-weighted directions are 1, and albedo at every reflection.
  glm::dvec3 walk(glm::vec3 position, glm::vec3 normal) {
    glm::dvec3 sum(0), weight(1);
    for (int reflection = 0; reflection < reflections_; ++reflection) {
      const glm::vec3 direction = cosineDirection(normal);
      const std::optional<SurfacePoint> hit = firstFront(position, normal, direction);
      if (!hit) break;
      sum += weight * glm::dvec3(scene_.light().exitance(*hit, random_(), 1));
      weight *= glm::dvec3(hit->albedo);
      position = hit->position;
      normal = hit->geometric_normal;
    }
    return sum;
  }

  std::optional<SurfacePoint> firstFront(const glm::vec3& position, const glm::vec3& normal,
                                         const glm::vec3& direction) {
    const RayScene& rays = scene_.rays();
    const glm::vec3 start = position + normal * (1e-4f * glm::length(rays.bounds().extent()));
    float begin = 0;
    for (int layer = 0; layer < 16; ++layer) {
      const auto hit = rays.closestHit(start, direction, begin, 1e30f);
      if (!hit) break;
      const SurfacePoint point = surfacePoint(scene_.mesh(), hit->triangle, hit->u, hit->v);
      if (glm::dot(point.geometric_normal, direction) < 0) return point;
      begin = std::nextafter(hit->distance + 0.1f * rays.surfaceOffset(), 1e30f);
    }
    return std::nullopt;
  }

  // A point on the sphere around the tip of the normal.
  glm::vec3 cosineDirection(const glm::vec3& normal) {
    std::normal_distribution<float> gauss;
    const glm::vec3 on_sphere =
        glm::normalize(glm::vec3(gauss(random_), gauss(random_), gauss(random_)));
    return glm::normalize(normal * 1.0001f + on_sphere);
  }

  const ReferenceScene& scene_;
  const int reflections_;
  std::mt19937 random_;
};

class BounceFidelity : public DirectoryTest {
 protected:
  struct Baked {
    glm::vec3 position, normal;
    glm::dvec3 irradiance;
  };

  // The receivers with what a gather from `scene` finds at them.
  std::vector<Baked> gather(const std::string& scene) {
    GatherOptions options;
    options.mode = GatherMode::kBleeding;
    const auto stats =
        gatherCloud(scene, path("receivers.ply"), path("baked.ply"), options, progress_);
    EXPECT_TRUE(stats.ok()) << stats.status().message();
    Result<PlyReader> reader = PlyReader::open(path("baked.ply"));
    EXPECT_TRUE(reader.ok());
    const RowLayout& element = reader->header().elements[0];
    std::vector<std::byte> row(element.row_bytes);
    EXPECT_TRUE(reader->seekElement(0).ok());
    std::vector<Baked> baked;
    for (std::uint64_t i = 0; i < element.count; ++i) {
      const Result<std::size_t> got = reader->readRows(row);
      if (!got.ok() || *got != 1) break;
      const auto triple = [&](const char* x, const char* y, const char* z) {
        glm::dvec3 value;
        int axis = 0;
        for (const char* name : {x, y, z}) {
          const RowProperty* property = element.find(name);
          value[axis++] = rowValue(&row[property->offset], property->type);
        }
        return value;
      };
      baked.push_back({triple("x", "y", "z"), triple("nx", "ny", "nz"),
                       triple("irradiance_r", "irradiance_g", "irradiance_b")});
    }
    return baked;
  }

  Progress progress_;
};

// The gather adds a reflection at the surfels that it sees: light of 1 to bounces + 1.
TEST_F(BounceFidelity, CornellBoxWithSpheres) {
  ASSERT_EQ(std::system(fmt::format("'{}' '{}' >/dev/null", CORNELL_SCENE, path("")).c_str()), 0);
  SampleOptions sample;
  sample.count = 100'000;
  ASSERT_TRUE(sampleMeshes({path("cornell.obj")}, path("cloud.ply"), sample, progress_).ok());
  sample.count = 400;
  ASSERT_TRUE(sampleMeshes({path("cornell.obj")}, path("receivers.ply"), sample, progress_).ok());
  ASSERT_TRUE(indexClouds({path("cloud.ply")}, path("direct.sft"), {}, progress_).ok());
  const Result<ReferenceScene> reference =
      ReferenceScene::load({path("cornell.obj")}, {}, 2, progress_);
  ASSERT_TRUE(reference.ok()) << reference.status().message();

  constexpr double kRmseLimits[] = {.06, .055}, kBiasLimits[] = {.019, .018};
  for (const int bounces : {1, 3}) {
    BounceOptions options;
    options.bounces = bounces;
    options.surfels_per_receiver = 4;
    options.threads = 2;
    const auto stats = bounceScene(path("direct.sft"), path("bounced.sft"), options, progress_);
    ASSERT_TRUE(stats.ok()) << stats.status().message();
    PathTracer tracer(*reference, bounces + 1);
    double square = 0, sum = 0, mean = 0;
    unsigned seed = 0;
    const std::vector<Baked> baked = gather(path("bounced.sft"));
    ASSERT_GE(baked.size(), 400u);
    for (const Baked& found : baked) {
      const glm::dvec3 truth = tracer.irradiance(found.position, found.normal, 1024, ++seed);
      const glm::dvec3 error = found.irradiance - truth;
      mean += (truth.r + truth.g + truth.b) / 3;
      sum += (error.r + error.g + error.b) / 3;
      square += std::pow((error.r + error.g + error.b) / 3, 2);
    }
    const double n = double(baked.size());
    mean /= n;
    const double rmse = std::sqrt(square / n) / mean, bias = sum / n / mean;
    fmt::print("cornell, {} bounces: irradiance mean {:.4f}, relative RMSE {:.4f}, bias {:+.4f}\n",
               bounces, mean, rmse, bias);
    const std::size_t row = bounces == 1 ? 0 : 1;
    EXPECT_LT(rmse, kRmseLimits[row]) << bounces;
    EXPECT_LT(std::abs(bias), kBiasLimits[row]) << bounces;
  }
}

}  // namespace
}  // namespace surfeit
