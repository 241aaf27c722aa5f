// Surfaces whose surfels lie anywhere, each place as likely as the next: some lie upon each other,
// and between others there are holes. They are surfaces all the same, by whatever is drawn.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>
#include <random>
#include <vector>

#include "random/closed_things.h"
#include "random/indexed_scene.h"
#include "surfeit/gather.h"

namespace surfeit {
namespace {

// A square in the plane y = 0, from x = -1 to 1 and from z = 0 to 2, that faces -y.
std::vector<Surfel> scatteredSquare(int count, bool is_two_sided, const glm::mat3& turn) {
  std::mt19937 random(unsigned(count) + 7);
  std::uniform_real_distribution<float> place(0, 2);
  std::vector<Surfel> surfels(std::size_t(count), Surfel{});
  for (Surfel& surfel : surfels) {
    const float x = place(random) - 1, z = place(random);
    surfel.position = turn * glm::vec3(x, 0, z);
    surfel.normal = turn * glm::vec3(0, -1, 0);
    surfel.area = 4 / float(count);
    surfel.radius = std::sqrt(surfel.area / 3.14159265f);
    if (is_two_sided) surfel.flags |= kSurfelTwoSided;
  }
  return surfels;
}

// The part of evenly spread cosine directions along +y that meet the square.
double trueOcclusion(const glm::vec3& eye) {
  constexpr int kDirections = 400;
  int hits = 0;
  for (int i = 0; i < kDirections; ++i) {
    for (int j = 0; j < kDirections; ++j) {
      const float u = (float(i) + .5f) / kDirections,
                  angle = 6.2831853f * (float(j) + .5f) / kDirections;
      const float t = -eye.y * std::sqrt(u / (1 - u));
      const float x = eye.x + t * std::cos(angle), z = eye.z + t * std::sin(angle);
      hits += std::abs(x) < 1 && z > 0 && z < 2;
    }
  }
  return double(hits) / (kDirections * kDirections);
}

// What is off, at worst and as bias, over receivers this far away.
struct Off {
  double standard = 0, exact = 0, between = 0;  // bias to the truth; worst of standard to exact
};
Off offAt(float distance, IndexedScene& scene, const glm::mat3& turn) {
  std::vector<LocalReceiver> receivers;
  double truth = 0;
  for (int i = 0; i < 9; ++i) {
    const glm::vec3 eye(-.2f + .05f * float(i) + .007f, -distance, .9f + .01f * float(i));
    receivers.push_back({turn * eye, turn * glm::vec3(0, 1, 0)});
    truth += trueOcclusion(eye) / 9;
  }
  GatherQuality exact;
  exact.max_solid_angle = 0;
  const auto standard = scene.gatherAlone(receivers, {GatherMode::kOcclusion, {}});
  const auto exactly = scene.gatherAlone(receivers, {GatherMode::kOcclusion, exact});
  EXPECT_TRUE(standard.ok() && exactly.ok());
  Off off{-truth, -truth, 0};
  for (std::size_t i = 0; i < receivers.size(); ++i) {
    const auto found = double((*standard)[i].occlusion), right = double((*exactly)[i].occlusion);
    off.standard += found / 9;
    off.exact += right / 9;
    off.between = std::max(off.between, std::abs(found - right));
  }
  return off;
}

TEST(Scattered, SquaresCoverHoweverFinelyTheyAreDrawn) {
  for (const glm::mat3& turn : {glm::mat3(1), slanted()}) {
    for (const bool is_two_sided : {false, true}) {
      for (const int count : {300, 1000, 4000, 16'000}) {
        const auto scene = IndexedScene::make(scatteredSquare(count, is_two_sided, turn));
        ASSERT_TRUE(scene.ok()) << scene.status().message();
        for (const float distance : {.5f, 1.f, 2.f}) {
          const Off off = offAt(distance, **scene, turn);
          std::printf("%5d %s, %.1f away: %+.3f, exact %+.3f, between %.3f\n", count,
                      is_two_sided ? "two-sided" : "one-sided", double(distance), off.standard,
                      off.exact, off.between);
          // The goal is .01. Without hulls of nodes .083
          EXPECT_LE(off.between, .055) << count << ' ' << distance;
          // Fewer are no square: what they cover is short of it by holes and by ragged outlines
          if (count < 4000) continue;
          EXPECT_NEAR(off.standard, 0, .03) << count << ' ' << distance;
          EXPECT_NEAR(off.exact, 0, .03) << count << ' ' << distance;
        }
      }
    }
  }
}

struct Limits {
  float distance;
  double rms;
};

// Over 100 receivers before the square, at distances in spacings of 4000 places.
void expectCovering(const std::vector<Surfel>& cloud, const glm::mat3& turn,
                    const std::vector<Limits>& limits, double most_bias) {
  const auto scene = IndexedScene::make(cloud);
  ASSERT_TRUE(scene.ok()) << scene.status().message();
  const float spacing = std::sqrt(4 / 4000.f);
  for (const auto [distance, rms] : limits) {
    std::vector<LocalReceiver> receivers;
    double truth[100], square = 0, sum = 0;
    for (int i = 0; i < 100; ++i) {
      const glm::vec3 eye(-.5f + .1f * float(i % 10), -distance * spacing,
                          .5f + .1f * float(i / 10));
      receivers.push_back({turn * eye, turn * glm::vec3(0, 1, 0)});
      truth[i] = trueOcclusion(eye);
    }
    const auto found = (*scene)->gatherAlone(receivers, {GatherMode::kOcclusion, {}});
    ASSERT_TRUE(found.ok());
    for (int i = 0; i < 100; ++i) {
      const double off = double((*found)[std::size_t(i)].occlusion) - truth[i];
      sum += off / 100, square += off * off / 100;
    }
    std::printf("%.1f spacings: bias %+.4f, rms %.4f\n", double(distance), sum, std::sqrt(square));
    EXPECT_LE(std::sqrt(square), rms) << distance;
    EXPECT_LE(std::abs(sum), most_bias) << distance;
  }
}

// Sizes that index finds: each disk stands in the middle of its cell and hides all of it.
TEST(Scattered, SquaresWithoutSizesCoverFromTheirSurfaceOn) {
  for (const glm::mat3& turn : {glm::mat3(1), slanted()}) {
    for (const bool is_two_sided : {false, true}) {
      std::vector<Surfel> cloud = scatteredSquare(4000, is_two_sided, turn);
      for (Surfel& surfel : cloud) surfel.area = surfel.radius = 0;
      // At the places that were given .07, .05, .035, .013; of disks that cover their areas .075,
      // .07, .06, .006
      expectCovering(cloud, turn, {{.3f, .016}, {1.f, .009}, {3.f, .006}, {8.f, .006}}, .007);
    }
  }
}

// Areas that are not those of the cells: each surfel has the same part of the square, and hides its
// cell all the same.
TEST(Scattered, SquaresWithAreasAloneLeaveFewHoles) {
  for (const glm::mat3& turn : {glm::mat3(1), slanted()}) {
    for (const bool is_two_sided : {false, true}) {
      std::vector<Surfel> cloud = scatteredSquare(4000, is_two_sided, turn);
      for (Surfel& surfel : cloud) surfel.radius = 0;
      // Disks of twice the area around the places: .32, .23, .18, .10; of disks that cover their
      // areas .10, .07, .06, .03, if two-sided .29, .24, .18, .07
      expectCovering(cloud, turn, {{.3f, .023}, {1.f, .012}, {3.f, .009}, {8.f, .013}}, .012);
    }
  }
}

// Surfels at one place share its cell: each is a disk of all of it that hides its part. (Leaves
// hold fewer places then, and hold the disks back.)
TEST(Scattered, PlacesThatComeSeveralTimesCoverAsOnce) {
  for (const glm::mat3& turn : {glm::mat3(1), slanted()}) {
    for (const int times : {2, 4}) {
      const std::vector<Surfel> once = scatteredSquare(4000, false, turn);
      std::vector<Surfel> bare;
      for (int i = 0; i < times; ++i) bare.insert(bare.end(), once.begin(), once.end());
      std::vector<Surfel> with_areas = bare;
      for (Surfel& surfel : bare) surfel.area = surfel.radius = 0;
      for (Surfel& surfel : with_areas) surfel.area /= float(times), surfel.radius = 0;
      std::printf("%d times\n", times);
      expectCovering(bare, turn, {{.3f, .016}, {1.f, .012}, {3.f, .012}, {8.f, .006}}, .011);
      expectCovering(with_areas, turn, {{.3f, .053}, {1.f, .03}, {3.f, .026}, {8.f, .02}}, .022);
    }
  }
}

// The light of disks that hide cells is that of their areas: so much as of the true square.
TEST(Scattered, SquaresWithAreasAloneSendWhatTheirAreasSend) {
  for (const bool is_two_sided : {false, true}) {
    std::vector<Surfel> cloud = scatteredSquare(4000, is_two_sided, slanted());
    for (Surfel& surfel : cloud) surfel.radius = 0, surfel.radiosity = glm::vec3(1, 2, 3);
    const auto scene = IndexedScene::make(cloud);
    ASSERT_TRUE(scene.ok()) << scene.status().message();
    for (const float distance : {.03f, .1f, .3f, 1.f, 10.f}) {
      const glm::vec3 eye(0, -distance, 1);
      const std::vector<LocalReceiver> receivers = {
          {slanted() * eye, slanted() * glm::vec3(0, 1, 0)}};
      const auto found = (*scene)->gatherAlone(receivers, {GatherMode::kBleeding, {}});
      ASSERT_TRUE(found.ok());
      const double truth = trueOcclusion(eye);
      std::printf("%.2f away: %.3f of the light\n", double(distance),
                  double((*found)[0].irradiance.y) / (2 * truth));
      EXPECT_NEAR(double((*found)[0].irradiance.y) / (2 * truth), 1, .035) << distance;
    }
  }
}

}  // namespace
}  // namespace surfeit
