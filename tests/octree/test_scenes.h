// Small clouds, scenes indexed from them, and scenes read back whole.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <memory>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "io/test_directory.h"
#include "octree/build/scene_writer.h"
#include "octree/node/node_sums.h"
#include "octree/read/paged_octree.h"
#include "surfeit/index.h"
#include "surfeit/scene.h"
#include "surfels/rows/surfel_source.h"
#include "surfels/rows/surfel_writer.h"

namespace surfeit {

// Under the thread sanitizer neighbour searches take thirty times as long: what takes seconds
// otherwise does less of the same then.
constexpr bool isThreadSanitized() {
#ifdef __SANITIZE_THREAD__
  return true;
#else
  return false;
#endif
}

inline constexpr CloudChannels kAllChannels = {true, true, true, true, true, true};
inline constexpr CloudChannels kAllAndGroups = {true, true, true, true, true, true, true};
inline constexpr CloudChannels kAllAndLongSides = {.normal = true,
                                                   .radius = true,
                                                   .area = true,
                                                   .radiosity = true,
                                                   .albedo = true,
                                                   .two_sided = true,
                                                   .long_side = true};
inline constexpr CloudChannels kPositionsOnly = {};

// A generator whose numbers are the same everywhere, unlike those of the standard distributions.
class TestRandom {
 public:
  explicit TestRandom(std::uint32_t seed) : engine_(seed) {}
  // In [0, 1).
  float unit() { return float(engine_() >> 8) * 0x1p-24f; }
  float between(float low, float high) { return low + (high - low) * unit(); }
  glm::vec3 point() { return {unit(), unit(), unit()}; }
  glm::vec3 direction() {
    for (;;) {
      const glm::vec3 d = point() * 2.f - 1.f;
      const float length = glm::length(d);
      if (length > 0.1f && length <= 1) return d / length;
    }
  }
  std::uint32_t bits() { return static_cast<std::uint32_t>(engine_()); }

 private:
  std::mt19937 engine_;
};

inline Surfel surfelAt(const glm::vec3& position, const glm::vec3& normal, float radius,
                       TestRandom& random) {
  Surfel surfel;
  surfel.position = position;
  surfel.normal = normal;
  surfel.radius = radius;
  surfel.area = radius * radius * 2;
  surfel.radiosity = random.point();
  surfel.albedo = random.point();
  return surfel;
}

// What stands for all of them; its radius is of no account.
inline Node nodeOf(std::span<const Surfel> cloud) {
  NodeSums sums;
  for (const Surfel& surfel : cloud) sums.add(surfel);
  return sums.toNode(kDefaultFlatnessLimit, 100);
}

// `count` surfels anywhere in the unit cube, of every kind.
inline std::vector<Surfel> randomCloud(std::size_t count, std::uint32_t seed = 1) {
  TestRandom random(seed);
  std::vector<Surfel> cloud;
  for (std::size_t i = 0; i < count; ++i) {
    const glm::vec3 position = random.point();
    const glm::vec3 normal = random.direction();
    Surfel surfel = surfelAt(position, normal, random.between(0.001f, 0.05f), random);
    if (i % 5 == 1) surfel.flags = kSurfelTwoSided;
    if (i % 7 == 2) {
      surfel.flags = kSurfelSphere;
      surfel.normal = glm::vec3(0);
    }
    cloud.push_back(surfel);
  }
  return cloud;
}

// Gives surfels longer sides, but every fourth.
inline std::vector<Surfel> withLongSides(std::vector<Surfel> cloud) {
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (i % 4 == 3) continue;
    cloud[i].long_side = static_cast<std::uint16_t>((1 + i % 255) | (1 + i * 7 % 255) << 8);
    cloud[i].elongation = static_cast<std::uint8_t>(i * 5);
  }
  return cloud;
}

// Gives every surfel a group by its place, so that neighbours often share one; `count` in all.
inline std::vector<Surfel> inGroups(std::vector<Surfel> cloud, std::uint32_t count) {
  for (Surfel& surfel : cloud) {
    surfel.group = static_cast<std::uint8_t>(
        std::min(static_cast<std::uint32_t>(surfel.position.x * float(count)), count - 1));
  }
  return cloud;
}

inline std::vector<Surfel> sphereCloud(std::size_t count) {
  TestRandom random(2);
  std::vector<Surfel> cloud;
  for (std::size_t i = 0; i < count; ++i) {
    const glm::vec3 d = random.direction();
    cloud.push_back(surfelAt(d, d, 0.02f, random));
  }
  return cloud;
}

// side * side surfels one `spacing` apart in the plane z = 0.
inline std::vector<Surfel> planeCloud(int side, float spacing) {
  TestRandom random(3);
  std::vector<Surfel> cloud;
  for (int y = 0; y < side; ++y) {
    for (int x = 0; x < side; ++x) {
      cloud.push_back(
          surfelAt(glm::vec3(float(x), float(y), 0) * spacing, {0, 0, 1}, 0.7f * spacing, random));
    }
  }
  return cloud;
}

