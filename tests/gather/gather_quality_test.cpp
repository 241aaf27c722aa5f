// What presets of quality set, and what the knob of the shared far field changes.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <string>
#include <vector>

#include "batch/gather_options.h"
#include "gather/test_clouds.h"
#include "surfeit/bake.h"

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

}  // namespace
}  // namespace surfeit
