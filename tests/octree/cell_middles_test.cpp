// Disks without sizes stand in the middle of their cells, and on the surface that places scatter
// about, but stay in their leaves.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <optional>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "core/curve_key.h"
#include "core/spherical_harmonics.h"
#include "core/tangent_frame.h"
#include "io/test_directory.h"
#include "octree/neighbours/leaf_levels.h"
#include "octree/read/scene_file.h"
#include "surfeit/index.h"
#include "surfels/rows/surfel_writer.h"

namespace surfeit {
namespace {

// The definition, from the root on.
void findLeaves(std::span<const CurveKey> keys, int level, std::size_t capacity,
                std::vector<std::uint8_t>& levels) {
  if (keys.size() <= capacity || level == kCurveLevels) {
    levels.insert(levels.end(), keys.size(), std::uint8_t(level));
    return;
  }
  for (std::size_t begin = 0; begin < keys.size();) {
    std::size_t end = begin + 1;
    while (end < keys.size() && firstDifferentLevel(keys[begin], keys[end]) > level + 1) ++end;
    findLeaves(keys.subspan(begin, end - begin), level + 1, capacity, levels);
    begin = end;
  }
}

TEST(LeafLevels, AreThoseOfTheOctreeHoweverPagesAreCut) {
  std::mt19937_64 random(1);
  for (const std::size_t capacity : {1u, 4u, 16u}) {
    std::vector<CurveKey> keys;
    for (int i = 0; i < 4000; ++i) {
      // Places anywhere; in a small cell; and many at one
      const CurveKey cell = i % 3 == 0 ? 0 : CurveKey{1} << 40;
      keys.push_back(i % 50 == 0 ? 12345 : cell + (random() >> (i % 3 == 0 ? 1 : 30)));
    }
    std::sort(keys.begin(), keys.end());
    std::vector<std::uint8_t> expected;
    findLeaves(keys, 0, capacity, expected);
    // Pages end between leaves
    std::vector<std::uint8_t> found(keys.size());
    for (std::size_t begin = 0; begin < keys.size();) {
      std::size_t end = std::min(keys.size(), begin + 200);
      while (end < keys.size() &&
             firstDifferentLevel(keys[end - 1], keys[end]) > int(expected[end])) {
        ++end;
      }
      const auto at = [&](std::size_t i) {
        return i < keys.size() ? std::optional(keys[i]) : std::nullopt;
      };
      findLeafLevels(std::span(keys).subspan(begin, end - begin), at(begin - 1), at(end), capacity,
                     std::span(found).subspan(begin, end - begin));
      begin = end;
    }
    EXPECT_EQ(found, expected) << capacity;
  }
}

class CellMiddles : public DirectoryTest {
 protected:
  // A sphere of places anywhere, or a plane of pairs.
  std::vector<Surfel> cloud(bool is_sphere) {
    std::vector<Surfel> surfels;
    std::normal_distribution<float> any;
    for (int i = 0; i < 6000; ++i) {
      Surfel& surfel = surfels.emplace_back();
      surfel.normal = is_sphere
                          ? glm::normalize(glm::vec3(any(random_), any(random_), any(random_)))
                          : glm::vec3(0, 0, 1);
      surfel.position = surfel.normal;
      if (!is_sphere) {
        const int pair = i / 2;
        surfel.position = {float(pair % 60) + (i % 2 == 0 ? -.1f : .1f), float(pair / 60), 0};
      }
    }
    return surfels;
  }

  std::vector<Surfel> indexed(const std::vector<Surfel>& cloud, bool keeps_sizes, RootCube& cube) {
    CloudChannels channels;
    channels.normal = channels.two_sided = true;
    channels.area = channels.radius = keeps_sizes;
    auto writer = SurfelWriter::create(path("cloud.ply"), channels);
    EXPECT_TRUE(writer.ok() && writer->write(cloud).ok() && writer->finish().ok());
    IndexOptions options;
    options.full_precision = true;
    Progress quiet;
    EXPECT_TRUE(indexClouds({path("cloud.ply")}, path("scene.sft"), options, quiet).ok());
    const Result<SceneFile> file = SceneFile::open(path("scene.sft"));
    EXPECT_TRUE(file.ok());
    cube = file->header().cube;
    std::vector<Surfel> surfels, page(file->header().surfel_group_capacity);
    SceneFile::Scratch scratch;
    for (std::uint32_t i = 0; i < file->surfelPageCount(); ++i) {
      const Result<std::uint32_t> count = file->decodeSurfels(i, scratch, page);
      EXPECT_TRUE(count.ok());
      surfels.insert(surfels.end(), page.begin(), page.begin() + *count);
    }
    return surfels;
  }

  static std::vector<std::uint8_t> leavesOf(const std::vector<Surfel>& surfels,
                                            const RootCube& cube, std::vector<CurveKey>& keys) {
    keys.resize(surfels.size());
    curveKeys(&surfels.front().position, sizeof(Surfel), cube, keys);
    std::vector<std::uint8_t> levels;
    findLeaves(keys, 0, 16, levels);
    return levels;
  }

  // 100 x 100 places of a plane, 1 apart on average, that scatter by `noise` along its normal.
  std::vector<Surfel> noisyPlane(const glm::vec3& normal, float noise) {
    const TangentFrame frame(normal);
    std::uniform_real_distribution<float> side(-50, 50);
    std::normal_distribution<float> any;
    std::vector<Surfel> surfels(10000);
    for (Surfel& surfel : surfels) {
      surfel.position = side(random_) * frame.tangent + side(random_) * frame.bitangent +
                        noise * any(random_) * normal;
      surfel.normal = normal;
    }
    return surfels;
  }

