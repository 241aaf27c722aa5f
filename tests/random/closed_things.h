// Clouds of dark disks that hide what is behind them, all of it, and a lamp that they stand before.
// Disks are scattered by a third of their spacing.
#pragma once

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>
#include <vector>

#include "gather/rules/receiver.h"
#include "surfeit/surfel.h"

namespace surfeit {

inline constexpr float kScatter = .33f;  // of the spacing

// `count` disks of a sphere, along a spiral; facing out, or in with side -1.
void addBall(std::vector<Surfel>& cloud, int count, const glm::vec3& centre, float radius,
             float radiosity = 0, float side = 1, float scatter = kScatter);
// About `count` disks of a rectangle with these sides, facing along u x v.
void addSheet(std::vector<Surfel>& cloud, int count, const glm::vec3& corner, const glm::vec3& u,
              const glm::vec3& v, float radiosity = 0);
// About `count` disks of a cube, facing out.
void addBox(std::vector<Surfel>& cloud, int count, const glm::vec3& centre, float side);

// A turn that leaves no axis where it was.
glm::mat3 slanted();

// What stands around the origin, a unit large, hides the lamp from all the receivers.
std::vector<Surfel> hiddenLamp();
std::vector<LocalReceiver> receiversBehind();

}  // namespace surfeit
