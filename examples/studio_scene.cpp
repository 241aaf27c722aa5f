// Writes an open demo scene: a knot, a teapot and a bumpy ball on a floor (studio.obj), and apart
// from it three lamps of different shapes (lamp_panel.obj, lamp_ball.obj, lamp_ring.obj).
//
//   studio_scene DIR
//   surfeit sample DIR/studio.obj -o studio.ply --light-directional "1 -2 -1  3 3 3"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <string>

#include "scene_text.h"

namespace {

constexpr float kPi = 3.14159265f;

// A smooth curve through the points, t in 0..1 from the first to the last (Catmull and Rom 1974).
template <typename Point, std::size_t kCount>
Point through(const std::array<Point, kCount>& points, float t) {
  const float at = std::clamp(t, 0.0f, 1.0f) * float(kCount - 1);
  const int first = std::min(int(at), int(kCount) - 2);
  const auto point = [&](int i) { return points[std::size_t(std::clamp(i, 0, int(kCount) - 1))]; };
  const Point a = point(first - 1), b = point(first), c = point(first + 1), d = point(first + 2);
  const float s = at - float(first);
  return b +
         0.5f * s *
             ((c - a) + s * ((2.0f * a - 5.0f * b + 4.0f * c - d) + s * (3.0f * (b - c) + d - a)));
}

// A direction of longitude u and latitude v, both in 0..1; the poles are +-y.
glm::vec3 direction(float u, float v) {
  const float longitude = 2 * kPi * u, latitude = kPi * (v - 0.5f);
  return {std::cos(latitude) * std::cos(longitude), std::sin(latitude),
          -std::cos(latitude) * std::sin(longitude)};
}

void addKnot(ObjText& obj, const glm::vec3& centre) {
  const auto curve = [&](float t) {
    const float turn = 2 * kPi * t, from_axis = 0.55f + 0.24f * std::cos(3 * turn);
    return centre + glm::vec3(from_axis * std::cos(2 * turn), 0.34f * std::sin(3 * turn),
                              from_axis * std::sin(2 * turn));
  };
  obj.tube(32, 400, {0, 1, 0}, curve, [](float) { return 0.14f; });
}

void addTeapot(ObjText& obj, const glm::vec3& foot) {
  // Distance from the axis and height: bottom, belly, rim, lid and knob
  constexpr std::array<glm::vec2, 12> kProfile = {{{0, 0},
                                                   {0.40f, 0},
                                                   {0.60f, 0.08f},
                                                   {0.74f, 0.36f},
                                                   {0.68f, 0.62f},
                                                   {0.52f, 0.80f},
                                                   {0.42f, 0.87f},
                                                   {0.26f, 0.95f},
                                                   {0.08f, 1.00f},
                                                   {0.07f, 1.07f},
                                                   {0.11f, 1.14f},
                                                   {0, 1.20f}}};
  obj.surface(96, 160, [&](float u, float v) {
    const glm::vec2 at = through(kProfile, v);
    return foot + glm::vec3(at.x * std::cos(2 * kPi * u), at.y, -at.x * std::sin(2 * kPi * u));
  });

  constexpr std::array<glm::vec3, 5> kSpout = {{{0.62f, 0.30f, 0},
                                                {0.84f, 0.38f, 0},
                                                {0.96f, 0.58f, 0},
                                                {1.05f, 0.78f, 0},
                                                {1.22f, 0.86f, 0}}};
  obj.tube(
      32, 60, {0, 0, 1}, [&](float t) { return foot + through(kSpout, t); },
      [](float t) { return 0.16f - 0.09f * t; });
  constexpr std::array<glm::vec3, 6> kHandle = {{{-0.60f, 0.70f, 0},
                                                 {-0.86f, 0.74f, 0},
                                                 {-1.04f, 0.66f, 0},
                                                 {-1.06f, 0.48f, 0},
                                                 {-0.92f, 0.30f, 0},
                                                 {-0.66f, 0.22f, 0}}};
  obj.tube(
      24, 80, {0, 0, 1}, [&](float t) { return foot + through(kHandle, t); },
      [](float) { return 0.06f; });
}

void addBumpyBall(ObjText& obj, const glm::vec3& centre) {
  obj.surface(240, 160, [&](float u, float v) {
    const glm::vec3 d = direction(u, v);
    const float bumps = std::sin(11 * d.x) * std::sin(11 * d.y) * std::sin(11 * d.z);
    return centre + (0.55f + 0.10f * bumps) * d;
  });
}

std::string studioText() {
  ObjText obj;
  obj.line("# A knot, a teapot and a bumpy ball on a floor; +y up, the floor 7 wide at y = 0.");
  obj.line("# Camera: eye 0 3.4 5.4, looking at 0 0.3 0.1, up 0 1 0, vertical field of view 37.");
  obj.line("mtllib studio.mtl");
  obj.useMaterial("floor");
  obj.quad({-3.5f, 0, 3.5f}, {3.5f, 0, 3.5f}, {3.5f, 0, -3.5f}, {-3.5f, 0, -3.5f});
  obj.useMaterial("clay");
  addKnot(obj, {-1.45f, 0.52f, 0.45f});
  obj.useMaterial("china");
  addTeapot(obj, {0.25f, 0, -0.5f});
  obj.useMaterial("slate");
  addBumpyBall(obj, {1.5f, 0.58f, 0.7f});
  return obj.text();
}

// Faces down and to the front: `columns` x 4 squares in two colors.
std::string lampPanelText() {
  constexpr int kColumns = 6, kRows = 4;
  const glm::vec3 corner(-2.6f, 1.75f, -1.5f), along(1.6f / kColumns, 0, 0);
  const glm::vec3 across(0, 0.8f / kRows, -0.7f / kRows);
  ObjText obj;
  obj.line("mtllib lamps.mtl");
  for (const int color : {0, 1}) {
    obj.useMaterial(color == 0 ? "amber" : "blue");
    for (int row = 0; row < kRows; ++row) {
      for (int column = 0; column < kColumns; ++column) {
        if ((row + column) % 2 != color) continue;
        const glm::vec3 a = corner + float(column) * along + float(row) * across;
        obj.quad(a, a + along, a + along + across, a + across);
      }
    }
  }
  return obj.text();
}

// A ball in eight slices of two colors.
std::string lampBallText() {
  constexpr int kSlices = 8;
  ObjText obj;
  obj.line("mtllib lamps.mtl");
  for (int slice = 0; slice < kSlices; ++slice) {
    obj.useMaterial(slice % 2 == 0 ? "white" : "red");
    obj.surface(12, 48, [&](float u, float v) {
      return glm::vec3(0.5f, 2.0f, -1.9f) + 0.4f * direction((float(slice) + u) / kSlices, v);
    });
  }
  return obj.text();
}

std::string lampRingText() {
  ObjText obj;
  obj.line("mtllib lamps.mtl");
  obj.useMaterial("green");
  const auto curve = [](float t) {
    return glm::vec3(2.2f, 1.9f, -1.2f) +
           0.5f * glm::vec3(std::cos(2 * kPi * t), std::sin(2 * kPi * t), 0);
  };
  obj.tube(24, 96, {0, 0, 1}, curve, [](float) { return 0.1f; });
  return obj.text();
}

constexpr const char* kStudioMaterials = R"(newmtl floor
Kd 0.7 0.7 0.7

newmtl clay
Kd 0.75 0.26 0.12

newmtl china
Kd 0.75 0.74 0.70

newmtl slate
Kd 0.22 0.38 0.65
)";

// They reflect nothing, so that in pictures they show their own colors alone
constexpr const char* kLampMaterials = R"(newmtl amber
Kd 0 0 0
Ke 18 10.5 2.2

newmtl blue
Kd 0 0 0
Ke 2.2 7 20

newmtl white
Kd 0 0 0
Ke 16 16 16

newmtl red
Kd 0 0 0
Ke 18 1.6 1.6

newmtl green
Kd 0 0 0
Ke 1.5 7 2
)";

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    fmt::print(stderr, "usage: studio_scene DIR\n");
    return 2;
  }
  const std::string directory = std::string(argv[1]) + "/";
  const bool ok = writeFile(directory + "studio.mtl", kStudioMaterials) &&
                  writeFile(directory + "studio.obj", studioText()) &&
                  writeFile(directory + "lamps.mtl", kLampMaterials) &&
                  writeFile(directory + "lamp_panel.obj", lampPanelText()) &&
                  writeFile(directory + "lamp_ball.obj", lampBallText()) &&
                  writeFile(directory + "lamp_ring.obj", lampRingText());
  return ok ? 0 : 1;
}
