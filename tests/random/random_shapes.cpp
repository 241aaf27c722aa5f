#include "random/random_shapes.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>
#include <iterator>
#include <utility>

namespace surfeit {
namespace {

constexpr double kTurn = 6.283185307179586;

glm::dvec3 anyAcross(const glm::dvec3& axis, RandomNumbers& random) {
  glm::dvec3 across;
  do {
    across = glm::cross(axis, random.direction());
  } while (glm::dot(across, across) < .01);
  return glm::normalize(across);
}

// The parallelogram from `corner` along two edges; its front is on the side of a x b.
ShapePatch parallelogram(const glm::dvec3& corner, const glm::dvec3& a, const glm::dvec3& b) {
  ShapePatch patch;
  patch.at = [=](double u, double v) { return corner + u * a + v * b; };
  patch.length_u = glm::length(a);
  patch.length_v = glm::length(b);
  return patch;
}

// A rectangle of half sizes a and b around a place of a frame, facing its z, or against it.
ShapePatch level(const ShapeFrame& frame, double a, double b, double height, bool faces_up = true) {
  const glm::dvec3 u = 2 * a * frame.x, v = 2 * b * frame.y, corner = frame.at(-a, -b, height);
  return faces_up ? parallelogram(corner, u, v) : parallelogram(corner, v, u);
}

// The six faces of a box from one corner of it, numbered -x +x -y +y -z +z; `skips` is a set of
// those that are left out.
void addBox(const ShapeFrame& frame, const glm::dvec3& low, const glm::dvec3& high, bool inward,
            unsigned skips, Shape& shape) {
  const glm::dvec3 axes[] = {frame.x, frame.y, frame.z};
  for (int face = 0; face < 6; ++face) {
    if ((skips >> face & 1) != 0) continue;
    const int axis = face / 2;
    const bool is_high = face % 2 == 1;
    glm::dvec3 corner = low;
    if (is_high) corner[axis] = high[axis];
    const int next = (axis + 1) % 3, after = (axis + 2) % 3;
    const glm::dvec3 a = (high[next] - low[next]) * axes[next];
    const glm::dvec3 b = (high[after] - low[after]) * axes[after];
    ShapePatch patch = is_high != inward ? parallelogram(frame.at(corner), a, b)
                                         : parallelogram(frame.at(corner), b, a);
    patch.is_cavity = inward;
    shape.patches.push_back(std::move(patch));
  }
}

// The sphere as six faces of a cube, or the part of it with z above `least_z`.
void addSphere(const glm::dvec3& centre, double radius, bool inward, Shape& shape) {
  for (int face = 0; face < 6; ++face) {
    const int axis = face / 2;
    const double sign = face % 2 == 0 ? -1 : 1;
    ShapePatch patch;
    const bool swaps = (sign > 0) == inward;
    patch.at = [=](double u, double v) {
      if (swaps) std::swap(u, v);
      glm::dvec3 p;
      p[axis] = sign;
      p[(axis + 1) % 3] = std::tan((2 * u - 1) * kTurn / 8);
      p[(axis + 2) % 3] = std::tan((2 * v - 1) * kTurn / 8);
      return centre + radius * glm::normalize(p);
    };
    patch.length_u = patch.length_v = radius * kTurn / 4.4;
    patch.is_flat = false;
    patch.is_cavity = inward;
    shape.patches.push_back(std::move(patch));
  }
}

void addTube(const ShapeFrame& frame, double radius, double length, bool inward, Shape& shape) {
  ShapePatch patch;
  patch.at = [=](double u, double v) {
    const double turn = inward ? -kTurn * u : kTurn * u;
    return frame.at(radius * std::cos(turn), radius * std::sin(turn), length * v);
  };
  patch.length_u = kTurn * radius;
  patch.length_v = length;
  patch.is_flat = false;
  patch.is_cavity = inward;
  shape.patches.push_back(std::move(patch));
}

// Waves of several lengths over the plane.
struct Waves {
  double x[5], y[5], phase[5], height[5];