// The first `faces` of six squares of side * side surfels that make a box.
inline std::vector<Surfel> boxCloud(int side, float spacing, int faces = 6) {
  std::vector<Surfel> cloud;
  const float height = spacing * float(side - 1);
  for (int face = 0; face < faces; ++face) {
    for (Surfel surfel : planeCloud(side, spacing)) {
      const glm::vec3 at = surfel.position;
      const int axis = face % 3;
      surfel.normal = glm::vec3(0);
      surfel.normal[axis] = face < 3 ? 1.f : -1.f;
      surfel.position[axis] = face < 3 ? height + spacing / 2 : -spacing / 2;
      surfel.position[(axis + 1) % 3] = at.x;
      surfel.position[(axis + 2) % 3] = at.y;
      surfel.radiosity = glm::vec3(float(1 + face), 0, 0);
      cloud.push_back(surfel);
    }
  }
  return cloud;
}

inline std::vector<Surfel> moved(std::vector<Surfel> cloud, float scale, const glm::vec3& offset) {
  for (Surfel& surfel : cloud) {
    surfel.position = surfel.position * scale + offset;
    surfel.radius *= scale;
    surfel.area *= scale * scale;
  }
  return cloud;
}

inline void writeCloud(const std::string& path, std::span<const Surfel> cloud,
                       const CloudChannels& channels = kAllChannels) {
  Result<SurfelWriter> writer = SurfelWriter::create(path, channels);
  ASSERT_TRUE(writer.ok()) << writer.status().message();
  ASSERT_TRUE(writer->write(cloud).ok());
  ASSERT_TRUE(writer->finish().ok());
}

// Keeps the notes of a run.
class NoteKeeper : public Progress {
 public:
  void note(const std::string& message) override { notes.push_back(message); }
  std::vector<std::string> notes;
};

// What verifyScene finds; its own failure counts as a finding.
inline std::vector<std::string> findingsOf(const std::string& path, int threads = 1) {
  Progress progress;
  const Result<VerifyReport> report = verifyScene(path, threads, progress);
  if (!report.ok()) return {report.status().message()};
  EXPECT_EQ(report->findings.size(), std::min<std::uint64_t>(report->finding_count, 100));
  return report->findings;
}

// A scene read back: surfels in curve order, nodes in depth-first order.
struct ReadScene {
  struct ReadNode {
    Node node;
    std::size_t first_surfel = 0;  // in `surfels`; node.surfel_count follow
  };
  SceneHeader header;
  std::vector<Surfel> surfels;
  std::vector<ReadNode> nodes;
};

inline Status readSubtree(PagedOctree::Reader& reader, const NodeRange& range, ReadScene& scene) {
  SURFEIT_ASSIGN_OR_RETURN(const std::span<const Node> siblings, reader.nodes(range));
  for (const Node& node : std::vector<Node>(siblings.begin(), siblings.end())) {
    scene.nodes.push_back({node, scene.surfels.size()});
    if (node.isLeaf()) {
      SURFEIT_RETURN_IF_ERROR(reader.visitLeaf(node, [&](std::span<const Surfel> surfels) {
        scene.surfels.insert(scene.surfels.end(), surfels.begin(), surfels.end());
      }));
    } else {
      SURFEIT_RETURN_IF_ERROR(readSubtree(reader, childrenOf(node), scene));
    }
  }
  return {};
}

// Through caches that hold everything.
inline Result<ReadScene> readScene(const std::string& path) {
  SURFEIT_ASSIGN_OR_RETURN(SceneFile file, SceneFile::open(path));
  ReadScene scene;
  scene.header = file.header();
  SURFEIT_ASSIGN_OR_RETURN(
      const PagedOctree::Memory memory,
      PagedOctree::planMemory(file, PagedOctree::unlimitedCacheBytes(file), 1));
  SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<PagedOctree> octree,
                           PagedOctree::create(std::move(file), memory));
  PagedOctree::Reader reader(*octree);
  SURFEIT_RETURN_IF_ERROR(readSubtree(reader, kRootRange, scene));
  return scene;
}

// A directory with clouds and the scenes made from them.
class SceneTest : public DirectoryTest {
 protected:
  // Indexes with success and returns the path of the scene.
  std::string index(std::span<const Surfel> cloud, const CloudChannels& channels = kAllChannels,
                    const IndexOptions& options = {}) {
    const std::string name = "scene" + std::to_string(++scenes_);
    writeCloud(path(name + ".ply"), cloud, channels);
    indexFiles({path(name + ".ply")}, path(name + ".sft"), options);
    return path(name + ".sft");
  }

  IndexStats indexFiles(const std::vector<std::string>& inputs, const std::string& output,
                        const IndexOptions& options = {}) {
    const Result<IndexStats> stats = indexClouds(inputs, output, options, progress_);
    EXPECT_TRUE(stats.ok()) << stats.status().message();
    return stats.ok() ? *stats : IndexStats{};
  }

  static std::string bytesOf(const std::string& file_path) {
    std::ifstream file(file_path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }

  static void writeBytes(const std::string& file_path, const std::string& bytes) {
    std::ofstream(file_path, std::ios::binary) << bytes;
  }

  NoteKeeper progress_;
  int scenes_ = 0;
};

}  // namespace surfeit
