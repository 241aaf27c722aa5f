// The ingredients of random scenes as surfaces: sheets, floors, boxes, shells, tubes, leaves, hair,
// terrain, points. A shape is true geometry; random_scene.h puts surfels on it.
#pragma once

#include <functional>
#include <glm/vec3.hpp>
#include <string>
#include <vector>

#include "random/random_numbers.h"

namespace surfeit {

// A place, and three axes at right angles, unit.
struct ShapeFrame {
  glm::dvec3 origin{0}, x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1};

  glm::dvec3 at(double a, double b, double c) const { return origin + a * x + b * y + c * z; }
  glm::dvec3 at(const glm::dvec3& p) const { return at(p.x, p.y, p.z); }
};

// Any orientation, and one about z only.
ShapeFrame anyFrame(const glm::dvec3& origin, RandomNumbers& random);
ShapeFrame uprightFrame(const glm::dvec3& origin, RandomNumbers& random);

// A piece of surface over (u, v) in 0..1, its front where u turns to v counter-clockwise.
struct ShapePatch {
  std::function<glm::dvec3(double, double)> at;
  double length_u = 0, length_v = 0;  // about
  bool is_flat = true;                // a parallelogram
  bool is_cavity = false;             // something faces its front closely
  double density = 1;                 // surfels per area, relative to the shape's others
  double grading = 1;                 // area of the last surfel, at u = v = 1, over the first's
  bool always_two_sided = false;
};

// Parallelograms that are a surfel each, seen from both sides.
struct ShapeLeaf {
  glm::dvec3 middle{0}, half_u{0}, half_v{0};
  bool is_ribbon = false;  // its longer side, u, is known
};

// Spheres without normals.
struct ShapePoint {
  glm::dvec3 middle{0};
  double radius = 0;
};

struct Shape {
  std::string name;
  std::vector<ShapePatch> patches;
  std::vector<ShapeLeaf> leaves;
  std::vector<ShapePoint> points;
  bool is_light = false;  // small and bright
  bool may_be_two_sided = true;
};

// What a shape is made for.
struct ShapePlace {
  ShapeFrame frame;    // z is up where it stands on something; the origin is then its foot
  double size = 1;     // about its radius
  int surfels = 1000;  // about so many are wanted
};

// How many kinds there are, their names, whether others may stand on them, and whether they may
// stand on others.
int shapeKindCount();
const char* shapeKindName(int kind);
bool isGroundKind(int kind);
bool isSolidKind(int kind);
Shape makeShape(int kind, const ShapePlace& place, RandomNumbers& random);

}  // namespace surfeit
