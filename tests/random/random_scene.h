// Scenes by chance, for judging the gather where nobody has tuned it: true geometry of ingredients
// that are put together at random (random_shapes.h), surfels sampled on it, and receivers. A seed
// gives the same scene on all machines, but for the last bits of sines and cosines.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <string>
#include <vector>

#include "gather/rules/receiver.h"
#include "surfeit/surfel.h"

namespace surfeit {

// Counter-clockwise seen from the front.
struct RandomTriangle {
  glm::vec3 corners[3];
  bool is_two_sided = false;
  std::uint8_t ingredient = 0;
};

struct RandomSphere {
  glm::vec3 centre{0};
  float radius = 0;
  std::uint8_t ingredient = 0;
};

struct RandomReceiver {
  LocalReceiver receiver;
  const char* place = "";     // "on a surface", "at an edge", "in a cavity", "in the open", ...
  int ingredient = -1;        // that it is on; -1: on none
  float ray_offset = 0;       // how far above it rays on the true geometry begin, scene units
  bool is_on_border = false;  // of a patch: rounding decides what it sees of the next one
};

// Of which a scene can be made without, to see what a failure needs.
struct RandomIngredient {
  std::string text;  // "floors 3 x 1,200 surfels, two-sided, noisy"
  std::size_t surfels = 0;
  bool is_surface = true;  // not leaves, hair or points, whose sizes places do not tell
  glm::vec3 opacity{1};    // rgb
};

struct RandomScene {
  std::uint64_t seed = 0;
  std::string setting;  // scale, orientation, origin
  float extent = 0;     // about half the width of the scene, scene units
  std::vector<RandomIngredient> ingredients;
  std::vector<Surfel> surfels;
  std::vector<std::uint8_t> surfel_ingredients;  // of each surfel
  std::vector<RandomTriangle> triangles;
  std::vector<RandomSphere> spheres;
  std::vector<RandomReceiver> receivers;

  // Several lines.
  std::string describe() const;
  // Surfels and true geometry of the ingredients in `kept`, a set; receivers stay where they are.
  // Numbers of ingredients stay as well.
  RandomScene only(std::uint64_t kept) const;
  // Without leaves, hair and points.
  RandomScene onlySurfaces() const;
  // The same of surfels whose radii, or areas too, are not known.
  RandomScene withoutSizes(bool keeps_areas) const;
  // The same with some ingredients, at least one, translucent, a quarter of these tinted.
  RandomScene withOpacities() const;
  std::vector<LocalReceiver> plainReceivers() const;
};

inline constexpr int kMostIngredients = 8;

struct RandomSampling {
  double density = 1;          // times as many surfels of the same surfaces
  bool without_noise = false;  // positions and normals are those of the surfaces
};

// From 500 to 30,000 surfels, times the density, and 32 to 96 receivers.
RandomScene makeRandomScene(std::uint64_t seed, const RandomSampling& sampling = {});

}  // namespace surfeit
