// How much brighter than its mean receivers see a facet whose brightness follows the normals of its
// surfels (gather/packet/packet_lobe-inl.h).
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <vector>

#include "gather/packet/packet_kernel.h"
#include "octree/node/node_facet.h"

namespace surfeit {
namespace {

// Normals around z, within so many radians, that are even in area: on a spiral.
std::vector<glm::vec3> normalsWithin(float angle) {
  constexpr int kCount = 3000;
  std::vector<glm::vec3> normals;
  for (int i = 0; i < kCount; ++i) {
    const float z = 1 - (1 - std::cos(angle)) * (float(i) + .5f) / kCount;
    const float turn = 2.39996f * float(i), across = std::sqrt(1 - z * z);
    normals.emplace_back(across * std::cos(turn), across * std::sin(turn), z);
  }
  return normals;
}

// Receivers around the facet, from where its front is in the zenith to behind its rim; or, of one
// with two sides, all around.
std::vector<glm::vec3> placesAround(bool all) {
  std::vector<glm::vec3> places;
  for (int i = 0; i < int(kPacketReceivers); ++i) {
    const float part = (float(i) + .5f) / float(kPacketReceivers);
    const float tilt = (all ? 3.1f : 1.75f) * part, turn = 2.4f * float(i);
    places.push_back(20.f * glm::vec3(std::sin(tilt) * std::cos(turn),
                                      std::sin(tilt) * std::sin(turn), std::cos(tilt)));
  }
  return places;
}

struct Seen {
  double area = 0, power = 0;
};
Seen seenFrom(const glm::vec3& place, const std::vector<glm::vec3>& normals, const glm::vec3& mean,
              const glm::vec3& change, bool is_two_sided) {
  Seen seen;
  for (const glm::vec3& normal : normals) {
    const float cosine = glm::dot(glm::normalize(place), normal);
    const double shown = double(is_two_sided ? std::abs(cosine) : std::max(0.f, cosine));
    seen.area += shown / double(normals.size());
    seen.power += shown * double(1 + glm::dot(change, normal - mean)) / double(normals.size());
  }
  return seen;
}

TEST(SlopeGain, IsThatOfTheNormalsThatAreSeen) {
  for (const float angle : {.05f, .2f, .4f}) {
    const std::vector<glm::vec3> normals = normalsWithin(angle);
    glm::vec3 mean(0);
    for (const glm::vec3& normal : normals) mean += normal / float(normals.size());
    const float range = normalRange(mean);
    for (const glm::vec3& steep : {glm::vec3(.9f, 0, 0), glm::vec3(-.5f, .6f, .1f)}) {
      const glm::vec3 change = steep / range;
      glm::vec3 bright(0);  // the mean normal, weighted by brightness
      for (const glm::vec3& normal : normals) {
        bright += (1 + glm::dot(change, normal - mean)) / float(normals.size()) * normal;
      }
      // RadiositySlope
      const glm::vec3 slope = 3 / range * glm::vec3(bright.x, bright.y, 0);
      for (const bool is_two_sided : {false, true}) {
        Patch patch;
        patch.normal = mean;
        patch.seen = is_two_sided ? Patch::Seen::kBoth : Patch::Seen::kAllAround;
        const std::vector<glm::vec3> places = placesAround(is_two_sided);
        PacketLanes lanes{};
        for (std::size_t i = 0; i < places.size(); ++i) {
          lanes.x[i] = places[i].x;
          lanes.y[i] = places[i].y;
          lanes.z[i] = places[i].z;
        }
        for (const PacketKernel& kernel : packetKernels()) {
          PacketLights lights;
          lights.colors[0].fill(1);
          lights.colors[1].fill(.5f);
          lights.colors[2].fill(0);
          kernel.seeSlope(lanes, places.size(), patch, {slope, slope, slope}, range, lights);
          for (std::size_t i = 0; i < places.size(); ++i) {
            const Seen seen = seenFrom(places[i], normals, mean, change, is_two_sided);
            const double gain = double(lights.colors[0][i]);
            EXPECT_NEAR(gain * seen.area, seen.power, .006 * double(range))
                << kernel.name << " " << angle << " " << is_two_sided << " " << i;
            if (seen.area > .2 * double(range)) {
              EXPECT_NEAR(gain, seen.power / seen.area, .02) << angle << " " << i;
            }
            EXPECT_FLOAT_EQ(lights.colors[1][i], float(gain) / 2);
            EXPECT_EQ(lights.colors[2][i], 0);
          }
        }
      }
    }
  }
}

TEST(SlopeGain, IsNeverNegative) {
  const glm::vec3 mean = {0, 0, .97f};
  Patch patch;
  patch.normal = mean;
  PacketLanes lanes{};
  for (std::size_t i = 0; i < kPacketReceivers; ++i) {
    lanes.x[i] = -20;
    lanes.z[i] = float(i) - 6;
  }
  PacketLights lights;
  for (auto& color : lights.colors) color.fill(1);
  fastestPacketKernel().seeSlope(lanes, kPacketReceivers, patch,
                                 {glm::vec3(2), {2, 2, 2}, {0, 0, 0}}, normalRange(mean), lights);
  EXPECT_EQ(lights.colors[0][0], 0);
  for (const float light : lights.colors[0]) EXPECT_GE(light, 0);
  for (const float light : lights.colors[2]) EXPECT_EQ(light, 1);
}

}  // namespace
}  // namespace surfeit
