// Leaves anywhere in a volume, facing anywhere, hide each other at random, however finely they are
// drawn.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <vector>

#include "random/indexed_scene.h"
#include "random/random_numbers.h"
#include "surfeit/gather.h"

namespace surfeit {
namespace {

// Two-sided disks in a ball or a cube of radius 1. Their mean shadows cover so many times what it
// shows along an axis.
struct Volume {
  bool is_ball;
  int disks;
  double depth;
  bool has_spheres = false;
};

glm::vec3 direction(RandomNumbers& random) {
  const double z = random.between(-1, 1), angle = random.between(0, 6.283185307),
               across = std::sqrt(1 - z * z);
  return {float(across * std::cos(angle)), float(across * std::sin(angle)), float(z)};
}

std::vector<Surfel> disksOf(const Volume& volume, RandomNumbers& random) {
  std::vector<Surfel> disks(std::size_t(volume.disks), Surfel{});
  const auto place = [&] { return float(random.between(-1, 1)); };
  for (Surfel& disk : disks) {
    do disk.position = {place(), place(), place()};
    while (volume.is_ball && glm::length(disk.position) > 1);
    disk.normal = direction(random);
    disk.area = float(volume.depth * 2 * (volume.is_ball ? 3.14159265 : 4) / volume.disks);
    disk.radius = std::sqrt(disk.area / 3.14159265f);
    disk.flags = kSurfelTwoSided;
    if (volume.has_spheres) {
      // Half of the mean shadow of a two-sided disk is that of a sphere
      disk.area /= 2;
      disk.radius = std::sqrt(disk.area / 3.14159265f);
      disk.normal = glm::vec3(0);
      disk.flags = kSurfelSphere;
    }
  }
  return disks;
}

bool isHit(const std::vector<Surfel>& disks, const glm::vec3& eye, const glm::vec3& ray) {
  for (const Surfel& disk : disks) {
    if (disk.isSphere()) {
      const glm::vec3 to = disk.position - eye;
      const float along = glm::dot(to, ray);
      if (along > 0 && glm::dot(to, to) - along * along < disk.radius * disk.radius) return true;
      continue;
    }
    const float along = glm::dot(disk.position - eye, disk.normal) / glm::dot(ray, disk.normal);
    const glm::vec3 offset = eye + along * ray - disk.position;
    if (along > 0 && glm::dot(offset, offset) < disk.radius * disk.radius) return true;
  }
  return false;
}

// The part of evenly spread cosine directions that meet disks, by rays within a cone that holds
// them.
double trueOcclusion(const std::vector<Surfel>& disks, const LocalReceiver& receiver,
                     RandomNumbers& random) {
  constexpr int kRays = 1500;
  const double part = 4 / double(glm::dot(receiver.position, receiver.position));
  const glm::vec3 n = receiver.normal;
  const glm::vec3 u =
      glm::normalize(glm::cross(n, std::abs(n.x) < .5f ? glm::vec3(1, 0, 0) : glm::vec3(0, 1, 0)));
  const glm::vec3 v = glm::cross(n, u);
  int hits = 0;
  for (int i = 0; i < kRays; ++i) {
    const double square = part * random.between(0, 1), angle = random.between(0, 6.283185307);
    const auto across = float(std::sqrt(square)), forward = float(std::sqrt(1 - square));
    const glm::vec3 ray = across * (float(std::cos(angle)) * u + float(std::sin(angle)) * v);
    hits += isHit(disks, receiver.position, ray + forward * n);
  }
  return part * hits / kRays;
}

void expectRandomHiding(bool has_spheres) {
  RandomNumbers random(5);
  for (const bool is_ball : {true, false}) {
    for (const int count : {60, 400, 3000}) {
      for (const double depth : {.5, 1.5}) {
        const std::vector<Surfel> disks = disksOf({is_ball, count, depth, has_spheres}, random);
        const auto scene = IndexedScene::make(disks);
        ASSERT_TRUE(scene.ok()) << scene.status().message();
        std::vector<LocalReceiver> receivers;
        double truth = 0;
        for (int i = 0; i < 24; ++i) {
          const glm::vec3 from = direction(random);
          receivers.push_back({(i % 2 == 0 ? 3.f : 6.f) * from, -from});
          truth += trueOcclusion(disks, receivers.back(), random);
        }
        GatherQuality exact;
        exact.max_solid_angle = 0;
        double found[2] = {};
        for (const bool is_exact : {false, true}) {
          const auto results = (*scene)->gatherAlone(
              receivers, {GatherMode::kOcclusion, is_exact ? exact : GatherQuality()});
          ASSERT_TRUE(results.ok()) << results.status().message();
          for (const GatherResult& one : *results) found[is_exact] += double(one.occlusion);
        }
        std::printf("%s, %4d pieces, %.1f deep: %.3f, exact %.3f of the truth\n",
                    is_ball ? "ball" : "cube", count, depth, found[0] / truth, found[1] / truth);
        // The goal is .03. Disks of leaves with a few facets are still taken to lie side by side,
        // as those of a folded cloth do; with all so, it is up to 1.20
        EXPECT_NEAR(found[0] / truth, 1, .1);
        EXPECT_NEAR(found[1] / truth, 1, .14);
      }
    }
  }
}

TEST(Volumes, LeavesHideEachOtherAtRandom) { expectRandomHiding(false); }

TEST(Volumes, ParticlesHideEachOtherAtRandom) { expectRandomHiding(true); }

}  // namespace
}  // namespace surfeit
