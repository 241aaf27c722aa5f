// Nodes as the gather sees them: decoded, plain, immutable. docs/format.md, "Node-group page", has
// the stored form.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>

#include "core/spherical_harmonics.h"
#include "core/symmetric_matrix.h"
#include "octree/node/node_facet.h"
#include "octree/node/radiosity_slope.h"
#include "surfeit/surfel.h"

namespace surfeit {

// What a node is beyond its numbers.
enum NodeFlags : std::uint8_t {
  // Flat: |sum A n| / sum A above the file's flatness limit. Drawn as one disk (mean normal, summed
  // area). Order-2 harmonics ring on flat clusters, one disk is wrong for rough ones.
  kNodeFlat = 1u << 0,
  // Bit 1 + i: facet i is of two-sided surfels, and its normal is one of two; with i = 0, all of a
  // flat node.
  kNodeTwoSided = 1u << 1,
  // Most of its spheres and two-sided surfels, by area, are kSurfelLoose.
  kNodeLoose = 1u << 7,
};

// A node that is neither flat nor made of a few facets is rough: it is drawn as what its harmonics
// and moments tell. What coefficients it has: of its projected area, and of its projected power in
// red, green and blue (memo 3.2).
inline constexpr int kNodeShKinds = 4;
inline constexpr int kAreaKind = 0;
inline constexpr int powerKind(int channel) { return channel + 1; }

// What a rough node knows of how its surfels face.
struct RoughNode {
  // By coefficient, then by kind: kAreaKind, and a kind per color. Side by side, so that a gather
  // evaluates all kinds at once.
  std::array<std::array<float, kNodeShKinds>, kShCount> sh;
  // sum A (x - position) n^T over one-sided disks, row by row: where the fronts of each direction
  // lie.
  std::array<glm::vec3, 3> front_moment;
  // sum w (4 pi / 9) Y4m(n) over disks, w = A, or 2 A of two-sided ones: with shBand4(d) it gives
  // sum w P4(d . n), what bands 0 to 2 do not tell of the fourth moment of d . n.
  ShCoefficients area_band_4;

  ShCoefficients coefficients(int kind) const {
    ShCoefficients values;
    for (int i = 0; i < kShCount; ++i) values[i] = sh[i][kind];
    return values;
  }
};

// A cluster of surfels: one octree cell, single-child levels skipped.
struct Node {
  glm::vec3 position;  // area-weighted mean of the surfel positions
  float radius;        // of a sphere around position that holds every surfel's disk
  // Unit mean normal, direction of sum A n; zero when that sum is zero. Two-sided surfels do not
  // add to it, but where all are two-sided and flat: then their normals are turned to one side.
  glm::vec3 normal;
  // Cosine of the largest angle between `normal` and the normal of any surfel below; -1 where
  // nothing is known: a surfel below is a sphere or two-sided, `normal` is zero, the file is of
  // format version 1.
  float normal_cosine;
  // Half the thickness of a slab around `position`, across `normal`, that holds every surfel's disk
  // or sphere: 0 to radius. Radius where nothing is known, and where `normal` is zero.
  float thickness;
  float area;           // sum of the surfel areas
  glm::vec3 radiosity;  // mean, weighted by area and opacity
  float flatness;       // |sum A n| / sum A, 0..1
  std::uint32_t page;  // interior: node page of the children; leaf: surfel page of its first surfel
  std::uint16_t first;         // index of the first child or surfel in that page
  std::uint8_t child_count;    // 0: a leaf
  std::uint8_t flags;          // set of NodeFlags
  std::uint64_t surfel_count;  // below this node; those of a leaf may run on into following pages
  std::uint64_t
      groups;  // set of those of the surfels below; group 0 alone in scenes without groups
  // Area-weighted mean of (x - position)(x - position)^T over the disks, not only their middles:
  // how the area spreads. Trace above 0 and at most about radius^2.
  SymmetricMatrix covariance;
  std::uint8_t facet_count;    // 0: it is flat or rough
  std::uint8_t hidden;         // HiddenSides of a flat node, by its normal
  std::uint16_t transparency;  // of the area-weighted mean of opacities, as in Surfel
  Tint tint;                   // the same
  // How far surfels lie off the planes that a flat node or one of facets is drawn on, at most or by
  // their moments; 0 in a rough node. Not stored.
  float off_plane;
  float radiosity_variance;                        // RadiosityVariance; 0 where nothing is known
  std::array<RadiositySlope, kMostFacets> slopes;  // of its pieces, none of others
  union {
    RoughNode rough;  // without facets; zero in a flat node
    std::array<NodeFacet, kMostFacets> facets;
  };

  // Makes the slab and the cone of normals those of a node of which nothing is known but the
  // sphere.
  void forgetBounds() {
    thickness = radius;
    normal_cosine = -1;
  }

  // Sets off_plane by everything else.
  void findOffPlane();

  bool isTinted() const { return surfeit::isTinted(tint); }
  bool isTranslucent() const { return transparency != 0 || isTinted(); }  // in some color
  float opacity(int color = 0) const {
    return opacityOf(transparencyOf(transparency, tint, color));
  }
  bool isLeaf() const { return child_count == 0; }
  bool isFlat() const { return (flags & kNodeFlat) != 0; }
  bool hasFacets() const { return facet_count > 0; }
  bool isRough() const { return !isFlat() && !hasFacets(); }
  // Of facet i, or of a flat node.
  std::uint8_t hiddenSides(std::size_t i) const { return isFlat() ? hidden : facets[i].hidden; }
  bool isLoose() const { return (flags & kNodeLoose) != 0; }
  bool isTwoSided(std::size_t i = 0) const { return (flags & (kNodeTwoSided << i)) != 0; }
  Facet facet(std::size_t i) const {
    Facet facet = facets[i].decode(position, radius, area);
    facet.is_two_sided = isTwoSided(i);
    facet.is_thicket = facet.is_two_sided && isLoose();
    return facet;
  }
};
static_assert(sizeof(Node) == 392);

// Siblings: `count` nodes side by side in one node page.
struct NodeRange {
  std::uint32_t page = 0;
  std::uint16_t first = 0;
  std::uint16_t count = 0;
};

// The root's own range: it stands alone on the first node page.
inline constexpr NodeRange kRootRange = {0, 0, 1};

inline NodeRange childrenOf(const Node& node) { return {node.page, node.first, node.child_count}; }

// The surfels of a leaf: `count` from index `first` of a surfel page on, into the following pages.
struct LeafRange {
  std::uint32_t page = 0, first = 0;
  std::uint64_t count = 0;
};

inline LeafRange surfelsOf(const Node& leaf) { return {leaf.page, leaf.first, leaf.surfel_count}; }

// How many flat pieces a node has: 1, its facets, or none.
inline std::size_t pieceCount(const Node& node) { return node.isFlat() ? 1 : node.facet_count; }

}  // namespace surfeit
