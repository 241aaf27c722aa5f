// Contributions: what a receiver sees of a node or a surfel that is drawn as a single patch of
// solid angle (memo 3.4.2 and 3.4.3). docs/algorithm.md, "Contributions".
#pragma once

#include <glm/vec3.hpp>

#include "core/symmetric_matrix.h"
#include "gather/rules/coverage_rules.h"
#include "gather/rules/fidelity.h"
#include "octree/node/node.h"
#include "surfeit/gather.h"
#include "surfeit/surfel.h"

namespace surfeit {

struct Ribbon;

// The surfel as one whose front is the side that covers: with GatherSides::kBack turned round, and
// dark.
Surfel withSides(const Surfel& surfel, GatherSides sides);

// The projected area of what faces a receiver, and of what turns away.
struct FacingAreas {
  float front, back;
};
// What counts of those of a node.
float shownArea(const Node& node, const FacingAreas& facing, GatherSides sides);

// With w_i the weights and x_i = d . n_i of the surfels of a node: sum w, sum w x, sum w P2(x), sum
// w P4(x) to sum w max(x, 0) and sum w max(-x, 0). Exact when all |x| but those of 0 are alike, and
// for evenly spread normals.
FacingAreas facingAreas(float total, float mean, float second, float fourth);

// A flat node is one facet.
Facet facetOf(const Node& node);

// Where what is seen of a rough node is, seen from `to_node` before the node's position.
struct SeenPart {
  glm::vec3 middle;   // from the node's position; no longer than its radius
  float perspective;  // what it looks like in the distance of its middle, over what it faces
};
SeenPart seenPart(const Node& node, const glm::vec3& to_node, const FacingAreas& facing,
                  GatherSides sides);

// Whether a facet of a node, or a flat node, has no gaps, seen head-on: with all that other facets,
// opaque or translucent as it is, show in that direction it fills its outline, as the slopes of
// folds do together.
bool isFilled(const Node& node, const Facet& facet);
// A facet with more area than the rectangle that spreads as it does lies behind itself: it is so
// many layers, at least one.
float facetLayers(const Facet& facet);

// What a rough node covers in a color that shows `shown` of its area in unit direction `direction`
// (or its opposite): an area, and what it hides of that. A surface fills what it shows, a thicket
// is spread over its outline.
struct RoughCover {
  float area, opacity;
  float most;  // what `area` might be, however much is shown
};
RoughCover roughCover(const Node& node, const glm::vec3& direction, float shown, int color = 0);

// Of a rough node: the part of what it shows that looks the same from both sides, two-sided disks
// and spheres.
float partWithoutSides(const Node& node);

// Whether a rough node is leaves, hair or particles: it is loose, and not mostly one-sided.
bool isThicket(const Node& node);

// How what has this covariance spreads, as Patch::shape.
SymmetricMatrix shapeOf(const SymmetricMatrix& covariance);

}  // namespace surfeit
