// The gate on every change: occlusion and irradiance at 2,000 receivers a scene,
// against 1,024 rays each on the true triangles. The errors are printed; the limits stand a third
// above what was measured when they were set, and may only go down.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "fidelity/baked_rows.h"
#include "io/test_directory.h"
#include "sample/reference.h"
#include "sample/sample.h"
#include "surfeit/gather.h"
#include "surfeit/index.h"

namespace surfeit {
namespace {

constexpr std::uint64_t kReceivers = 2000;

struct Limits {
  double occlusion_rmse, occlusion_bias, irradiance_rmse;
};

// A receiver with what the gather found.
struct Baked {
  glm::vec3 position, normal, irradiance;
  float occlusion;
};

class Fidelity : public DirectoryTest {
 protected:
  void measure(const std::string& name, const std::string& mesh, const Surroundings& surroundings,
               const Limits& limits) {
    SampleOptions options;
    options.surroundings = surroundings;
    options.count = 1'000'000;
    ASSERT_TRUE(sampleMeshes({mesh}, path("cloud.ply"), options, progress_).ok());
    options.count = kReceivers;
    ASSERT_TRUE(sampleMeshes({mesh}, path("receivers.ply"), options, progress_).ok());
    ASSERT_TRUE(indexClouds({path("cloud.ply")}, path("scene.sft"), {}, progress_).ok());
    GatherOptions gather;
    gather.mode = GatherMode::kBleeding;
    const Result<GatherStats> stats =
        gatherCloud(path("scene.sft"), path("receivers.ply"), path("baked.ply"), gather, progress_);
    ASSERT_TRUE(stats.ok()) << stats.status().message();
    const Result<ReferenceScene> reference =
        ReferenceScene::load({mesh}, surroundings, 2, progress_);
    ASSERT_TRUE(reference.ok()) << reference.status().message();
    compare(name, *reference, limits);
  }

  void compare(const std::string& name, const ReferenceScene& reference, const Limits& limits) {
    const std::vector<Baked> baked = readBaked();
    ASSERT_GE(baked.size(), kReceivers);
    double square = 0, sum = 0, color_square = 0, color_sum = 0, mean = 0, mean_color = 0;
    std::vector<double> errors;
    for (std::size_t i = 0; i < baked.size(); ++i) {
      const ReferenceGather truth =
          reference.gather(baked[i].position, baked[i].normal, i, ReferenceQuality());
      const double error = double(baked[i].occlusion) - double(truth.occlusion_front);
      const double color = average(baked[i].irradiance),
                   true_color = average(truth.irradiance_front);
      mean += double(truth.occlusion_front);
      mean_color += true_color;
      square += error * error;
      sum += error;
      color_square += (color - true_color) * (color - true_color);
      color_sum += color - true_color;
      errors.push_back(std::abs(error));
    }
    const double n = double(baked.size());
    std::sort(errors.begin(), errors.end());
    mean_color /= n;
    const double rmse = std::sqrt(square / n), bias = sum / n;
    const double color_rmse = std::sqrt(color_square / n) / mean_color;
    fmt::print(
        "{}: {} receivers, occlusion mean {:.4f} RMSE {:.4f} bias {:+.4f} p95 {:.4f} max "
        "{:.4f}; irradiance relative RMSE {:.4f} bias {:+.4f}\n",
        name, baked.size(), mean / n, rmse, bias, errors[errors.size() * 95 / 100], errors.back(),
        color_rmse, color_sum / n / mean_color);
    EXPECT_LE(rmse, limits.occlusion_rmse);
    EXPECT_LE(std::abs(bias), limits.occlusion_bias);
    EXPECT_LE(color_rmse, limits.irradiance_rmse);
  }

  static double average(const glm::vec3& rgb) { return double(rgb.x + rgb.y + rgb.z) / 3; }

  std::vector<Baked> readBaked() {
    const BakedRows rows = readBakedRows(path("baked.ply"));
    const auto value = [&](std::size_t row, const char* name) { return rows.value(row, name); };
    std::vector<Baked> baked(rows.element.count);
    for (std::size_t i = 0; i < baked.size(); ++i) {
      baked[i] = {{value(i, "x"), value(i, "y"), value(i, "z")},
                  {value(i, "nx"), value(i, "ny"), value(i, "nz")},
                  {value(i, "irradiance_r"), value(i, "irradiance_g"), value(i, "irradiance_b")},
                  value(i, "occlusion")};
    }
    return baked;
  }

  Progress progress_;
};

TEST_F(Fidelity, CornellBoxWithSpheres) {
  ASSERT_EQ(std::system(fmt::format("'{}' '{}' >/dev/null", CORNELL_SCENE, path("")).c_str()), 0);
  measure("cornell", path("cornell.obj"), {}, {0.0063, 0.0048, 0.045});
}

TEST_F(Fidelity, BunnyOnAPlane) {
  const std::string mesh = std::string(SURFEIT_SHARED_DATA_DIR) + "/meshes/bunny.ply";
  if (!std::filesystem::exists(mesh)) GTEST_SKIP() << mesh << " is not here";
  Surroundings surroundings;
  surroundings.ground.enabled = true;
  surroundings.lights.directionals.push_back({{-1, -2, -0.5f}, {3, 3, 3}});
  measure("bunny", mesh, surroundings, {0.0051, 0.002, 0.058});
}

}  // namespace
}  // namespace surfeit
