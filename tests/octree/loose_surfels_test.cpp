// Tiles of surfaces, pieces of small leaves and what is alone, told by what lies around them.
#include "octree/build/loose_surfels.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <random>
#include <span>
#include <vector>

#include "core/long_side.h"
#include "octree/node/node_sums.h"
#include "octree/page/surfel_marks.h"

namespace surfeit {
namespace {

constexpr float kHalf = 16;  // of the cell, in spacings
const Bounds3 kCube = {glm::vec3(-kHalf), glm::vec3(kHalf)};

Surfel surfelAt(const glm::vec3& position, const glm::vec3& normal, bool is_sphere) {
  Surfel surfel;
  surfel.position = position;
  surfel.area = 1;
  surfel.radius = .71f;
  surfel.normal = is_sphere ? glm::vec3(0) : normal;
  surfel.flags = is_sphere ? kSurfelSphere : kSurfelTwoSided;
  return surfel;
}

class Cloud {
 public:
  explicit Cloud(bool is_sphere, unsigned seed = 1) : is_sphere_(is_sphere), random_(seed) {}

  void add(const glm::vec3& position, const glm::vec3& normal) {
    surfels.push_back(surfelAt(position, normal, is_sphere_));
  }
  // `columns` x `rows`, a spacing apart along u and v; each off by up to `noise` along the normal,
  // and by up to `jitter` along the others.
  void addSheet(const glm::vec3& middle, const glm::vec3& u, const glm::vec3& v, int columns,
                int rows, float noise = 0, float jitter = 0) {
    const glm::vec3 normal = glm::cross(u, v);
    for (int i = 0; i < columns * rows; ++i) {
      const float s = float(i % columns) - .5f * float(columns - 1) + jitter * any(),
                  t = float(i / columns) - .5f * float(rows - 1) + jitter * any();
      add(middle + s * u + t * v + noise * any() * normal, normal);
    }
  }
  glm::vec3 direction() {
    glm::vec3 v;
    do v = {any(), any(), any()};
    while (glm::dot(v, v) > 1 || glm::dot(v, v) < .01f);
    return glm::normalize(v);
  }
  float any() { return std::uniform_real_distribution<float>(-1, 1)(random_); }

  std::vector<Surfel> surfels;

