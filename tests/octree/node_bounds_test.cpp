// Bounds hold for what a reader decodes: every surfel below every node, in both precisions.
#include "octree/page/node_bounds.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "octree/test_scenes.h"

namespace surfeit {
namespace {

glm::dvec3 unit(const glm::vec3& v) { return glm::normalize(glm::dvec3(v)); }

// How far a surfel reaches from a node's position across its normal.
double heightOf(const Surfel& surfel, const Node& node) {
  const glm::dvec3 n = unit(node.normal);
  const double middle = glm::dot(glm::dvec3(surfel.position) - glm::dvec3(node.position), n);
  const double tilt = surfel.isSphere() ? 1 : glm::length(glm::cross(unit(surfel.normal), n));
  return std::abs(middle) + double(surfel.radius) * tilt;
}

std::vector<Surfel> twoSided(std::vector<Surfel> cloud) {
  for (Surfel& surfel : cloud) surfel.flags |= kSurfelTwoSided;
  return cloud;
}

// Four sheets of `side` squared surfels above each other, one turned over.
std::vector<Surfel> stackedSheets(int side) {
  std::vector<Surfel> cloud;
  for (int i = 0; i < 4; ++i) {
    for (Surfel surfel : planeCloud(side, 0.1f)) {
      surfel.position.z = 0.3f * float(i);
      if (i == 1) surfel.normal = -surfel.normal;
      cloud.push_back(surfel);
    }
  }
  return cloud;
}

// Turned so that its normal lies along no axis.
std::vector<Surfel> turned(std::vector<Surfel> cloud) {
  const glm::vec3 w = glm::normalize(glm::vec3(0.3f, -0.5f, 0.8f));
  const glm::vec3 u = glm::normalize(glm::cross(w, glm::vec3(1, 0, 0))), v = glm::cross(w, u);
  for (Surfel& surfel : cloud) {
    const glm::vec3 p = surfel.position, n = surfel.normal;
    surfel.position = p.x * u + p.y * v + p.z * w;
    surfel.normal = n.x * u + n.y * v + n.z * w;
  }
  return cloud;
}

std::vector<Surfel> mixedCloud() {
  std::vector<Surfel> cloud = randomCloud(1500);
  for (const std::vector<Surfel>& part :
       {stackedSheets(15), twoSided(turned(planeCloud(20, 0.03f))), boxCloud(12, 0.05f)}) {
    cloud.insert(cloud.end(), part.begin(), part.end());
  }
  return cloud;
}

class NodeBoundsTest : public SceneTest {
 protected:
  ReadScene scene(std::span<const Surfel> cloud, bool full_precision = false) {
    IndexOptions options;
    options.full_precision = full_precision;
    Result<ReadScene> read = readScene(index(cloud, kAllChannels, options));
    EXPECT_TRUE(read.ok()) << read.status().message();
    return read.ok() ? std::move(*read) : ReadScene();
  }
};

void expectBounds(const ReadScene& scene) {
  for (const auto& [node, first] : scene.nodes) {
    ASSERT_TRUE(node.thickness >= 0 && node.thickness <= node.radius);
    ASSERT_TRUE(node.normal_cosine >= -1 && node.normal_cosine <= 1);
    const bool has_normal = node.normal != glm::vec3(0);
    if (!has_normal) {
      ASSERT_EQ(node.thickness, node.radius);
      ASSERT_EQ(node.normal_cosine, -1);
    }
    for (std::size_t i = first; i < first + node.surfel_count; ++i) {
      const Surfel& surfel = scene.surfels[i];
      const double distance = glm::distance(glm::dvec3(surfel.position), glm::dvec3(node.position));
      ASSERT_LE(distance + double(surfel.radius), double(node.radius));
      if (!has_normal) continue;
      ASSERT_LE(heightOf(surfel, node), double(node.thickness));
      if (surfel.isSphere() || surfel.isTwoSided()) {
        ASSERT_EQ(node.normal_cosine, -1);
      } else {
        // In floats, as a gather has it
        ASSERT_GE(glm::dot(surfel.normal, node.normal), node.normal_cosine);
      }
    }
  }
}

TEST_F(NodeBoundsTest, HoldForEverySurfelBelow) {
  const std::map<std::string, std::vector<Surfel>> clouds = {
      {"one", randomCloud(1)},
      {"random", randomCloud(4000)},
      {"ball", sphereCloud(20000)},
      {"flat", planeCloud(90, 0.1f)},
      {"turned", turned(planeCloud(90, 0.1f))},
      {"stacked", turned(stackedSheets(40))},
      {"two-sided", twoSided(turned(planeCloud(60, 0.1f)))},
      {"box", boxCloud(30, 0.1f)},
      {"mixed", mixedCloud()},
  };
  const std::map<std::string, std::pair<float, glm::vec3>> places = {
      {"here", {1, glm::vec3(0)}},
      {"far away", {1, {1e5f, -3e5f, 2e4f}}},
      {"tiny", {1e-9f, glm::vec3(0)}},
      {"huge", {1e9f, {1e10f, 0, 0}}},
  };
  for (const auto& [name, cloud] : clouds) {
    for (const auto& [place, placement] : places) {
      for (const bool full_precision : {false, true}) {
        SCOPED_TRACE(name + " " + place + (full_precision ? " full" : ""));
        expectBounds(scene(moved(cloud, placement.first, placement.second), full_precision));
        if (HasFatalFailure()) return;
      }
    }
  }
}

TEST_F(NodeBoundsTest, AFloorIsThinAndFacesOneWay) {
  for (const bool is_turned : {false, true}) {
    const std::vector<Surfel> floor = planeCloud(120, 0.1f);
    for (const auto& [node, first] : scene(is_turned ? turned(floor) : floor).nodes) {
      ASSERT_LE(node.thickness, node.radius * (1.001f / 255));
      ASSERT_GE(node.normal_cosine, std::cos(kPi / 180));
    }
  }
}

TEST_F(NodeBoundsTest, StacksAreAsThickAsTheyAre) {
  for (const auto& [node, first] : scene(turned(stackedSheets(40))).nodes) {
    if (node.surfel_count < 1000) continue;
    EXPECT_GT(node.thickness, .14f);
    EXPECT_LT(node.thickness, .65f);
  }
}

TEST(SupportOf, IsThatOfSphereAndSlab) {
  Node node{};
  node.normal = {0, 0, 1};
  node.radius = 2;
  for (const float thickness : {0.f, .5f, 1.9f, 2.f}) {
    node.thickness = thickness;
    for (int i = 0; i <= 20; ++i) {
      const double angle = i * 3.14159265 / 20;
      const glm::dvec3 direction(std::sin(angle), 0, std::cos(angle));
      // Points of the set: on rings of the sphere within the slab
      double farthest = 0;
      for (int k = -2000; k <= 2000; ++k) {
        const double z = double(thickness) * k / 2000, rim = std::sqrt(std::max(4 - z * z, 0.));
        farthest = std::max(farthest, std::abs(direction.x) * rim + direction.z * z);
      }
      EXPECT_NEAR(supportOf(node, direction), farthest, 1e-5);
    }
  }
}

TEST(BoundCodes, AnyBytesGiveNumbersInRange) {
  Node node{};
  node.radius = 3;
  node.normal = {0, 1, 0};
  float last_thickness = -1, last_cosine = 2;
  for (int code = 0; code < 256; ++code) {
    const auto byte = static_cast<std::uint8_t>(code);
    setBounds({byte, byte}, node);
    EXPECT_GT(node.thickness, last_thickness);
    EXPECT_LE(node.normal_cosine, last_cosine);
    last_thickness = node.thickness;
    last_cosine = node.normal_cosine;
  }
  EXPECT_EQ(last_thickness, node.radius);
  EXPECT_EQ(last_cosine, -1);
  node.normal = glm::vec3(0);
  setBounds({0, 0}, node);
  EXPECT_EQ(node.thickness, node.radius);
  EXPECT_EQ(node.normal_cosine, -1);
}

TEST(BoundCodes, HoldWhatTheyAreMadeOf) {
  LevelNode level_node;
  Node& node = level_node.node;
  node.radius = 3;
  node.normal = {0, 1, 0};
  TestRandom random(5);
  for (int i = 0; i < 3000; ++i) {
    node.thickness = node.radius * random.unit() * random.unit();
    level_node.normal_angle = 3.2f * random.unit() * random.unit();
    Node found = node;
    setBounds(boundCodes(level_node, node.position, node.normal), found);
    EXPECT_GE(found.thickness, node.thickness);
    EXPECT_LE(found.thickness, node.thickness + node.radius * (1.01f / 255));
    EXPECT_LE(found.normal_cosine, std::cos(std::min(level_node.normal_angle, kPi)));
  }
}

}  // namespace
}  // namespace surfeit
