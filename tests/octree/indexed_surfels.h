// Surfels into a scene, and out of it again.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "octree/read/scene_file.h"
#include "surfeit/index.h"
#include "surfeit/progress.h"
#include "surfels/rows/surfel_writer.h"

namespace surfeit {

// Indexes the surfels as a cloud with these channels; expects success.
inline void indexSurfels(const std::vector<Surfel>& surfels, const std::string& scene_path,
                         const CloudChannels& channels, bool full_precision) {
  const std::string cloud_path = scene_path + ".ply";
  Result<SurfelWriter> writer = SurfelWriter::create(cloud_path, channels);
  ASSERT_TRUE(writer.ok()) << writer.status().message();
  ASSERT_TRUE(writer->write(surfels).ok());
  ASSERT_TRUE(writer->finish().ok());
  IndexOptions options;
  options.full_precision = full_precision;
  Progress progress;
  const auto stats = indexClouds({cloud_path}, scene_path, options, progress);
  ASSERT_TRUE(stats.ok()) << stats.status().message();
  std::filesystem::remove(cloud_path);
}

// All surfels of a scene, page after page, about its origin; expects that it can be read.
inline std::vector<Surfel> surfelsOf(const std::string& scene_path) {
  Result<SceneFile> scene = SceneFile::open(scene_path);
  EXPECT_TRUE(scene.ok()) << scene.status().message();
  if (!scene.ok()) return {};
  SceneFile::Scratch scratch;
  std::vector<Surfel> all, page(scene->header().surfel_group_capacity);
  for (std::uint32_t i = 0; i < scene->surfelPageCount(); ++i) {
    const Result<std::uint32_t> count = scene->decodeSurfels(i, scratch, page);
    EXPECT_TRUE(count.ok()) << count.status().message();
    if (count.ok()) all.insert(all.end(), page.begin(), page.begin() + *count);
  }
  return all;
}

}  // namespace surfeit
