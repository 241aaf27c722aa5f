// What presets of quality set, and what the knob of the shared far field changes.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <string>
#include <vector>

#include "gather/gather_options.h"
#include "gather/test_clouds.h"
#include "surfeit/gather.h"

namespace surfeit {
namespace {

constexpr QualityPreset kPresets[] = {QualityPreset::kDraft, QualityPreset::kStandard,
                                      QualityPreset::kFinal};

GatherQuality presetQuality(QualityPreset preset, GatherQuality quality = {}) {
  setQuality(preset, quality);
  return quality;
}

// Whether all that presets set is the same.
void expectSamePreset(const GatherQuality& a, const GatherQuality& b) {
  EXPECT_EQ(a.max_solid_angle, b.max_solid_angle);
  EXPECT_EQ(a.raster_resolution, b.raster_resolution);
  EXPECT_EQ(a.near_field_radii, b.near_field_radii);
  EXPECT_EQ(a.far_field_parallax, b.far_field_parallax);
}

TEST(SetQuality, StandardIsTheDefault) {
  expectSamePreset(presetQuality(QualityPreset::kStandard), GatherQuality());
}

TEST(SetQuality, EveryPresetErrsLessThanTheOneBefore) {
  for (std::size_t i = 1; i < std::size(kPresets); ++i) {
    const GatherQuality coarse = presetQuality(kPresets[i - 1]), fine = presetQuality(kPresets[i]);
    EXPECT_LT(fine.max_solid_angle, coarse.max_solid_angle);
    EXPECT_GE(fine.raster_resolution, coarse.raster_resolution);
    EXPECT_GT(fine.near_field_radii, coarse.near_field_radii);
    EXPECT_LT(fine.far_field_parallax, coarse.far_field_parallax);
  }
}

TEST(SetQuality, PresetsReplaceEachOtherAndAreValid) {
  for (const QualityPreset before : kPresets) {
    for (const QualityPreset preset : kPresets) {
      GatherOptions options;
      options.quality = presetQuality(preset, presetQuality(before));
      expectSamePreset(options.quality, presetQuality(preset));
      const Status status = checkGatherOptions(options);
      EXPECT_TRUE(status.ok()) << status.message();
    }
  }
}

TEST(SetQuality, WhatIsNoMatterOfErrorsIsKept) {
  for (const QualityPreset preset : kPresets) {
    GatherQuality quality;
    quality.max_distance = 3;
    quality.sides = GatherSides::kBoth;
    quality.bias = 0.4f;
    setQuality(preset, quality);
    EXPECT_EQ(quality.max_distance, 3);
    EXPECT_EQ(quality.sides, GatherSides::kBoth);
    EXPECT_EQ(quality.bias, 0.4f);
  }
}

// Clusters on a small patch of the floor: all but the floor around is shared.
Table denseReceivers() {
  Table table;
  for (const char* name : {"x", "y", "z", "nx", "ny", "nz"}) table.addProperty(name);
  for (int i = 0; i < 1024; ++i) {
    table.rows.push_back({0.6 + 0.002 * (i % 32), 0.3 + 0.002 * (i / 32), 0, 0, 0, 1});
  }
  return table;
}

// Measured: 0.0023 RMS of an occlusion of 0.33, 0.0085 at most; less for irradiance.
TEST(FarFieldParallax, ChangesLittleButSomething) {
  const TestDirectory directory;
  const std::string scene = directory.file("scene.sft"), receivers = directory.file("r.ply");
  makeScene(floorAndSphere(60), scene);
  writeTable(denseReceivers(), receivers);
  const auto gather = [&](float parallax) {
    GatherOptions options;
    options.mode = GatherMode::kBleeding;
    options.threads = 1;
    options.memory_bytes = std::uint64_t{256} << 20;
    options.quality.far_field_parallax = parallax;
    Progress progress;
    const std::string result = directory.file("result.ply");
    const auto stats = gatherCloud(scene, receivers, result, options, progress);
    EXPECT_TRUE(stats.ok()) << stats.status().message();
    return readTable(result);
  };
  const Table alone = gather(0), shared = gather(GatherQuality().far_field_parallax);
  for (const char* name : {"occlusion", "irradiance_r", "irradiance_g", "irradiance_b"}) {
    const std::vector<double> a = alone.column(name), b = shared.column(name);
    ASSERT_EQ(a.size(), 1024u);
    ASSERT_EQ(b.size(), a.size());
    double mean = 0, square = 0, largest = 0;
    for (std::size_t i = 0; i < a.size(); ++i) {
      mean += a[i] / double(a.size());
      square += (a[i] - b[i]) * (a[i] - b[i]) / double(a.size());
      largest = std::max(largest, std::abs(a[i] - b[i]));
    }
    EXPECT_GT(mean, 0.01) << name;
    EXPECT_GT(square, 0) << name;
    EXPECT_LT(std::sqrt(square), 0.004) << name;
    EXPECT_LT(largest, 0.015) << name;
  }
}

}  // namespace
}  // namespace surfeit
