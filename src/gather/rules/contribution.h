// Contributions: what a node or a surfel adds to the raster of one receiver when it is seen as a
// single patch of solid angle (memo 3.4.2 and 3.4.3). docs/algorithm.md, "Contributions".
#pragma once

#include <glm/vec3.hpp>

#include "core/symmetric_matrix.h"
#include "gather/rules/fidelity.h"
#include "octree/node/node.h"
#include "surfeit/gather.h"
#include "surfeit/surfel.h"

namespace surfeit {

struct Ribbon;

// A patch as the receiver sees it. Plain floats without padding.
struct Contribution {
  float distance_sq;      // from the receiver, > 0
  float reach;            // how far before and behind that it meets others of its layer
  glm::vec3 direction;    // unit, from the receiver
  float solid_angle;      // steradians, > 0
  float spread;           // area / distance^2: the solid angle that it would have head-on
  float overlap;          // of its parts with those of its layer, 0..1; see RasterCube::Patch
  float thicket;          // how much of it is leaves or hair, 0..1; likewise
  float opacity;          // what it hides of its solid angle, 0..1; 1 but for thickets, and while
                          // a node fades into what is below it
  float nested;           // how far it hides behind other layers; likewise
  float is_solid;         // 1: a tile of a surface; 0: a sphere, or a rough node; likewise
  glm::vec3 normal;       // unit length for a disk, zero for a sphere, in between when partly flat
  SymmetricMatrix shape;  // how it spreads; see RasterCube::Patch
  glm::vec3 radiosity;    // of what covers; back sides are black. Zero when color is not asked for.
};
static_assert(sizeof(Contribution) == 24 * sizeof(float));

// How contributions are to be made.
struct ContributionRules {
  GatherSides sides = GatherSides::kFront;
  bool has_color = true;
  float ribbon_nested = 0;  // coverage_rules.h
};

// The surfel as one whose front is the side that covers: with GatherSides::kBack turned round, and
// dark.
Surfel withSides(const Surfel& surfel, GatherSides sides);

// Sum over the surfels of a node of weight * max(d . n, 0), from the 9 coefficients of that sum
// (clamped cosine, memo 3.2) and the basis in direction d. Never negative, exact when all surfels
// have one normal and when normals are spread evenly. `opposite` gets the sum for direction -d.
// Two-sided surfels and spheres may be part of the sum.
float projectedSum(const ShCoefficients& coefficients, const ShCoefficients& basis,
                   float& opposite);

// The projected area of what faces a receiver, and of what turns away.
struct FacingAreas {
  float front, back;
};
// What counts of them.
float shownArea(const FacingAreas& facing, GatherSides sides);

// With w_i the weights and x_i = d . n_i of the surfels of a node: sum w, sum w x, sum w P2(x), sum
// w P4(x) to sum w max(x, 0) and sum w max(-x, 0). Exact when all |x| but those of 0 are alike, and
// for evenly spread normals.
FacingAreas facingAreas(float total, float mean, float second, float fourth);
// The same of a node in unit direction `to_receiver` from it.
FacingAreas facingAreas(const Node& node, const glm::vec3& to_receiver);

// Those of something that is nearly flat.
FacingAreas facingAreas(const Facet& facet, const glm::vec3& to_receiver);
// Its normals spread by this much to either side of their mean, as cosines. `normal`: that mean,
// shorter where they spread more.
float normalRange(const glm::vec3& normal);

// A flat node is one facet.
Facet facetOf(const Node& node);

// Radiosity of the fronts that face a receiver in unit direction `to_receiver` of a rough node.
glm::vec3 seenRadiosity(const Node& node, const glm::vec3& to_receiver);

// Where what is seen of a rough node is, seen from `to_node` before the node's position.
struct SeenPart {
  glm::vec3 middle;   // from the node's position; no longer than its radius
  float perspective;  // what it looks like in the distance of its middle, over what it faces
};
SeenPart seenPart(const Node& node, const glm::vec3& to_node, const FacingAreas& facing,
                  GatherSides sides);

// The largest area that a facet may show in any direction.
float mostVisibleArea(const Facet& facet);

// What a rough node covers that shows `shown` of its area in unit direction `direction` (or its
// opposite), and of which `thicket` is leaves or hair: an area, and what it hides of that. A
// surface fills what it shows, a thicket is spread over its outline.
struct RoughCover {
  float area, opacity;
  float most;  // what `area` might be, however much is shown
};
RoughCover roughCover(const Node& node, const glm::vec3& direction, float shown, float thicket);

// How far before and behind its middle a facet meets others of its layer, seen in this direction.
float reachOf(const Facet& facet, const glm::vec3& direction);
// How far before and behind its middle a surfel meets others of its layer, seen in this direction.
// `radius`: drawnRadius.
float reachOf(const Surfel& surfel, const Ribbon& ribbon, float radius, const glm::vec3& direction);
// Whether a surfel is a tile of a surface by all that it tells: spheres and two-sided ones, leaves,
// may stand alone.
inline bool mayTile(const Surfel& surfel) { return !surfel.isSphere() && !surfel.isTwoSided(); }
// How much of a surfel is of a thicket, 0 or 1: pieces of ribbons are.
float thicketPart(const Surfel& surfel);
// How much of what it covers hides behind the same side of a pixel as other layers, 0..1.
float nestedPart(const Surfel& surfel, const Ribbon& ribbon, const ContributionRules& rules);
// How much of a rough node is leaves or hair, 0..1: what of it is two-sided.
float thicketPart(const Node& node);

// How what has this covariance spreads, for RasterCube::Patch.
SymmetricMatrix shapeOf(const SymmetricMatrix& covariance);

// The patch of a facet, or false when the receiver sees nothing of it. `to_facet` leads from the
// receiver to its position.
bool makeContribution(const Facet& facet, const glm::vec3& to_facet, const ContributionRules& rules,
                      Contribution& contribution);

// The patch of a node that is rough or flat, or false when the receiver sees nothing of it.
// `to_node` leads from the receiver to the node's position; the receiver must lie outside the
// node's radius.
bool makeContribution(const Node& node, const glm::vec3& to_node, const ContributionRules& rules,
                      Contribution& contribution);

// The patch of a surfel, or false when the receiver sees nothing of it: it faces away, is seen
// edge-on, or lies at the receiver.
bool makeContribution(const Surfel& surfel, const glm::vec3& to_surfel,
                      const ContributionRules& rules, Contribution& contribution);

}  // namespace surfeit
