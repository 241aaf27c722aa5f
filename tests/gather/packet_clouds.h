// Clouds with spheres of every kind, and packets of receivers on them, for tests of packets.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>
#include <random>
#include <vector>

#include "gather/packet/packet_gatherer.h"
#include "gather/test_scene.h"

namespace surfeit {

using Cloud = std::vector<Surfel>;

inline void addSphere(Cloud& cloud, int count, const glm::vec3& centre, float radius,
                      std::uint32_t flags = 0) {
  const float area = 4 * kPi * radius * radius / float(count);
  for (int i = 0; i < count; ++i) {
    const float z = 1 - float(2 * i + 1) / float(count), phi = float(i) * 2.39996323f;
    const float rho = std::sqrt(1 - z * z);
    const glm::vec3 outward(rho * std::cos(phi), rho * std::sin(phi), z);
    Surfel surfel;
    surfel.position = centre + radius * outward;
    surfel.normal = (flags & kSurfelSphere) != 0 ? glm::vec3(0) : outward;
    surfel.flags = flags;
    surfel.area = area;
    surfel.radius = std::sqrt(2 * area / kPi);
    surfel.radiosity = glm::vec3(.5f) + .4f * glm::sin(9.f * surfel.position);
    cloud.push_back(surfel);
  }
}

inline void addGround(Cloud& cloud, int side, float extent) {
  const float step = extent / float(side);
  for (int i = 0; i < side * side; ++i) {
    Surfel surfel;
    surfel.position = {(float(i % side) + .5f) * step - extent / 2,
                       (float(i / side) + .5f) * step - extent / 2, 0};
    surfel.normal = {0, 0, 1};
    surfel.area = step * step;
    surfel.radius = step;
    surfel.radiosity = glm::vec3(.5f) + .4f * glm::sin(5.f * surfel.position);
    cloud.push_back(surfel);
  }
}

// Spheres of every kind on and above a ground.
inline Cloud spheresOnGround(int ground_side, int sphere_surfels) {
  Cloud cloud;
  addGround(cloud, ground_side, 8);
  std::mt19937 random(3);
  std::uniform_real_distribution<float> uniform(-1, 1);
  for (int i = 0; i < 24; ++i) {
    const float radius = .3f + .2f * uniform(random);
    const std::uint32_t flags = i % 8 == 3   ? std::uint32_t{kSurfelTwoSided}
                                : i % 8 == 5 ? std::uint32_t{kSurfelSphere}
                                             : 0;
    addSphere(cloud, sphere_surfels,
              {3 * uniform(random), 3 * uniform(random), radius + (i % 3) * .6f}, radius, flags);
  }
  return cloud;
}

// The same in a hollow sphere: from the ground, its nodes are long and look large.
inline Cloud enclosedCloud() {
  Cloud cloud = spheresOnGround(80, 600), hollow;
  addSphere(hollow, 2000, {0, 0, 0}, 6);
  for (Surfel& surfel : hollow) {
    surfel.normal = -surfel.normal;
    cloud.push_back(surfel);
  }
  return cloud;
}

inline Cloud mixedCloud() { return spheresOnGround(80, 600); }
// So fine that it would be a waste to open all of it.
inline Cloud fineCloud() { return spheresOnGround(200, 2000); }

inline constexpr std::size_t kRuns = 40;

// Packets of neighbours on the surfaces of the cloud, where few surfels are anywhere else.
inline std::vector<LocalReceiver> neighbours(const Cloud& cloud, std::size_t first) {
  std::vector<LocalReceiver> receivers;
  for (std::size_t i = 0; i < kPacketReceivers; ++i) {
    const Surfel& surfel = cloud[std::min(first + i, cloud.size() - 1)];
    receivers.push_back({surfel.position, surfel.normal});
  }
  return receivers;
}

inline std::vector<GatherResult> gatherPacket(PacketGatherer& gatherer, TestScene& scene,
                                              const std::vector<LocalReceiver>& receivers) {
  std::vector<GatherResult> results(receivers.size());
  const Status status = gatherer.gather(receivers, scene.reader(), results);
  EXPECT_TRUE(status.ok()) << status.message();
  return results;
}

}  // namespace surfeit
