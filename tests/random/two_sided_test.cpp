// Sheets of two-sided surfels, as of cloth or of a scan whose normals nobody knows: they hide what
// is behind them, and do not hide it from receivers that lie between their surfels.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>
#include <random>
#include <vector>

#include "random/closed_things.h"
#include "random/indexed_scene.h"
#include "surfeit/gather.h"

namespace surfeit {
namespace {

Surfel twoSided(const glm::vec3& position, const glm::vec3& normal, float area) {
  Surfel surfel;
  surfel.position = position;
  surfel.normal = normal;
  surfel.area = area;
  surfel.radius = std::sqrt(.5f * area);  // a square's corners
  surfel.flags |= kSurfelTwoSided;
  return surfel;
}

// The part of the unit sphere with z below `most_z`, by rings of pieces `spacing` wide, each
// scattered by `scatter` of that.
std::vector<Surfel> bowl(float most_z, float spacing, float scatter, const glm::mat3& turn) {
  std::mt19937 random(9);
  std::uniform_real_distribution<float> off(-.5f * scatter, .5f * scatter);
  std::vector<Surfel> surfels;
  const int rings = int(std::ceil(std::acos(-most_z) / spacing));
  const float high = std::acos(-most_z) / float(rings);
  for (int i = 0; i < rings; ++i) {
    const float from = std::cos(high * float(i)), to = std::cos(high * float(i + 1));
    const int pieces = std::max(3, int(6.2831853f * std::sin(high * (float(i) + .5f)) / spacing));
    for (int j = 0; j < pieces; ++j) {
      const float down = high * (float(i) + .5f + off(random));
      const float around = 6.2831853f * (float(j) + .5f + off(random)) / float(pieces);
      const glm::vec3 place(std::sin(down) * std::cos(around), std::sin(down) * std::sin(around),
                            -std::cos(down));
      surfels.push_back(
          twoSided(turn * place, turn * place, (from - to) * 6.2831853f / float(pieces)));
    }
  }
  return surfels;
}

// Near the bottom of the bowl; inside, or outside.
std::vector<LocalReceiver> atTheBottom(float width, bool inside, const glm::mat3& turn) {
  std::mt19937 random(4);
  std::uniform_real_distribution<float> aside(-width, width);
  std::vector<LocalReceiver> receivers;
  for (int i = 0; i < 100; ++i) {
    const glm::vec3 place = glm::normalize(glm::vec3(aside(random), aside(random), -1));
    receivers.push_back({turn * place, turn * (inside ? -place : place)});
  }
  return receivers;
}

struct Found {
  double mean = 0, least = 1, most = 0;
};
Found occlusionOf(const std::vector<Surfel>& cloud, const std::vector<LocalReceiver>& receivers) {
  Found found;
  const auto scene = IndexedScene::make(cloud);
  EXPECT_TRUE(scene.ok()) << scene.status().message();
  if (!scene.ok()) return found;
  const auto results = (*scene)->gatherAlone(receivers, {GatherMode::kOcclusion, {}});
  EXPECT_TRUE(results.ok());
  for (const GatherResult& one : *results) {
    const auto occlusion = double(one.occlusion);
    found.mean += occlusion / double(receivers.size());
    found.least = std::min(found.least, occlusion);
    found.most = std::max(found.most, occlusion);
  }
  std::printf("%zu surfels: occlusion %.3f, from %.3f to %.3f\n", cloud.size(), found.mean,
              found.least, found.most);
  return found;
}

// From the bottom, a point of the sphere at the angle a from it is a/2 above the horizon. So the
// bowl hides sin^2(a/2) = (1 - cos a)/2. Of the outside, nothing.
TEST(TwoSided, ABowlHidesOfItselfWhatItShould) {
  for (const glm::mat3& turn : {glm::mat3(1), slanted()}) {
    for (const float spacing : {.03f, .1f, .2f}) {
      for (const float scatter : {0.f, .6f}) {
        const std::vector<Surfel> cloud = bowl(-.5f, spacing, scatter, turn);
        const float width = std::max(.03f, spacing);
        const Found inside = occlusionOf(cloud, atTheBottom(width, true, turn));
        EXPECT_NEAR(inside.mean, .25, .02) << spacing << ' ' << scatter;
        EXPECT_LE(inside.most, .4) << spacing << ' ' << scatter;
        const Found outside = occlusionOf(cloud, atTheBottom(width, false, turn));
        EXPECT_LE(outside.mean, .01) << spacing << ' ' << scatter;
        EXPECT_LE(outside.most, .1) << spacing << ' ' << scatter;
      }
    }
  }
}

TEST(TwoSided, AClosedShellIsClosedFromInside) {
  for (const float spacing : {.05f, .1f, .2f}) {
    for (const float scatter : {0.f, .6f}) {
      const std::vector<Surfel> cloud = bowl(1, spacing, scatter, slanted());
      std::vector<LocalReceiver> receivers = atTheBottom(.7f, true, slanted());
      const std::size_t count = receivers.size();
      for (std::size_t i = 0; i < count; ++i) {
        receivers.push_back({.5f * receivers[i].position, receivers[i].normal});
      }
      const Found found = occlusionOf(cloud, receivers);
      EXPECT_GE(found.mean, scatter > 0 ? .985 : .995) << spacing << ' ' << scatter;
    }
  }
}

// Places off by so many spacings: receivers in the plane lie behind half of the disks.
TEST(TwoSided, ANoisySheetDoesNotHideTheSkyFromItself) {
  std::mt19937 random(5);
  std::normal_distribution<float> bell;
  std::uniform_real_distribution<float> place(.3f, .7f);
  for (const glm::mat3& turn : {glm::mat3(1), slanted()}) {
    for (const float noise : {.02f, .05f}) {
      std::vector<Surfel> cloud;
      constexpr int kSide = 100;
      for (int i = 0; i < kSide * kSide; ++i) {
        const glm::vec3 at(float(i % kSide) / kSide, float(i / kSide) / kSide,
                           noise / kSide * bell(random));
        cloud.push_back(twoSided(turn * at, turn * glm::vec3(0, 0, 1), 1.f / (kSide * kSide)));
      }
      std::vector<LocalReceiver> receivers;
      for (int i = 0; i < 200; ++i) {
        const glm::vec3 at{place(random), place(random), 0};
        receivers.push_back({turn * at, turn * glm::vec3(0, 0, i % 2 == 0 ? 1 : -1)});
      }
      EXPECT_LE(occlusionOf(cloud, receivers).mean, .05) << noise;
    }
  }
}

// From one wall, the other hides everything. Walls a tenth of their spacing apart are closer than
// the bias; where they are slanted, some cells of the octree do not tell them apart.
TEST(TwoSided, WallsCloseToEachOtherAreSeenFromBetween) {
  constexpr int kSide = 60;
  for (const glm::mat3& turn : {glm::mat3(1), slanted()}) {
    for (const float gap : {.1f, .3f, 1.f}) {
      std::vector<Surfel> cloud;
      for (int i = 0; i < 2 * kSide * kSide; ++i) {
        const int place = i / 2;
        const glm::vec3 at((float(place % kSide) + .5f) / kSide,
                           (float(place / kSide) + .5f) / kSide, float(i % 2) * gap / kSide);
        cloud.push_back(twoSided(turn * at, turn * glm::vec3(0, 0, 1), 1.f / (kSide * kSide)));
      }
      std::vector<LocalReceiver> inside, outside;
      std::mt19937 random(8);
      std::uniform_real_distribution<float> place(.3f, .7f);
      for (int i = 0; i < 100; ++i) {
        const glm::vec3 at(place(random), place(random), 0);
        inside.push_back({turn * at, turn * glm::vec3(0, 0, 1)});
        outside.push_back({turn * at, turn * glm::vec3(0, 0, -1)});
      }
      EXPECT_GE(occlusionOf(cloud, inside).mean, gap < .2f ? .8 : .99) << gap;
      EXPECT_LE(occlusionOf(cloud, outside).mean, .01) << gap;
    }
  }
}

// Leaves that fill the unit ball evenly, so that a way from the middle meets `depth` of them.
std::vector<Surfel> leaves(int count, float depth) {
  std::mt19937 random(6);
  std::uniform_real_distribution<float> place(-1, 1);
  std::normal_distribution<float> bell;
  const float area = 2 * depth * 4.1887902f / float(count);
  std::vector<Surfel> surfels;
  while (int(surfels.size()) < count) {
    const glm::vec3 at(place(random), place(random), place(random));
    if (glm::length(at) > 1) continue;
    const glm::vec3 normal = glm::normalize(glm::vec3(bell(random), bell(random), bell(random)));
    surfels.push_back(twoSided(at, normal, area));
  }
  return surfels;
}

// By disks of their areas, over directions that are even over the sphere.
double trueOcclusion(const std::vector<Surfel>& cloud, const glm::vec3& eye) {
  constexpr int kDirections = 4000;
  int hits = 0;
  for (int i = 0; i < kDirections; ++i) {
    const float z = 1 - (2 * float(i) + 1) / kDirections, turn = 2.3999632f * float(i);
    const float across = std::sqrt(1 - z * z);
    const glm::vec3 ray(across * std::cos(turn), across * std::sin(turn), z);
    for (const Surfel& leaf : cloud) {
      const glm::vec3 to_leaf = leaf.position - eye;
      const float t = glm::dot(to_leaf, leaf.normal) / glm::dot(ray, leaf.normal);
      const glm::vec3 aside = t * ray - to_leaf;
      if (!(t > 0 && 3.14159265f * glm::dot(aside, aside) < leaf.area)) continue;
      ++hits;
      break;
    }
  }
  return double(hits) / kDirections;
}

TEST(TwoSided, LeavesAllAroundHideTheirAreas) {
  for (const int count : {200, 2000}) {
    for (const float depth : {.5f, 1.5f}) {
      const std::vector<Surfel> cloud = leaves(count, depth);
      std::vector<LocalReceiver> receivers;
      double truth = 0;
      for (int i = 0; i < 20; ++i) {
        const float part = .02f * float(i);
        receivers.push_back({{part, .3f - part, part * .5f}, {}});
        truth += trueOcclusion(cloud, receivers.back().position) / 20;
      }
      std::printf("depth %.1f, true %.3f: ", double(depth), truth);
      // Large leaves behind each other are closed as if they were a surface; the goal is .02
      const double most = count < 1000 && depth > 1 ? .1 : .02;
      EXPECT_NEAR(occlusionOf(cloud, receivers).mean, truth, most) << count << ' ' << depth;
    }
  }
}

}  // namespace
}  // namespace surfeit
