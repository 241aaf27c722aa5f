// Lobes: the part of its light that a surfel, or a flat piece of a node, sends around one direction
// instead of evenly (memo 9). docs/many_gathers.md, "Glossy bounces".
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>

#include "octree/node/node.h"
#include "octree/node/node_facet.h"
#include "surfeit/surfel.h"

namespace surfeit {

// In codes, as pages hold it. All zero: everything is sent evenly.
struct Lobe {
  std::array<std::uint8_t, 3> share{};  // of the radiosity in red, green and blue, in 1/255
  std::uint8_t unused = 0;
  std::array<std::int16_t, 3> mean{};  // of the directions it is sent to, in 1/32767

  // `shares`: 0 to 1 by color. `mean`: the mean of the unit directions, by light: the longer, the
  // narrower the lobe; up to 1.
  static Lobe encode(const glm::vec3& shares, const glm::vec3& mean);
  glm::vec3 shares() const { return glm::vec3(share[0], share[1], share[2]) * (1.f / 255); }
  glm::vec3 meanDirection() const { return glm::vec3(mean[0], mean[1], mean[2]) * (1.f / 32767); }
  bool isEven() const { return share[0] == 0 && share[1] == 0 && share[2] == 0; }
  bool operator==(const Lobe&) const = default;
};
static_assert(sizeof(Lobe) == 10);

// Those of a node: of each facet, or of a flat node as a whole at 0. What is rough or two-sided
// sends evenly.
using NodeLobes = std::array<Lobe, kMostFacets>;

// What the lobes of a flat piece add up over its surfels, in double. Plain data.
struct LobeSums {
  double power[3] = {};  // sum A o B
  double lobe[3] = {};   // sum A o B share
  double weight = 0;     // sum of the luminances of that
  double mean[3] = {};   // sum of the luminances times the mean directions

  void add(const LobeSums& other);
  Lobe toLobe() const;
};

// The sums of the pieces of one node; of a node without pieces all at 0. Plain data.
using PieceSums = std::array<LobeSums, kMostFacets>;

// Adds a surfel to the piece of `node` that faces as it does.
void addToPiece(const Node& node, const Surfel& surfel, const Lobe& lobe, PieceSums& sums);
// Adds the pieces of a child to those of `node` that face as they do.
void addToPieces(const Node& node, const Node& child, const PieceSums& of_child, PieceSums& sums);
// The lobes of a node with these sums.
NodeLobes lobesOf(const Node& node, const PieceSums& sums);

}  // namespace surfeit
