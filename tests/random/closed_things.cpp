#include "random/closed_things.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <random>

namespace surfeit {
namespace {

Surfel diskAt(const glm::vec3& position, const glm::vec3& normal, float area, float radiosity) {
  Surfel surfel;
  surfel.position = position;
  surfel.normal = normal;
  surfel.area = area;
  surfel.radius = std::sqrt(area / 2);
  surfel.radiosity = glm::vec3(radiosity);
  return surfel;
}

}  // namespace

void addBall(std::vector<Surfel>& cloud, int count, const glm::vec3& centre, float radius,
             float radiosity, float side, float scatter) {
  constexpr double kPiExact = 3.14159265358979323846;
  std::mt19937 random(7);
  std::uniform_real_distribution<float> uniform(-1, 1);
  const float area = float(4 * kPiExact) * radius * radius / float(count);
  const float spacing = std::sqrt(area);
  for (int i = 0; i < count; ++i) {
    const float z = 1 - (2 * float(i) + 1) / float(count), across = std::sqrt(1 - z * z);
    const double angle = std::fmod(i * kPiExact * (3 - std::sqrt(5.)), 2 * kPiExact);
    const glm::vec3 off(uniform(random), uniform(random), uniform(random));
    const glm::vec3 even(across * float(std::cos(angle)), across * float(std::sin(angle)), z);
    const glm::vec3 at = glm::normalize(even + scatter * spacing / radius * off);
    cloud.push_back(diskAt(centre + radius * at, side * at, area, radiosity));
  }
}

void addSheet(std::vector<Surfel>& cloud, int count, const glm::vec3& corner, const glm::vec3& u,
              const glm::vec3& v, float radiosity) {
  std::mt19937 random(9);
  std::uniform_real_distribution<float> uniform(-1, 1);
  const float width = glm::length(u), height = glm::length(v);
  const int columns = std::max(1, int(std::lround(std::sqrt(float(count) * width / height))));
  const int rows = std::max(1, int(std::lround(float(count) / float(columns))));
  const glm::vec3 normal = glm::normalize(glm::cross(u, v));
  const float area = width * height / float(columns * rows);
  for (int i = 0; i < columns * rows; ++i) {
    const float x = (float(i % columns) + .5f + kScatter * uniform(random)) / float(columns);
    const float y = (float(i / columns) + .5f + kScatter * uniform(random)) / float(rows);
    cloud.push_back(diskAt(corner + x * u + y * v, normal, area, radiosity));
  }
}

void addBox(std::vector<Surfel>& cloud, int count, const glm::vec3& centre, float side) {
  for (int axis = 0; axis < 3; ++axis) {
    for (const float sign : {-1.f, 1.f}) {
      glm::vec3 n(0), u(0), v(0);
      n[axis] = side / 2 * sign;
      u[(axis + 1) % 3] = side;
      v[(axis + 2) % 3] = side * sign;
      addSheet(cloud, count / 6, centre + n - .5f * u - .5f * v, u, v);
    }
  }
}

glm::mat3 slanted() {
  const glm::vec3 x = glm::normalize(glm::vec3(2, 1, -1)), y0(0.3f, 1, 0.7f);
  const glm::vec3 z = glm::normalize(glm::cross(x, y0));
  return {x, glm::cross(z, x), z};
}

std::vector<Surfel> hiddenLamp() {
  std::vector<Surfel> lamp;
  addSheet(lamp, 2000, {-.4f, -.4f, -3}, {.8f, 0, 0}, {0, .8f, 0}, 1);
  return lamp;
}

std::vector<LocalReceiver> receiversBehind() {
  std::vector<LocalReceiver> receivers;
  for (int i = 0; i < 25; ++i) {
    const glm::vec3 at(.1f * float(i % 5 - 2), .1f * float(i / 5 - 2), 3);
    receivers.push_back({at, glm::normalize(glm::vec3(.02f * float(i % 3), .01f, -1))});
  }
  return receivers;
}

}  // namespace surfeit