  // How far disks stand off a surface, root mean square.
  float offSurface(const std::vector<Surfel>& cloud,
                   const std::function<float(const glm::vec3&)>& height) {
    RootCube cube;
    double sum = 0;
    const std::vector<Surfel> surfels = indexed(cloud, false, cube);
    for (const Surfel& surfel : surfels) {
      sum += double(height(surfel.position)) * double(height(surfel.position));
    }
    return float(std::sqrt(sum / double(surfels.size())));
  }

  std::mt19937 random_{2};
};

TEST_F(CellMiddles, LeavesAndTheirOrderStay) {
  for (const bool is_sphere : {false, true}) {
    std::vector<Surfel> given = cloud(is_sphere);
    RootCube cube, same;
    const std::vector<Surfel> moved = indexed(given, false, cube);
    for (Surfel& surfel : given) surfel.area = surfel.radius = .01f;
    const std::vector<Surfel> kept = indexed(given, true, same);
    ASSERT_EQ(moved.size(), kept.size());
    std::vector<CurveKey> moved_keys, kept_keys;
    EXPECT_EQ(leavesOf(moved, cube, moved_keys), leavesOf(kept, same, kept_keys));
    EXPECT_TRUE(std::is_sorted(moved_keys.begin(), moved_keys.end()));
    std::size_t count = 0;
    for (const Surfel& surfel : moved) {
      const auto is_here = [&](const Surfel& other) { return other.position == surfel.position; };
      count += std::none_of(kept.begin(), kept.end(), is_here);
    }
    EXPECT_GT(count, moved.size() * 9 / 10);
  }
}

// Pairs .2 apart in rows 1 apart: each has half of a square, and its middle is .25 aside of the
// square's. A leaf may end between the two, but not far from there.
TEST_F(CellMiddles, PairsPart) {
  RootCube cube;
  std::size_t count = 0, parted = 0;
  for (const Surfel& surfel : indexed(cloud(false), false, cube)) {
    const glm::vec3& place = surfel.position;
    if (place.x < 2 || place.y < 2 || place.x > 57 || place.y > 47) continue;
    ++count;
    const float aside = std::abs(place.x - std::round(place.x));
    const float moment = (.25f + 1) / 12 + (aside - .25f) * (aside - .25f);
    EXPECT_NEAR(surfel.area, .5f, 1e-3f);
    EXPECT_NEAR(surfel.radius, std::sqrt(2 * 2 * moment), 2e-3f) << aside;
    parted += std::abs(aside - .25f) < 1e-3f ? 1 : 0;
  }
  EXPECT_GT(count, 3000u);
  EXPECT_GT(parted, count * 6 / 10);
}

TEST_F(CellMiddles, DisksStandOnThePlaneThatPlacesScatterAbout) {
  for (const glm::vec3& normal :
       {glm::vec3(0, 0, 1), glm::vec3(-1, 0, 0), glm::normalize(glm::vec3(1, 2, -3))}) {
    const auto height = [&](const glm::vec3& place) { return glm::dot(place, normal); };
    constexpr float kMost = .56f;  // leaves hold some back
    EXPECT_LT(offSurface(noisyPlane(normal, .2f), height), .2f * kMost);
    EXPECT_LT(offSurface(noisyPlane(normal, .5f), height), .5f * kMost);
    EXPECT_LT(offSurface(noisyPlane(normal, 0), height), 1e-3f);
    // A receiver at its place would be behind it
    std::vector<Surfel> two_sided = noisyPlane(normal, .5f);
    for (Surfel& surfel : two_sided) surfel.flags |= kSurfelTwoSided;
    EXPECT_NEAR(offSurface(two_sided, height), .5f, .02f);
  }
}

TEST_F(CellMiddles, DisksStandOnASphereThatPlacesScatterAbout) {
  const auto height = [](const glm::vec3& place) { return glm::length(place) - 1; };
  const float spacing = std::sqrt(4 * kPi / 6000);
  std::vector<Surfel> noisy = cloud(true);
  const float clean = offSurface(noisy, height);
  EXPECT_LT(clean, .03f * spacing);
  std::normal_distribution<float> any;
  for (Surfel& surfel : noisy) surfel.position += .5f * spacing * any(random_) * surfel.normal;
  EXPECT_LT(offSurface(noisy, height), .5f * spacing * .56f);
}

// Two slopes that meet at an angle, which are no noise.
TEST_F(CellMiddles, EdgesStaySharp) {
  for (const float degrees : {20.f, 45.f, 55.f}) {
    const float angle = degrees * kPi / 360, slope = std::tan(angle);
    std::vector<Surfel> roof = noisyPlane({0, 0, 1}, 0);
    for (Surfel& surfel : roof) {
      glm::vec3& place = surfel.position;
      place.x *= std::cos(angle);
      place.z = -slope * std::abs(place.x);
      surfel.normal = {std::copysign(std::sin(angle), place.x), 0, std::cos(angle)};
    }
    const auto height = [&](const glm::vec3& place) { return place.z + slope * std::abs(place.x); };
    EXPECT_LT(offSurface(roof, height), .02f) << degrees;
  }
}

}  // namespace
}  // namespace surfeit
