// The chain from a mesh to irradiance, compared with rays traced on the true triangles.
#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "fidelity/baked_rows.h"
#include "io/test_directory.h"
#include "sample/reference.h"
#include "surfeit/bake.h"
#include "surfeit/index.h"
#include "surfeit/sample.h"

namespace surfeit {

struct FidelityLimits {
  double occlusion_rmse, occlusion_bias, irradiance_rmse, irradiance_bias = 1;
};

// A receiver with what the gather found.
struct Baked {
  glm::vec3 position, normal, irradiance;
  float occlusion;
};

class Fidelity : public DirectoryTest {
 protected:
  void sample(const std::string& mesh, const Surroundings& surroundings, std::uint64_t receivers,
              std::uint64_t surfels = 1'000'000) {
    SampleOptions options;
    options.surroundings = surroundings;
    options.count = receivers;
    ASSERT_TRUE(sampleMeshes({mesh}, path("receivers.ply"), options, progress_).ok());
    options.count = surfels;
    ASSERT_TRUE(sampleMeshes({mesh}, path("cloud.ply"), options, progress_).ok());
    ASSERT_TRUE(indexClouds({path("cloud.ply")}, path("scene.sft"), {}, progress_).ok());
    Result<ReferenceScene> reference = ReferenceScene::load({mesh}, surroundings, 2, progress_);
    ASSERT_TRUE(reference.ok()) << reference.status().message();
    reference_.emplace(std::move(*reference));
  }

  // What was sampled, with so many rays of a receiver.
  void measure(const std::string& name, QualityPreset preset, int rays,
               const FidelityLimits& limits) {
    GatherOptions gather;
    gather.mode = GatherMode::kBleeding;
    setQuality(preset, gather.quality);
    const Result<GatherStats> stats =
        gatherCloud(path("scene.sft"), path("receivers.ply"), path("baked.ply"), gather, progress_);
    ASSERT_TRUE(stats.ok()) << stats.status().message();
    compare(name, rays, limits);
  }

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

 private:
  void compare(const std::string& name, int rays, const FidelityLimits& limits) {
    const std::vector<Baked> baked = readBaked();
    ASSERT_FALSE(baked.empty());
    ReferenceQuality quality;
    quality.rays = rays;
    double square = 0, sum = 0, color_square = 0, color_sum = 0, mean = 0, mean_color = 0;
    std::vector<double> errors;
    for (std::size_t i = 0; i < baked.size(); ++i) {
      const ReferenceGather truth =
          reference_->gather(baked[i].position, baked[i].normal, i, quality);
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
    EXPECT_LE(std::abs(color_sum / n / mean_color), limits.irradiance_bias);
  }

  static double average(const glm::vec3& rgb) { return double(rgb.x + rgb.y + rgb.z) / 3; }

  std::optional<ReferenceScene> reference_;
};

}  // namespace surfeit