  Waves(double amplitude, double longest, RandomNumbers& random) {
    for (int i = 0; i < 5; ++i) {
      const double turn = random.between(0, kTurn), length = longest * std::pow(.6, i);
      x[i] = kTurn / length * std::cos(turn);
      y[i] = kTurn / length * std::sin(turn);
      phase[i] = random.between(0, kTurn);
      height[i] = amplitude * std::pow(.55, i);
    }
  }
  double at(double a, double b) const {
    double sum = 0;
    for (int i = 0; i < 5; ++i) sum += height[i] * std::sin(x[i] * a + y[i] * b + phase[i]);
    return sum;
  }
};

ShapePatch wavySheet(const ShapeFrame& frame, double size, double amplitude,
                     RandomNumbers& random) {
  const double longest = size * random.between(.5, 2);
  const Waves waves(amplitude, longest, random);
  ShapePatch patch;
  patch.at = [=](double u, double v) {
    const double a = (2 * u - 1) * size, b = (2 * v - 1) * size;
    return frame.at(a, b, waves.at(a, b));
  };
  patch.length_u = patch.length_v = 2 * size;
  patch.is_flat = false;
  return patch;
}

void makeSheet(const ShapePlace& place, RandomNumbers& random, Shape& shape) {
  const double a = place.size, b = a * random.logBetween(.3, 1);
  const bool faces_up = random.chance(.7);
  shape.patches.push_back(level(place.frame, a, b, 0, faces_up));
}

void makeGradedSheet(const ShapePlace& place, RandomNumbers& random, Shape& shape) {
  makeSheet(place, random, shape);
  shape.patches[0].grading = random.logBetween(5, 1000);
}

void makeTerrain(const ShapePlace& place, RandomNumbers& random, Shape& shape) {
  const double steepness = random.logBetween(.02, .3);
  shape.patches.push_back(wavySheet(place.frame, place.size, steepness * place.size, random));
}

void makeCloth(const ShapePlace& place, RandomNumbers& random, Shape& shape) {
  const ShapeFrame frame = anyFrame(place.frame.origin, random);
  const double steepness = random.logBetween(.05, .4);
  shape.patches.push_back(wavySheet(frame, place.size, steepness * place.size, random));
  shape.patches[0].always_two_sided = true;
}

void makeFloors(const ShapePlace& place, RandomNumbers& random, Shape& shape) {
  const int count = random.intBetween(2, 8);
  const double step = place.size * random.logBetween(.02, .8);
  const bool are_slabs = random.chance(.5);
  const double thickness = step * random.logBetween(.02, .5);
  const double b = place.size * random.between(.4, 1);
  for (int i = 0; i < count; ++i) {
    shape.patches.push_back(level(place.frame, place.size, b, step * i));
    shape.patches.back().is_cavity = i + 1 < count;
    if (!are_slabs) continue;
    shape.patches.push_back(level(place.frame, place.size, b, step * i - thickness, false));
    shape.patches.back().is_cavity = i > 0;
  }
}

// Upright sheets close to each other, one-sided or slabs: louvers, books, a radiator.
void makeSlats(const ShapePlace& place, RandomNumbers& random, Shape& shape) {
  const int count = random.intBetween(4, 20);
  const double step = 2 * place.size / count;
  const double tilt = random.between(-1, 1), depth = step * random.logBetween(.5, 6);
  const ShapeFrame& frame = place.frame;
  const glm::dvec3 along = 2 * place.size * frame.y;
  const glm::dvec3 up = depth * (std::sin(tilt) * frame.x + std::cos(tilt) * frame.z);
  const bool are_slabs = random.chance(.7);
  for (int i = 0; i < count; ++i) {
    const glm::dvec3 corner = frame.at(step * (i + .5) - place.size, -place.size, 0);
    shape.patches.push_back(parallelogram(corner, along, up));
    shape.patches.back().is_cavity = true;
    if (!are_slabs) continue;
    shape.patches.push_back(parallelogram(corner - .1 * step * frame.x, up, along));
    shape.patches.back().is_cavity = true;
  }
}

glm::dvec3 boxHalf(double size, RandomNumbers& random) {
  glm::dvec3 half;
  for (int axis = 0; axis < 3; ++axis) half[axis] = size * random.logBetween(.15, 1);
  return half;
}

void makeBox(const ShapePlace& place, RandomNumbers& random, Shape& shape) {
  const glm::dvec3 half = boxHalf(place.size, random);
  addBox(place.frame, {-half.x, -half.y, 0}, {half.x, half.y, 2 * half.z}, false, 0, shape);
  shape.may_be_two_sided = false;
}

// Open above or at a side, as a single sheet or with walls.
void makeOpenBox(const ShapePlace& place, RandomNumbers& random, Shape& shape) {
  const glm::dvec3 half = boxHalf(place.size, random);
  const glm::dvec3 low(-half.x, -half.y, 0), high(half.x, half.y, 2 * half.z);
  const unsigned open = random.chance(.5) ? 5 : unsigned(random.below(6));
  addBox(place.frame, low, high, true, 1u << open, shape);
  if (random.chance(.4)) {
    for (ShapePatch& patch : shape.patches) patch.always_two_sided = true;
    return;
  }
  const glm::dvec3 wall(place.size * random.logBetween(.003, .1));
  glm::dvec3 outer_low = low - wall, outer_high = high + wall;
  (open % 2 == 0 ? outer_low : outer_high)[open / 2] = (open % 2 == 0 ? low : high)[open / 2];
  addBox(place.frame, outer_low, outer_high, false, 1u << open, shape);
  shape.may_be_two_sided = false;
}

// A closed box around all, seen from inside.
void makeRoom(const ShapePlace& place, RandomNumbers& random, Shape& shape) {
  glm::dvec3 half;
  for (int axis = 0; axis < 3; ++axis) half[axis] = random.between(1.2, 2.5);
  ShapeFrame frame = place.frame;
  frame.origin = glm::dvec3(0);
  const bool lacks_a_wall = random.chance(.3);
  addBox(frame, -half, half, true, lacks_a_wall ? 1u << random.below(6) : 0, shape);
  if (random.chance(.4)) {
    const glm::dvec3 wall(random.logBetween(.01, .2));
    addBox(frame, -half - wall, half + wall, false, 0, shape);
  }
}

void makeBall(const ShapePlace& place, RandomNumbers& random, Shape& shape) {
  const double rise = random.chance(.7) ? place.size : 0;
  addSphere(place.frame.at(0, 0, rise), place.size, false, shape);
  shape.may_be_two_sided = false;
}

void makeHollowBall(const ShapePlace& place, RandomNumbers& random, Shape& shape) {
  const double radius = random.chance(.4) ? random.between(1.5, 2.5) : place.size;
  const glm::dvec3 centre = radius == place.size ? place.frame.at(0, 0, radius) : glm::dvec3(0);
  addSphere(centre, radius, true, shape);
  if (random.chance(.5)) {
    const double wall = random.logBetween(.002, .2);
    addSphere(centre, radius * (1 + wall), false, shape);
  }
}

// One in the other: closed shells between which one sees.
void makeShells(const ShapePlace& place, RandomNumbers& random, Shape& shape) {
  const double gap = random.logBetween(.02, .5);
  const glm::dvec3 centre = place.frame.at(0, 0, place.size);
  addSphere(centre, place.size * (1 - gap), false, shape);
  addSphere(centre, place.size, true, shape);
  for (ShapePatch& patch : shape.patches) patch.is_cavity = true;
  shape.may_be_two_sided = false;
}

void makeTubes(const ShapePlace& place, RandomNumbers& random, Shape& shape) {
  const int count = random.chance(.5) ? 1 : random.intBetween(2, 6);
  const double radius = place.size * random.logBetween(.02, .4);
  const double wall = random.chance(.5) ? random.logBetween(.01, .3) : 0;
  const bool sees_inside = random.chance(.5);
  for (int i = 0; i < count; ++i) {
    ShapeFrame frame = i % 2 == 0 ? place.frame : anyFrame(place.frame.origin, random);
    const double a = random.between(-1, 1), b = random.between(-1, 1);
    frame.origin = frame.at(a * place.size, b * place.size, 0);
    const double length = place.size * random.logBetween(.3, 3);
    addTube(frame, radius, length, sees_inside, shape);
    if (wall > 0)
      addTube(frame, radius * (1 + (sees_inside ? wall : -wall)), length, !sees_inside, shape);
  }
}

// Two sheets back to back, closer than their surfels are wide as a rule, or as wide as wanted.
void makeThinWall(const ShapePlace& place, RandomNumbers& random, Shape& shape) {
  const double spacing = 2 * place.size / std::sqrt(std::max(1, place.surfels / 2));
  const double thickness = spacing * random.logBetween(.01, 2);
  ShapeFrame frame = place.frame;
  std::swap(frame.x, frame.z);  // upright
  frame.y = -frame.y;
  frame.origin = frame.at(place.size, 0, 0);
  shape.patches.push_back(level(frame, place.size, place.size, thickness / 2));
  shape.patches.push_back(level(frame, place.size, place.size, -thickness / 2, false));
  shape.patches.back().density = random.chance(.5) ? 1 : random.logBetween(.02, 1);
}

void makeStairs(const ShapePlace& place, RandomNumbers& random, Shape& shape) {
  const int count = random.intBetween(3, 12);
  const double depth = 2 * place.size / count, rise = depth * random.logBetween(.3, 2);
  const ShapeFrame& frame = place.frame;
  const glm::dvec3 across = 2 * place.size * frame.y;
  for (int i = 0; i < count; ++i) {
    const glm::dvec3 foot = frame.at(depth * i - place.size, -place.size, rise * i);
    shape.patches.push_back(parallelogram(foot, rise * frame.z, across));  // faces the foot
    shape.patches.push_back(parallelogram(foot + rise * frame.z, depth * frame.x, across));
  }
}

// Boxes in rows, as the blocks of a city.
void makeBlocks(const ShapePlace& place, RandomNumbers& random, Shape& shape) {
  const int side = random.intBetween(2, 6);
  const double step = 2 * place.size / side, part = random.between(.3, .9);
  const double highest = place.size * random.logBetween(.1, 2);
  for (int i = 0; i < side * side; ++i) {
    const double x = step * (i % side + .5) - place.size, y = step * (i / side + .5) - place.size;
    const double height = highest * random.between(.2, 1), half = step * part / 2;
    addBox(place.frame, {x - half, y - half, 0}, {x + half, y + half, height}, false, 1u << 4,
           shape);
  }
  shape.may_be_two_sided = false;
}

// A flat roof high above whatever is below it, without walls, and a hut on it.
void makeRoof(const ShapePlace& place, RandomNumbers& random, Shape& shape) {
  const double height = place.size * random.logBetween(.02, 3);
  const double hut = place.size * random.logBetween(.05, .4);
  const bool has_lower_side = random.chance(.4);
  shape.patches.push_back(level(place.frame, place.size, place.size, height));
  if (has_lower_side) {
    shape.patches.push_back(
        level(place.frame, place.size, place.size, height - .05 * place.size, false));
  }
  addBox(place.frame, {-hut, -hut, height}, {hut, hut, height + 2 * hut}, false, 1u << 4, shape);
  shape.patches[0].is_cavity = true;
}

// A table that is a single sheet, and a cup on it.
void makeTable(const ShapePlace& place, RandomNumbers& random, Shape& shape) {
  const double height = place.size * random.between(.3, 1.2);
  const double cup = place.size * random.logBetween(.03, .3);
  const double cup_height = 2 * cup * random.between(.5, 2);
  shape.patches.push_back(level(place.frame, place.size, .6 * place.size, height));
  ShapeFrame foot = place.frame;
  foot.origin = foot.at(0, 0, height);
  addTube(foot, cup, cup_height, false, shape);
  addTube(foot, .9 * cup, cup_height, true, shape);
  shape.patches[1].density = shape.patches[2].density = random.logBetween(1, 30);
}

// A hemisphere: a bowl with one sheet, or a dome of two.
void makeBowl(const ShapePlace& place, RandomNumbers& random, Shape& shape) {
  const double sign = random.chance(.5) ? 1 : -1, wall = random.logBetween(.003, .2);
  const bool is_sheet = random.chance(.4);
  const auto half = [&](double radius, bool inward) {
    ShapePatch patch;
    const ShapeFrame frame = place.frame;
    const double size = place.size;
    const bool swaps = inward != (sign < 0);
    patch.at = [=](double u, double v) {
      if (swaps) std::swap(u, v);
      // From the disk, by equal areas
      const double a = 2 * u - 1, b = 2 * v - 1;
      const bool is_wide = std::abs(a) > std::abs(b);
      const double r = is_wide ? a : b, ratio = r == 0 ? 0 : (is_wide ? b : a) / r;
      const double along = std::cos(kTurn / 8 * ratio), across = std::sin(kTurn / 8 * ratio);
      const double out = radius * r * std::sqrt(std::max(0.0, 2 - r * r));
      const double up = sign * radius * (1 - r * r);
      return frame.at(out * (is_wide ? along : across), out * (is_wide ? across : along),
                      up + (sign < 0 ? size : 0));
    };
    patch.length_u = patch.length_v = 2.5 * radius;
    patch.is_flat = false;
    patch.is_cavity = inward;
    patch.always_two_sided = is_sheet;
    return patch;
  };
  shape.patches.push_back(half(place.size, false));
  if (!is_sheet) shape.patches.push_back(half(place.size * (1 - wall), true));
}

void makeFoliage(const ShapePlace& place, RandomNumbers& random, Shape& shape) {
  const double density = random.logBetween(.3, 4);  // leaves on a way through the middle
  const double leaf = std::sqrt(density * 2 * place.size * place.size / place.surfels);
  const glm::dvec3 centre = place.frame.at(0, 0, place.size);
  const double aspect = random.logBetween(1, 2.5);
  for (int i = 0; i < place.surfels; ++i) {
    ShapeLeaf& one = shape.leaves.emplace_back();
    one.middle = centre + place.size * random.inBall();
    const glm::dvec3 u = random.direction(), v = anyAcross(u, random);
    one.half_u = leaf * std::sqrt(aspect) * u;
    one.half_v = leaf / std::sqrt(aspect) * v;
  }
}

void makeRibbons(const ShapePlace& place, RandomNumbers& random, Shape& shape) {
  const int segments = random.intBetween(4, 16), strands = std::max(1, place.surfels / segments);
  const double length = place.size * random.logBetween(.2, 1.5);
  const double width = length * random.logBetween(.004, .04);
  const bool on_ball = random.chance(.5);
  const double curl = random.between(0, 1);
  for (int i = 0; i < strands; ++i) {
    glm::dvec3 root = .5 * place.size * random.direction(), along = glm::normalize(root);
    if (!on_ball) {
      root = glm::dvec3(random.between(-1, 1), 0, 0);
      root.y = random.between(-1, 1);
      root *= place.size;
      along = {0, 0, 1};
    }
    glm::dvec3 place_of = place.frame.at(root);
    glm::dvec3 direction =
        along.x * place.frame.x + along.y * place.frame.y + along.z * place.frame.z;
    const glm::dvec3 bend = curl * random.direction();
    for (int j = 0; j < segments; ++j) {
      direction = glm::normalize(direction + bend / double(segments));
      const glm::dvec3 step = length / segments * direction;
      glm::dvec3 across = glm::cross(direction, bend + glm::dvec3(.01, .02, .003));
      across = glm::normalize(across);
      shape.leaves.push_back({place_of + .5 * step, .5 * step, .5 * width * across, true});
      place_of += step;
    }
  }
}

void makePoints(const ShapePlace& place, RandomNumbers& random, Shape& shape) {
  const bool fills = random.chance(.6);
  const double cover = random.logBetween(.2, 3);
  const glm::dvec3 centre = place.frame.at(0, 0, place.size);
  const double radius =
      std::sqrt((fills ? 1 : 4) * cover * place.size * place.size / place.surfels);
  for (int i = 0; i < place.surfels; ++i) {
    const glm::dvec3 offset = fills ? random.inBall() : random.direction();
    shape.points.push_back({centre + place.size * offset, radius * random.between(.6, 1.2)});
  }
}

void makeLight(const ShapePlace& place, RandomNumbers& random, Shape& shape) {
  const double size = place.size * random.logBetween(.02, .2);
  ShapeFrame frame = place.frame;
  frame.origin = frame.at(0, 0, random.between(.2, 1.5));
  const double aspect = random.between(.3, 1);
  shape.patches.push_back(level(frame, size, size * aspect, 0, random.chance(.3)));
  shape.is_light = true;
}

struct Kind {
  const char* name;
  void (*make)(const ShapePlace&, RandomNumbers&, Shape&);
  bool is_ground = false, is_solid = false;
};

constexpr Kind kKinds[] = {
    {"sheet", makeSheet, true},
    {"graded sheet", makeGradedSheet, true},
    {"terrain", makeTerrain, true},
    {"floors", makeFloors, true},
    {"room", makeRoom, true},
    {"hollow ball", makeHollowBall, false},
    {"sheet", makeSheet, false},  // twice, as in most scenes
    {"cloth", makeCloth, false},
    {"slats", makeSlats, false},
    {"box", makeBox, false, true},
    {"open box", makeOpenBox, false, true},
    {"ball", makeBall, false, true},
    {"shells", makeShells, false, true},
    {"tubes", makeTubes, false},
    {"thin wall", makeThinWall, false, true},
    {"stairs", makeStairs, false, true},
    {"blocks", makeBlocks, false, true},
    {"roof with hut", makeRoof, false, true},
    {"table with cup", makeTable, false, true},
    {"bowl", makeBowl, false},
    {"foliage", makeFoliage, false, true},
    {"ribbons", makeRibbons, false},
    {"points", makePoints, false},
    {"light", makeLight, false},
};

}  // namespace

ShapeFrame anyFrame(const glm::dvec3& origin, RandomNumbers& random) {
  ShapeFrame frame;
  frame.origin = origin;
  frame.z = random.direction();
  frame.x = anyAcross(frame.z, random);
  frame.y = glm::cross(frame.z, frame.x);
  return frame;
}

ShapeFrame uprightFrame(const glm::dvec3& origin, RandomNumbers& random) {
  ShapeFrame frame;
  frame.origin = origin;
  const double turn = random.chance(.5) ? 0 : random.between(0, kTurn);
  frame.x = {std::cos(turn), std::sin(turn), 0};
  frame.y = {-std::sin(turn), std::cos(turn), 0};
  return frame;
}

int shapeKindCount() { return int(std::size(kKinds)); }

const char* shapeKindName(int kind) { return kKinds[kind].name; }

bool isGroundKind(int kind) { return kKinds[kind].is_ground; }

bool isSolidKind(int kind) { return kKinds[kind].is_solid; }

Shape makeShape(int kind, const ShapePlace& place, RandomNumbers& random) {
  Shape shape;
  shape.name = kKinds[kind].name;
  kKinds[kind].make(place, random, shape);
  return shape;
}

}  // namespace surfeit
