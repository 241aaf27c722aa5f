// Small meshes and clouds on disk for the tests of this folder.
#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <glm/vec3.hpp>
#include <iterator>
#include <string>
#include <vector>

#include "surfeit/progress.h"
#include "surfels/open_surfel_source.h"

namespace surfeit {

// A directory of its own for each test, removed with everything in it.
class SceneFiles : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    directory_ = std::filesystem::temp_directory_path() /
                 (std::string("surfeit_") + info->test_suite_name() + "_" + info->name());
    std::filesystem::create_directories(directory_);
  }
  void TearDown() override { std::filesystem::remove_all(directory_); }

  std::string path(const std::string& name) const { return (directory_ / name).string(); }
  std::string write(const std::string& name, const std::string& bytes) const {
    std::ofstream(path(name), std::ios::binary) << bytes;
    return path(name);
  }
  static std::string read(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }

 private:
  std::filesystem::path directory_;
};

// Cancels when more than `most` units of work are done.
class CancelAfter : public Progress {
 public:
  explicit CancelAfter(std::uint64_t most) : most_(most) {}
  void advance(std::uint64_t count) override { done_ += count; }
  bool isCancelled() const override { return done_ > most_; }

 private:
  const std::uint64_t most_;
  std::atomic<std::uint64_t> done_ = 0;
};

// Remembers what the library told the user.
class RecordedNotes : public Progress {
 public:
  void note(const std::string& message) override { notes.push_back(message); }
  std::vector<std::string> notes;
};

// An ascii PLY mesh.
inline std::string plyText(const std::vector<glm::vec3>& vertices,
                           const std::vector<std::vector<int>>& faces) {
  std::string text = fmt::format(
      "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty "
      "float "
      "z\nelement face {}\nproperty list uchar int vertex_indices\nend_header\n",
      vertices.size(), faces.size());
  for (const glm::vec3& v : vertices) text += fmt::format("{} {} {}\n", v.x, v.y, v.z);
  for (const std::vector<int>& face : faces) {
    text += fmt::format("{} {}\n", face.size(), fmt::join(face, " "));
  }
  return text;
}

// A square at y = 0 around the origin that faces +y, `size` wide.
inline std::string floorPly(float size) {
  const float h = size / 2;
  return plyText({{-h, 0, h}, {h, 0, h}, {h, 0, -h}, {-h, 0, -h}}, {{0, 1, 2, 3}});
}

// The unit cube from 0 to 1, facing outwards or inwards.
inline std::string cubePly(bool inwards) {
  std::vector<glm::vec3> vertices;
  for (int i = 0; i < 8; ++i) vertices.emplace_back(i & 1, (i >> 1) & 1, i >> 2);
  std::vector<std::vector<int>> faces = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4},
                                         {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
  if (inwards) {
    for (auto& face : faces) face = {face[3], face[2], face[1], face[0]};
  }
  return plyText(vertices, faces);
}

inline std::vector<Surfel> readCloud(const std::string& path) {
  Result<std::unique_ptr<SurfelSource>> source = openSurfelSource(path, true);
  EXPECT_TRUE(source.ok()) << source.status().message();
  std::vector<Surfel> surfels;
  if (!source.ok()) return surfels;
  surfels.resize((*source)->recordCount());
  std::size_t count = 0;
  while (count < surfels.size()) {
    Result<std::size_t> read = (*source)->read(std::span(surfels).subspan(count));
    EXPECT_TRUE(read.ok()) << read.status().message();
    if (!read.ok() || *read == 0) break;
    count += *read;
  }
  EXPECT_EQ(count, surfels.size());
  return surfels;
}

}  // namespace surfeit
