// Sheets in folds, curtains and corrugated roofs, hide what a sheet without holes hides, seen from
// both sides or from one, however narrow the folds are.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>
#include <vector>

#include "random/closed_things.h"
#include "random/indexed_scene.h"
#include "random/random_numbers.h"
#include "surfeit/gather.h"

namespace surfeit {
namespace {

// A sheet over x = -1 to 1 and z = 0 to 2 with folds along z: y is a triangle wave of x.
struct Folds {
  float period, slope;  // dy over dx
  float amplitude() const { return period * slope / 4; }
  float height(float x) const {
    const float turns = x / period - std::floor(x / period);
    return amplitude() * (4 * std::abs(turns - .5f) - 1);
  }
  bool isOver(float x, float z) const { return std::abs(x) < 1 && z > 0 && z < 2; }
};

struct Sampling {
  bool is_two_sided, is_jittered;
};

// Eight surfels to a period, on slopes that are whole.
std::vector<Surfel> surfelsOf(const Folds& folds, const Sampling& sampling, const glm::mat3& turn) {
  constexpr int kPerSlope = 4;
  RandomNumbers random(7);
  std::vector<Surfel> surfels;
  const float step = folds.period / (2 * kPerSlope);
  const float steep = std::sqrt(1 + folds.slope * folds.slope);
  const int across = int(std::lround(2 / step)), along = int(std::lround(2 / (step * steep)));
  for (int i = 0; i < across; ++i) {
    for (int j = 0; j < along; ++j) {
      const float u = sampling.is_jittered ? float(random.between(0, 1)) : .5f;
      const float v = sampling.is_jittered ? float(random.between(0, 1)) : .5f;
      const float middle = -1 + (float(i) + .5f) * step, x = -1 + (float(i) + u) * step;
      const float side = folds.height(middle + .1f * step) > folds.height(middle) ? 1.f : -1.f;
      Surfel& surfel = surfels.emplace_back();
      surfel.position = turn * glm::vec3(x, folds.height(x), 2 * (float(j) + v) / float(along));
      surfel.normal = turn * glm::normalize(glm::vec3(side * folds.slope, -1, 0));
      surfel.area = step * steep * 2 / float(along);
      surfel.radius = std::sqrt(surfel.area);
      if (sampling.is_two_sided) surfel.flags |= kSurfelTwoSided;
    }
  }
  return surfels;
}

// The part of evenly spread cosine directions that meet the sheet.
double trueOcclusion(const Folds& folds, const glm::vec3& eye) {
  constexpr int kDirections = 200, kSteps = 200;
  int hits = 0;
  for (int i = 0; i < kDirections; ++i) {
    for (int j = 0; j < kDirections; ++j) {
      const float u = (float(i) + .5f) / kDirections,
                  angle = 6.2831853f * (float(j) + .5f) / kDirections;
      const float forward = std::sqrt(1 - u);
      const float along_x = std::sqrt(u) * std::cos(angle),
                  along_z = std::sqrt(u) * std::sin(angle);
      int side = 0;  // below, -1, or above, 1, where the sheet is
      bool is_hit = false;
      for (int k = 0; k <= kSteps && !is_hit; ++k) {
        const float y = folds.amplitude() * (2.02f * float(k) / kSteps - 1.01f);
        const float t = (y - eye.y) / forward;
        const float x = eye.x + t * along_x;
        if (!folds.isOver(x, eye.z + t * along_z)) continue;
        const int now = y < folds.height(x) ? -1 : 1;
        is_hit = side * now < 0;
        side = now;
      }
      hits += is_hit;
    }
  }
  return double(hits) / (kDirections * kDirections);
}

std::vector<glm::vec3> eyesBefore(float distance) {
  std::vector<glm::vec3> eyes;
  for (int i = 0; i < 5; ++i) {
    eyes.emplace_back(-.2f + .05f * float(i) + .007f, -distance, .9f + .01f * float(i));
  }
  return eyes;
}

double meanOcclusion(IndexedScene& scene, const std::vector<glm::vec3>& eyes,
                     const glm::mat3& turn) {
  std::vector<LocalReceiver> receivers;
  for (const glm::vec3& eye : eyes) receivers.push_back({turn * eye, turn * glm::vec3(0, 1, 0)});
  const auto results = scene.gatherAlone(receivers, {GatherMode::kOcclusion, {}});
  EXPECT_TRUE(results.ok()) << results.status().message();
  double mean = 0;
  for (const GatherResult& result : *results) {
    mean += double(result.occlusion) / double(receivers.size());
  }
  return mean;
}

TEST(Folds, HideWhatIsBehind) {
  double sum_sq = 0;
  int count = 0;
  for (const Folds folds : {Folds{.4f, .36f},
                            {.4f, 1},
                            {.4f, 2},
                            {.1f, .36f},
                            {.1f, 1},
                            {.1f, 2},
                            {.025f, .36f},
                            {.025f, 1},
                            {.025f, 2}}) {
    for (const float distance : {.5f, 1.f}) {
      const std::vector<glm::vec3> eyes = eyesBefore(distance);
      double truth = 0;
      for (const glm::vec3& eye : eyes) truth += trueOcclusion(folds, eye) / double(eyes.size());
      for (const Sampling sampling :
           {Sampling{false, false}, {true, false}, {false, true}, {true, true}}) {
        for (const glm::mat3& turn : {glm::mat3(1), slanted()}) {
          const auto scene = IndexedScene::make(surfelsOf(folds, sampling, turn));
          ASSERT_TRUE(scene.ok()) << scene.status().message();
          const double found = meanOcclusion(**scene, eyes, turn);
          std::printf("%s%s, folds of %.3f, slope %.2f, %.1f away: %.3f for %.3f\n",
                      sampling.is_two_sided ? "two-sided" : "one-sided",
                      sampling.is_jittered ? " jittered" : "", double(folds.period),
                      double(folds.slope), double(distance), found, truth);
          EXPECT_NEAR(found, truth, .1);
          sum_sq += (found - truth) * (found - truth);
          ++count;
        }
      }
    }
  }
  EXPECT_LT(std::sqrt(sum_sq / count), .025);
}

}  // namespace
}  // namespace surfeit