 private:
  bool is_sphere_;
  std::mt19937 random_;
};

// Most of a cell that is one part.
struct Found {
  bool is_loose, is_lone;
};
Found found(std::vector<Surfel> cloud, const Bounds3& all = kCube) {
  LooseSurfels loose;
  EXPECT_TRUE(loose.look(cloud, kCube, all));
  loose.mark(0, cloud);
  double parts[2] = {};
  for (const Surfel& surfel : cloud) {
    parts[0] += surfel.isLoose() / double(cloud.size());
    parts[1] += surfel.isLone() / double(cloud.size());
  }
  for (const double part : parts) EXPECT_TRUE(part < .1 || part > .7) << part;
  return {parts[0] > .5, parts[1] > .5};
}

const glm::vec3 kX(1, 0, 0), kY(0, 1, 0), kZ(0, 0, 1);

TEST(LooseSurfels, SheetsAreTilesOfEitherKind) {
  for (const bool is_sphere : {false, true}) {
    for (const float noise : {0.f, .2f, .4f}) {
      for (const float jitter : {0.f, .3f}) {
        Cloud cloud(is_sphere);
        cloud.addSheet(glm::vec3(0), kX, kY, 24, 24, noise, jitter);
        EXPECT_FALSE(found(cloud.surfels).is_loose) << is_sphere << noise << jitter;
      }
    }
  }
}

TEST(LooseSurfels, WhatLiesAnywhereIsLone) {
  for (const bool is_sphere : {false, true}) {
    for (const int count : {60, 300, 1000}) {
      // Disks as near as tiles happen to lie beside each other: such a volume is opaque
      for (const float spacing : {is_sphere ? 1.f : 1.5f, 2.f}) {
        Cloud cloud(is_sphere, unsigned(count));
        const float half = std::min(kHalf, .5f * spacing * std::cbrt(float(count)));
        for (int i = 0; i < count; ++i) {
          cloud.add(half * glm::vec3(cloud.any(), cloud.any(), cloud.any()), cloud.direction());
        }
        const Found is = found(cloud.surfels);
        EXPECT_TRUE(is.is_loose && is.is_lone) << is_sphere << ", " << count << ", " << spacing;
      }
    }
  }
}

// Leaves of so many surfels, far enough from each other to be told apart.
TEST(LooseSurfels, SmallLeavesArePieces) {
  struct Leaf {
    int columns, rows;
    bool is_loose, is_lone;
  };
  for (const Leaf leaf : {Leaf{1, 1, true, true},
                          {2, 1, true, true},
                          {2, 2, true, false},
                          {4, 3, true, false},
                          {12, 12, false, false}}) {
    Cloud cloud(false);
    const int size = leaf.columns * leaf.rows, count = std::max(4, 600 / size);
    for (int i = 0; i < count; ++i) {
      const glm::vec3 u = cloud.direction(), v = glm::normalize(glm::cross(u, cloud.direction()));
      const float far = kHalf - 8;
      cloud.addSheet(far * glm::vec3(cloud.any(), cloud.any(), cloud.any()), u, v, leaf.columns,
                     leaf.rows);
    }
    const Found is = found(cloud.surfels);
    EXPECT_EQ(is.is_loose, leaf.is_loose) << size;
    EXPECT_EQ(is.is_lone, leaf.is_lone) << size;
  }
}

TEST(LooseSurfels, FoldsAndCornersAreTiles) {
  for (const bool is_sphere : {false, true}) {
    Cloud corner(is_sphere);
    corner.addSheet({0, 0, -8}, kX, kY, 16, 16);
    corner.addSheet({0, -8, 0}, kZ, kX, 16, 16);
    corner.addSheet({-8, 0, 0}, kY, kZ, 16, 16);
    EXPECT_FALSE(found(corner.surfels).is_loose) << is_sphere;
    // Slopes of four rows at right angles
    Cloud folds(is_sphere);
    const glm::vec3 up = glm::normalize(kX + kZ), down = glm::normalize(kX - kZ);
    for (int i = 0; i < 6; ++i) {
      const glm::vec3 step = std::sqrt(8.f) * kX;
      folds.addSheet((float(i) - 2.5f) * step, i % 2 == 0 ? up : down, kY, 4, 24);
    }
    EXPECT_FALSE(found(folds.surfels).is_loose) << is_sphere;
  }
}

// Rectangles: where their sides meet, far apart along one and close along the other.
Surfel rectangleAt(const glm::vec3& position, const glm::vec3& normal, const glm::vec3& along,
                   float length, float width) {
  Surfel surfel = surfelAt(position, normal, false);
  surfel.area = length * width;
  surfel.radius = std::sqrt(.5f * surfel.area);
  setLongSide(length * along, surfel);
  return surfel;
}

// The lines of a scan, up to 20 times as far apart as the places along them, which lie anywhere.
TEST(LooseSurfels, RowsOfASheetAreTiles) {
  for (const float ratio : {1.f, 3.f, 10.f, 20.f}) {
    for (const float noise : {0.f, .2f}) {
      Cloud random(false);
      const float width = 1 / std::sqrt(ratio), length = width * ratio;
      std::vector<Surfel> cloud;
      for (float y = .5f * length - kHalf; y < kHalf; y += length) {
        const float phase = random.any();
        for (float x = (phase - 1) * width - kHalf; x < kHalf; x += width) {
          const glm::vec3 place(std::max(x, -kHalf), y, noise * random.any());
          cloud.push_back(rectangleAt(place, kZ, kY, length, width));
        }
      }
      EXPECT_FALSE(found(cloud).is_loose) << ratio << ", " << noise;
    }
  }
}

// Strands of pieces end to end, of one direction or of any.
TEST(LooseSurfels, HairIsLoose) {
  for (const bool is_combed : {false, true}) {
    Cloud random(false);
    std::vector<Surfel> cloud;
    constexpr float kLength = 2, kWidth = .2f, kFar = kHalf - 5;
    for (int strand = 0; strand < 100; ++strand) {
      const glm::vec3 along = is_combed ? kX : random.direction();
      const glm::vec3 normal = glm::normalize(glm::cross(along, random.direction()));
      const glm::vec3 middle = kFar * glm::vec3(random.any(), random.any(), random.any());
      for (int piece = -2; piece <= 2; ++piece) {
        cloud.push_back(
            rectangleAt(middle + float(piece) * kLength * along, normal, along, kLength, kWidth));
      }
    }
    const Found is = found(cloud);
    EXPECT_TRUE(is.is_loose && is.is_lone) << is_combed;
  }
}

// A narrow sheet is loose only where its edges are known to be edges.
TEST(LooseSurfels, BordersOfACellAreNoEdges) {
  Cloud cloud(false);
  cloud.addSheet({kHalf - 1.f, 0, 0}, kX, kY, 3, 24);
  const Bounds3 more = {2.f * kCube.min, 2.f * kCube.max};
  EXPECT_FALSE(found(cloud.surfels, more).is_loose);
  EXPECT_TRUE(found(cloud.surfels, kCube).is_loose);
}

// A part may hold the last row of a sheet alone, and of a small leaf what it will.
TEST(LooseSurfels, ThePartThatIsTheEdgeOfASheetIsATile) {
  for (const int rows : {2, 24}) {
    Cloud sheet(false);
    sheet.addSheet(glm::vec3(0), {1, 0, 0}, {0, 1, 0}, 24, rows);
    LooseSurfels loose;
    const Bounds3 all = {glm::vec3(-.5f * kHalf), glm::vec3(.5f * kHalf)};
    ASSERT_TRUE(loose.look(sheet.surfels, kCube, all));
    const std::span<Surfel> last_row = std::span(sheet.surfels).last(24);
    loose.mark(sheet.surfels.size() - 24, last_row);
    for (const Surfel& surfel : last_row) EXPECT_EQ(surfel.isLoose(), rows == 2);
  }
}

TEST(LooseSurfels, OneSidedDisksAreNotAsked) {
  std::vector<Surfel> cloud(3, surfelAt(glm::vec3(0), kZ, false));
  for (Surfel& surfel : cloud) surfel.flags = 0;
  LooseSurfels loose;
  EXPECT_FALSE(loose.look(cloud, kCube, kCube));
}

TEST(LooseSurfels, ANodeIsLooseByMostOfItsArea) {
  for (const int loose : {1, 2}) {
    NodeSums sums;
    for (int i = 0; i < 4; ++i) {
      Surfel surfel = surfelAt({float(i), 0, 0}, kZ, i % 2 == 0);
      if (i < loose + 1) surfel.flags |= kSurfelLoose;
      sums.add(surfel);
    }
    Surfel wall = surfelAt({9, 0, 0}, kX, false);  // counts for nothing
    wall.flags = 0;
    sums.add(wall);
    EXPECT_EQ(sums.toNode(.95f, 10).isLoose(), loose == 2);
  }
}

}  // namespace
}  // namespace surfeit
