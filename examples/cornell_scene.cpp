// Writes a demo scene, cornell.obj and cornell.mtl: a box with a red and a green wall, a light
// below the ceiling, a sphere on the floor and one on a small box.
//
//   cornell_scene DIR
//   surfeit sample DIR/cornell.obj -o cornell.ply --count 1000000

#include <fmt/format.h>

#include <cstdio>
#include <string>

#include "scene_text.h"

namespace {

std::string sceneText() {
  ObjText obj;
  obj.line("# Cornell box with two spheres; units: the box is 1 wide, +y up, open towards +z.");
  obj.line("# Camera: eye 0.5 0.5 2.4, looking at 0.5 0.5 0, up 0 1 0, vertical field of view 37.");
  obj.line("mtllib cornell.mtl");

  // Walls face inwards
  obj.useMaterial("white");
  obj.quad({0, 0, 1}, {1, 0, 1}, {1, 0, 0}, {0, 0, 0});  // floor
  obj.quad({0, 1, 0}, {1, 1, 0}, {1, 1, 1}, {0, 1, 1});  // ceiling
  obj.quad({0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0});  // back
  obj.useMaterial("red");
  obj.quad({0, 0, 1}, {0, 0, 0}, {0, 1, 0}, {0, 1, 1});  // left
  obj.useMaterial("green");
  obj.quad({1, 0, 0}, {1, 0, 1}, {1, 1, 1}, {1, 1, 0});  // right
  obj.useMaterial("light");
  obj.quad({0.35f, 0.98f, 0.35f}, {0.65f, 0.98f, 0.35f}, {0.65f, 0.98f, 0.65f},
           {0.35f, 0.98f, 0.65f});  // faces down

  // 20,480 triangles each: facets far smaller than a pixel of a usual picture
  constexpr int kSphereLevels = 5;
  obj.useMaterial("white");
  obj.boxWithoutBottom({0.14f, 0, 0.16f}, {0.46f, 0.3f, 0.48f});
  obj.sphere({0.3f, 0.46f, 0.32f}, 0.16f, kSphereLevels);  // rests on the box
  obj.useMaterial("blue");
  obj.sphere({0.7f, 0.2f, 0.62f}, 0.2f, kSphereLevels);  // rests on the floor
  return obj.text();
}

constexpr const char* kMaterials = R"(newmtl white
Kd 0.73 0.73 0.73

newmtl red
Kd 0.63 0.065 0.05

newmtl green
Kd 0.14 0.45 0.091

newmtl blue
Kd 0.3 0.35 0.6

newmtl light
Kd 0.5 0.5 0.5
Ke 17 15 12
)";

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    fmt::print(stderr, "usage: cornell_scene DIR\n");
    return 2;
  }
  const std::string directory = argv[1];
  const bool ok = writeFile(directory + "/cornell.mtl", kMaterials) &&
                  writeFile(directory + "/cornell.obj", sceneText());
  return ok ? 0 : 1;
}
