// What has gaps stays open, though the gaps are narrower than a pixel: fences, grates.
#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>
#include <string>
#include <vector>

#include "random/closed_things.h"
#include "random/indexed_scene.h"
#include "surfeit/gather.h"

namespace surfeit {
namespace {

// Boards in the plane y = 0, from x = -1 to 1 and from z = 0 to 2, that face -y.
struct Fence {
  float period, part;  // of it that is board
  bool hasBoard(float x, float z) const {
    if (!(std::abs(x) < 1 && z > 0 && z < 2)) return false;
    const float places = (x + 1) / period;
    return places - std::floor(places) < part;
  }
};

// Eight surfels to a period, or nearly.
std::vector<Surfel> surfelsOf(const Fence& fence, const glm::mat3& turn) {
  std::vector<Surfel> surfels;
  const float width = fence.part * fence.period;
  const int across = int(std::lround(8 * fence.part)), along = int(16 / fence.period);
  for (int board = 0; board < int(std::lround(2 / fence.period)); ++board) {
    for (int i = 0; i < across; ++i) {
      for (int j = 0; j < along; ++j) {
        Surfel& surfel = surfels.emplace_back();
        const float x = -1 + float(board) * fence.period + (float(i) + .5f) * width / float(across);
        surfel.position = turn * glm::vec3(x, 0, 2 * (float(j) + .5f) / float(along));
        surfel.normal = turn * glm::vec3(0, -1, 0);
        surfel.area = width / float(across) * 2 / float(along);
        surfel.radius = std::sqrt(surfel.area);
      }
    }
  }
  return surfels;
}

// The part of evenly spread cosine directions that boards are in.
double trueOcclusion(const Fence& fence, const glm::vec3& eye) {
  constexpr int kDirections = 400;
  int hits = 0;
  for (int i = 0; i < kDirections; ++i) {
    for (int j = 0; j < kDirections; ++j) {
      const float u = (float(i) + .5f) / kDirections,
                  angle = 6.2831853f * (float(j) + .5f) / kDirections;
      const float across = std::sqrt(u), forward = std::sqrt(1 - u), t = -eye.y / forward;
      hits += fence.hasBoard(eye.x + t * across * std::cos(angle),
                             eye.z + t * across * std::sin(angle));
    }
  }
  return double(hits) / (kDirections * kDirections);
}

TEST(Gaps, FencesAreNotClosed) {
  for (const glm::mat3& turn : {glm::mat3(1), slanted()}) {
    for (const Fence& fence :
         {Fence{.05f, .5f}, Fence{.1f, .5f}, Fence{.05f, .25f}, Fence{.05f, .625f}}) {
      const auto scene = IndexedScene::make(surfelsOf(fence, turn));
      ASSERT_TRUE(scene.ok()) << scene.status().message();
      for (const float distance : {.5f, 1.f, 2.f}) {
        std::vector<LocalReceiver> receivers;
        double truth = 0;
        for (int i = 0; i < 9; ++i) {
          const glm::vec3 eye(-.2f + .05f * float(i) + .007f, -distance, .9f + .01f * float(i));
          receivers.push_back({turn * eye, turn * glm::vec3(0, 1, 0)});
          truth += trueOcclusion(fence, eye) / 9;
        }
        const auto results = (*scene)->gatherAlone(receivers, {GatherMode::kOcclusion, {}});
        ASSERT_TRUE(results.ok()) << results.status().message();
        double found = 0;
        for (const GatherResult& result : *results) found += double(result.occlusion) / 9;
        std::printf("boards %.3f of %.2f, %.1f away: %.3f for %.3f\n",
                    double(fence.part * fence.period), double(fence.period), double(distance),
                    found, truth);
        EXPECT_NEAR(found, truth, .05) << fence.period << ' ' << fence.part << ' ' << distance;
      }
    }
  }
}

}  // namespace
}  // namespace surfeit
