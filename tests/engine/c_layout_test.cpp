// The layout of the structs of the C API on 64-bit systems, which compiled callers hold: members
// keep their places. A struct with `size` may get members at its end; the others never change.
#include <gtest/gtest.h>

#include <cstddef>

#include "surfeit/surfeit.h"

namespace {

#define EXPECT_PLACE(type, member, place) EXPECT_EQ(offsetof(type, member), place##u) << #type

TEST(CLayout, EngineOptions) {
  EXPECT_PLACE(surfeit_engine_options, size, 0);
  EXPECT_PLACE(surfeit_engine_options, memory_bytes, 8);
  EXPECT_PLACE(surfeit_engine_options, threads, 16);
  EXPECT_PLACE(surfeit_engine_options, direct_io, 20);
  EXPECT_PLACE(surfeit_engine_options, lobes, 24);
  EXPECT_GE(sizeof(surfeit_engine_options), 32u);
}

TEST(CLayout, CacheStatistics) {
  EXPECT_PLACE(surfeit_cache_statistics, requests, 0);
  EXPECT_PLACE(surfeit_cache_statistics, hits, 8);
  EXPECT_PLACE(surfeit_cache_statistics, misses, 16);
  EXPECT_PLACE(surfeit_cache_statistics, repeated_loads, 24);
  EXPECT_PLACE(surfeit_cache_statistics, bytes_read, 32);
  EXPECT_PLACE(surfeit_cache_statistics, budget_bytes, 40);
  EXPECT_PLACE(surfeit_cache_statistics, load_seconds, 48);
  EXPECT_PLACE(surfeit_cache_statistics, stall_seconds, 56);
  EXPECT_EQ(sizeof(surfeit_cache_statistics), 64u);
}

TEST(CLayout, Statistics) {
  EXPECT_PLACE(surfeit_statistics, size, 0);
  EXPECT_PLACE(surfeit_statistics, receivers, 8);
  EXPECT_PLACE(surfeit_statistics, memory_bytes, 16);
  EXPECT_PLACE(surfeit_statistics, held_bytes, 24);
  EXPECT_PLACE(surfeit_statistics, scenes, 32);
  EXPECT_PLACE(surfeit_statistics, gatherers, 36);
  EXPECT_PLACE(surfeit_statistics, node_cache, 40);
  EXPECT_PLACE(surfeit_statistics, surfel_cache, 104);
  EXPECT_GE(sizeof(surfeit_statistics), 168u);
}

TEST(CLayout, SceneInfo) {
  EXPECT_PLACE(surfeit_scene_info, size, 0);
  EXPECT_PLACE(surfeit_scene_info, file_bytes, 8);
  EXPECT_PLACE(surfeit_scene_info, surfels, 16);
  EXPECT_PLACE(surfeit_scene_info, nodes, 24);
  EXPECT_PLACE(surfeit_scene_info, groups, 32);
  EXPECT_PLACE(surfeit_scene_info, min, 40);
  EXPECT_PLACE(surfeit_scene_info, max, 64);
  EXPECT_PLACE(surfeit_scene_info, up_axis, 88);
  EXPECT_GE(sizeof(surfeit_scene_info), 96u);
}

TEST(CLayout, GroupGain) {
  EXPECT_PLACE(surfeit_group_gain, group, 0);
  EXPECT_PLACE(surfeit_group_gain, gain, 4);
  EXPECT_EQ(sizeof(surfeit_group_gain), 8u);
}

TEST(CLayout, Settings) {
  EXPECT_PLACE(surfeit_settings, size, 0);
  EXPECT_PLACE(surfeit_settings, mode, 8);
  EXPECT_PLACE(surfeit_settings, outputs, 12);
  EXPECT_PLACE(surfeit_settings, groups, 16);
  EXPECT_PLACE(surfeit_settings, eye, 24);
  EXPECT_PLACE(surfeit_settings, max_solid_angle, 48);
  EXPECT_PLACE(surfeit_settings, raster_resolution, 52);
  EXPECT_PLACE(surfeit_settings, bias, 56);
  EXPECT_PLACE(surfeit_settings, near_field_radii, 60);
  EXPECT_PLACE(surfeit_settings, max_distance, 64);
  EXPECT_PLACE(surfeit_settings, sides, 68);
  EXPECT_PLACE(surfeit_settings, max_variation, 72);
  EXPECT_PLACE(surfeit_settings, distribution, 76);
  EXPECT_PLACE(surfeit_settings, cone_angle, 80);
  EXPECT_PLACE(surfeit_settings, roughness, 84);
  EXPECT_PLACE(surfeit_settings, falloff, 88);
  EXPECT_PLACE(surfeit_settings, falloff_mode, 92);
  EXPECT_PLACE(surfeit_settings, gain_count, 96);
  EXPECT_PLACE(surfeit_settings, gains, 104);
  EXPECT_GE(sizeof(surfeit_settings), 112u);
}

TEST(CLayout, Instance) {
  EXPECT_PLACE(surfeit_instance, scene, 0);
  EXPECT_PLACE(surfeit_instance, m, 8);
  EXPECT_EQ(sizeof(surfeit_instance), 104u);
}

TEST(CLayout, Environment) {
  EXPECT_PLACE(surfeit_environment, size, 0);
  EXPECT_PLACE(surfeit_environment, width, 8);
  EXPECT_PLACE(surfeit_environment, height, 12);
  EXPECT_PLACE(surfeit_environment, pixels, 16);
  EXPECT_PLACE(surfeit_environment, rotation, 24);
  EXPECT_PLACE(surfeit_environment, intensity, 28);
  EXPECT_PLACE(surfeit_environment, up_axis, 32);
  EXPECT_GE(sizeof(surfeit_environment), 40u);
}

TEST(CLayout, Receiver) {
  EXPECT_PLACE(surfeit_receiver, position, 0);
  EXPECT_PLACE(surfeit_receiver, normal, 24);
  EXPECT_PLACE(surfeit_receiver, view, 36);
  EXPECT_EQ(sizeof(surfeit_receiver), 48u);
}

TEST(CLayout, Result) {
  EXPECT_PLACE(surfeit_result, occlusion, 0);
  EXPECT_PLACE(surfeit_result, irradiance, 4);
  EXPECT_PLACE(surfeit_result, bent_normal, 16);
  EXPECT_PLACE(surfeit_result, illumination_direction, 28);
  EXPECT_PLACE(surfeit_result, environment, 40);
  EXPECT_PLACE(surfeit_result, fluence, 52);
  EXPECT_PLACE(surfeit_result, radiance_sh, 64);
  EXPECT_EQ(sizeof(surfeit_result), 172u);
}

TEST(CLayout, Surfel) {
  EXPECT_PLACE(surfeit_surfel, position, 0);
  EXPECT_PLACE(surfeit_surfel, normal, 24);
  EXPECT_PLACE(surfeit_surfel, radius, 36);
  EXPECT_PLACE(surfeit_surfel, area, 40);
  EXPECT_PLACE(surfeit_surfel, radiosity, 44);
  EXPECT_PLACE(surfeit_surfel, albedo, 56);
  EXPECT_PLACE(surfeit_surfel, two_sided, 68);
  EXPECT_PLACE(surfeit_surfel, group, 72);
  EXPECT_EQ(sizeof(surfeit_surfel), 80u);
}

TEST(CLayout, IndexOptions) {
  EXPECT_PLACE(surfeit_index_options, size, 0);
  EXPECT_PLACE(surfeit_index_options, memory_bytes, 8);
  EXPECT_PLACE(surfeit_index_options, threads, 16);
  EXPECT_PLACE(surfeit_index_options, full_precision, 20);
  EXPECT_GE(sizeof(surfeit_index_options), 24u);
}

TEST(CLayout, ValuesOfEnums) {
  EXPECT_EQ(int{SURFEIT_OK}, 0);
  EXPECT_EQ(int{SURFEIT_INVALID_ARGUMENT}, 1);
  EXPECT_EQ(int{SURFEIT_CORRUPTION}, 2);
  EXPECT_EQ(int{SURFEIT_BUDGET_TOO_SMALL}, 3);
  EXPECT_EQ(int{SURFEIT_IO_ERROR}, 4);
  EXPECT_EQ(int{SURFEIT_INTERRUPTED}, 5);
  EXPECT_EQ(int{SURFEIT_FAILED}, 6);
  EXPECT_EQ(int{SURFEIT_OCCLUSION}, 0);
  EXPECT_EQ(int{SURFEIT_BLEEDING}, 1);
  EXPECT_EQ(int{SURFEIT_GLOSSY}, 2);
  EXPECT_EQ(int{SURFEIT_DRAFT}, 0);
  EXPECT_EQ(int{SURFEIT_STANDARD}, 1);
  EXPECT_EQ(int{SURFEIT_FINAL}, 2);
  EXPECT_EQ(int{SURFEIT_FRONT}, 0);
  EXPECT_EQ(int{SURFEIT_BOTH}, 1);
  EXPECT_EQ(int{SURFEIT_BACK}, 2);
  EXPECT_EQ(int{SURFEIT_COSINE}, 0);
  EXPECT_EQ(int{SURFEIT_UNIFORM}, 1);
  EXPECT_EQ(int{SURFEIT_EXPONENTIAL}, 0);
  EXPECT_EQ(int{SURFEIT_POLYNOMIAL}, 1);
  EXPECT_EQ(int{SURFEIT_OUTPUT_OCCLUSION}, 1);
  EXPECT_EQ(int{SURFEIT_OUTPUT_IRRADIANCE}, 2);
  EXPECT_EQ(int{SURFEIT_OUTPUT_BENT_NORMAL}, 4);
  EXPECT_EQ(int{SURFEIT_OUTPUT_ILLUMINATION_DIRECTION}, 8);
  EXPECT_EQ(int{SURFEIT_OUTPUT_ENVIRONMENT}, 16);
  EXPECT_EQ(int{SURFEIT_OUTPUT_FLUENCE}, 32);
  EXPECT_EQ(int{SURFEIT_OUTPUT_RADIANCE_SH}, 64);
}

}  // namespace
