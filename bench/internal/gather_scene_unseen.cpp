// Scenes that nothing was chosen by: rooms with thin furniture, terraces, trees, grass, pipes,
// things of all sizes.
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>

#include "bench/internal/gather_scene_geometry.h"

namespace surfeit {
namespace {

constexpr double kTwoPi = 6.283185307179586;

// A parallelogram from `corner` along u and v; the front is where u turns to v.
void appendQuad(const glm::dvec3& corner, const glm::dvec3& u, const glm::dvec3& v, Mesh& mesh) {
  appendGrid(
      1, 1, [&](double s, double t) { return glm::vec3(corner + s * u + t * v); }, 0, mesh);
}

// Fronts outside, or inside for a room.
void appendBox(const glm::dvec3& low, const glm::dvec3& high, bool is_room, Mesh& mesh) {
  const glm::dvec3 size = high - low;
  for (int axis = 0; axis < 3; ++axis) {
    glm::dvec3 u(0), v(0), across(0);
    u[(axis + 1) % 3] = size[(axis + 1) % 3];
    v[(axis + 2) % 3] = size[(axis + 2) % 3];
    across[axis] = size[axis];
    if (is_room) std::swap(u, v);
    appendQuad(low, v, u, mesh);
    appendQuad(low + across, u, v, mesh);
  }
}

// A tube without ends, fronts outside.
void appendTube(const glm::dvec3& from, const glm::dvec3& to, double radius, Mesh& mesh) {
  const glm::dvec3 axis = glm::normalize(to - from);
  const glm::dvec3 other = std::abs(axis.z) < 0.9 ? glm::dvec3(0, 0, 1) : glm::dvec3(1, 0, 0);
  const glm::dvec3 x = glm::normalize(glm::cross(axis, other)), y = glm::cross(axis, x);
  const auto corner = [&](double u, double v) {
    const double angle = kTwoPi * u;
    return glm::vec3(from + v * (to - from) + radius * (std::cos(angle) * x + std::sin(angle) * y));
  };
  appendGrid(32, 8, corner, 0, mesh);
}

double hillsAt(double x, double y) {
  return 0.35 * std::sin(0.9 * x) * std::cos(0.7 * y) + 0.15 * std::sin(2.3 * x + 1.7 * y);
}

void appendHills(double half, Mesh& mesh) {
  const auto corner = [&](double u, double v) {
    const double x = half * (2 * u - 1), y = half * (2 * v - 1);
    return glm::vec3(glm::dvec3(x, y, hillsAt(x, y)));
  };
  appendGrid(160, 160, corner, 0, mesh);
}

glm::dvec3 unitVector(SceneRandom& random) {
  const double z = random.next(-1, 1), angle = random.next(0, kTwoPi);
  const double r = std::sqrt(std::max(0., 1 - z * z));
  return {r * std::cos(angle), r * std::sin(angle), z};
}

void appendTable(const glm::dvec3& at, double length, double width, double height, Mesh& mesh) {
  constexpr double kTop = 0.03, kLeg = 0.05;
  const glm::dvec3 half(length / 2, width / 2, 0);
  appendBox(at - half + glm::dvec3(0, 0, height - kTop), at + half + glm::dvec3(0, 0, height),
            false, mesh);
  for (const double x : {-1., 1.}) {
    for (const double y : {-1., 1.}) {
      const glm::dvec3 leg = at + glm::dvec3(x * (length / 2 - kLeg), y * (width / 2 - kLeg), 0);
      appendBox(leg - glm::dvec3(kLeg / 2, kLeg / 2, 0),
                leg + glm::dvec3(kLeg / 2, kLeg / 2, height - kTop), false, mesh);
    }
  }
}

// A room of 6 by 5 by 3 with tables, chairs, shelves and a screen.
void makeFurniture(Mesh& mesh) {
  SceneRandom random(21);
  appendBox({0, 0, 0}, {6, 5, 3}, true, mesh);
  for (int i = 0; i < 3; ++i) {
    const glm::dvec3 at(1.2 + 1.7 * i, 1.3 + 1.1 * random.next(), 0);
    appendTable(at, 1.2, 0.7, 0.75, mesh);
    for (const double side : {-0.55, 0.55}) {
      const glm::dvec3 chair = at + glm::dvec3(random.next(-.2, .2), side, 0);
      appendTable(chair, 0.4, 0.4, 0.45, mesh);
      const double back = side < 0 ? -0.19 : 0.16;
      appendBox(chair + glm::dvec3(-0.2, back, 0.45), chair + glm::dvec3(0.2, back + 0.03, 0.95),
                false, mesh);
    }
  }
  for (int board = 0; board < 6; ++board) {
    const double z = 0.3 + 0.4 * board;
    appendBox({0.5, 4.6, z}, {3.5, 4.95, z + 0.02}, false, mesh);
  }
  appendBox({4.5, 3.5, 0}, {4.52, 4.8, 1.8}, false, mesh);
}

// Steps of a round amphitheatre, and terraces of a slope.
void makeTerraces(Mesh& mesh) {
  constexpr int kSteps = 14;
  for (int step = 0; step < kSteps; ++step) {
    const double inner = 0.8 + 0.25 * step, outer = inner + 0.25, z = 0.16 * step;
    const auto ring = [&](double u, double radius, double height) {
      return glm::vec3(
          glm::dvec3(radius * std::cos(kTwoPi * u), radius * std::sin(kTwoPi * u), height));
    };
    const auto tread = [&](double u, double v) { return ring(u, outer + v * (inner - outer), z); };
    const auto riser = [&](double u, double v) { return ring(u, inner, z - 0.16 * v); };
    appendGrid(96, 2, tread, 0, mesh);
    if (step > 0) appendGrid(96, 2, riser, 0, mesh);
  }
  const auto floor = [&](double u, double v) {
    return glm::vec3(
        glm::dvec3(0.8 * (1 - v) * std::cos(kTwoPi * u), 0.8 * (1 - v) * std::sin(kTwoPi * u), 0));
  };
  appendGrid(96, 8, floor, 0, mesh);
}

void appendLeafAt(const glm::dvec3& middle, double length, double width, SceneRandom& random,
                  Mesh& mesh) {
  const glm::dvec3 along = unitVector(random);
  const glm::dvec3 across = glm::cross(along, unitVector(random));
  if (glm::dot(across, across) < 1e-4) return;
  const glm::dvec3 u = length * along, v = width * glm::normalize(across);
  appendQuad(middle - 0.5 * u - 0.5 * v, u, v, mesh);
}

// One tree again and again: a trunk, branches and leaves in clumps at their ends.
void makeForest(Mesh& mesh) {
  SceneRandom random(33);
  Mesh tree;
  appendTube({0, 0, 0}, {0, 0, 1.3}, 0.06, tree);
  for (int branch = 0; branch < 24; ++branch) {
    const double angle = kTwoPi * random.next(), z = random.next(0.5, 1.2);
    const glm::dvec3 end(0.5 * std::cos(angle), 0.5 * std::sin(angle), z + random.next(0.1, 0.4));
    appendTube({0, 0, z}, end, 0.015, tree);
    for (int leaf = 0; leaf < 60; ++leaf) {
      appendLeafAt(end + random.next(0.02, 0.22) * unitVector(random), 0.09, 0.05, random, tree);
    }
  }
  appendHills(4, mesh);
  for (int i = 0; i < 36; ++i) {
    const double x = random.next(-3.5, 3.5), y = random.next(-3.5, 3.5);
    const double angle = kTwoPi * random.next(), size = random.next(0.7, 1.2);
    const auto base = std::uint32_t(mesh.position.size());
    for (const glm::vec3& p : tree.position) {
      const double c = size * std::cos(angle), s = size * std::sin(angle);
      mesh.position.emplace_back(glm::dvec3(x + c * double(p.x) - s * double(p.y),
                                            y + s * double(p.x) + c * double(p.y),
                                            hillsAt(x, y) + size * double(p.z)));
    }
    for (const glm::uvec3& t : tree.triangle) mesh.triangle.push_back(t + base);
    mesh.triangle_material.insert(mesh.triangle_material.end(), tree.triangle.size(), 0);
  }
}

// Shrubs: shells of leaves around hollow middles, on hills.
void makeShrubs(Mesh& mesh) {
  SceneRandom random(37);
  appendHills(3, mesh);
  for (int shrub = 0; shrub < 30; ++shrub) {
    const double x = random.next(-2.5, 2.5), y = random.next(-2.5, 2.5), r = random.next(0.2, 0.6);
    const glm::dvec3 middle(x, y, hillsAt(x, y) + 0.7 * r);
    for (int leaf = 0; leaf < 1200; ++leaf) {
      const glm::dvec3 place = middle + r * std::cbrt(random.next(0.3, 1)) * unitVector(random);
      appendLeafAt(place, random.next(0.03, 0.06), random.next(0.02, 0.04), random, mesh);
    }
  }
}

// Blades of four pieces each that bend over.
void makeGrass(Mesh& mesh) {
  SceneRandom random(41);
  appendHills(1, mesh);
  for (int blade = 0; blade < 6000; ++blade) {
    const double x = random.next(-0.95, 0.95), y = random.next(-0.95, 0.95);
    const double angle = kTwoPi * random.next(), height = random.next(0.08, 0.2);
    const double bend = random.next(0.1, 0.8) * height, width = random.next(0.004, 0.009);
    const glm::dvec3 root(x, y, hillsAt(x, y)), lean(std::cos(angle), std::sin(angle), 0);
    const glm::dvec3 side(-lean.y, lean.x, 0);
    const auto corner = [&](double u, double v) {
      const double half = 0.5 * width * (1 - 0.7 * v);
      return glm::vec3(root + glm::dvec3(0, 0, height * v) + bend * v * v * lean +
                       (2 * u - 1) * half * side);
    };
    appendGrid(1, 4, corner, 0, mesh);
  }
}

// Pipes through a hall, some of them close together.
void makePipes(Mesh& mesh) {
  SceneRandom random(43);
  appendBox({-3, -3, 0}, {3, 3, 3}, true, mesh);
  for (int i = 0; i < 60; ++i) {
    const int axis = i % 3;
    glm::dvec3 from(random.next(-2.8, 2.8), random.next(-2.8, 2.8), random.next(0.2, 2.8)),
        to = from;
    from[axis] = axis == 2 ? 0 : -3;
    to[axis] = 3;
    appendTube(from, to, 0.02 * std::exp(random.next(0, 2.3)), mesh);
  }
}

// Boxes and balls from a hundredth of the ground to a quarter of it, many small, few large.
void makeScales(Mesh& mesh) {
  SceneRandom random(47);
  appendQuad({-5, -5, 0}, {10, 0, 0}, {0, 10, 0}, mesh);
  for (int i = 0; i < 700; ++i) {
    const double size = 0.05 / std::pow(1 - 0.999 * random.next(), 0.55);
    const double x = random.next(-4.5, 4.5), y = random.next(-4.5, 4.5);
    if (i % 2 == 0) {
      const glm::dvec3 half(size * random.next(0.3, 1), size * random.next(0.3, 1), 0);
      appendBox(glm::dvec3(x, y, 0) - half, glm::dvec3(x, y, size * random.next(0.5, 3)) + half,
                false, mesh);
    } else {
      appendSphere({glm::vec3(glm::dvec3(x, y, size * random.next(0.7, 2))), float(0.7 * size), 0},
                   size > 0.3 ? 96 : 24, mesh);
    }
  }
}

struct Unseen {
  const char* name;
  void (*make)(Mesh& mesh);
  bool is_two_sided;
  float wavelength;
};
constexpr std::array kUnseen = {
    Unseen{"furniture", makeFurniture, false, 1.5f}, Unseen{"terraces", makeTerraces, false, 2},
    Unseen{"forest", makeForest, true, 1},           Unseen{"shrubs", makeShrubs, true, 1},
    Unseen{"grass", makeGrass, true, 0.3f},          Unseen{"pipes", makePipes, false, 1.5f},
    Unseen{"scales", makeScales, false, 2}};

const Unseen* findUnseen(const std::string& name) {
  for (const Unseen& scene : kUnseen) {
    if (name == scene.name) return &scene;
  }
  return nullptr;
}

}  // namespace

bool isUnseenScene(const std::string& name) { return findUnseen(name) != nullptr; }

SceneGeometry makeUnseenScene(const std::string& name) {
  const Unseen& scene = *findUnseen(name);
  SceneGeometry geometry;
  scene.make(geometry.mesh);
  geometry.exact_triangles = geometry.mesh.triangle.size();
  geometry.is_two_sided = scene.is_two_sided;
  geometry.ray_offset = 1e-4f;
  geometry.color_wavelength = scene.wavelength;
  geometry.surfels = 1'000'000;
  return geometry;
}

}  // namespace surfeit
