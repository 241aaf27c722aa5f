// The nearest photons on the same surface, for a run of photons at once: neighbours along the curve
// share one walk through the octree.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <limits>
#include <span>
#include <vector>

#include "core/tangent_frame.h"
#include "octree/node/node.h"
#include "octree/read/paged_octree.h"
#include "surfeit/status.h"
#include "surfeit/surfel.h"

namespace surfeit {

// A neighbour, as seen from the photon whose neighbour it is.
struct NearestPhoton {
  float distance_sq;  // as NearestPhotonSearch measures it
  glm::vec2 offset;   // in the tangent plane
  glm::vec3 power;
};

// Which photons count, and how far away they are.
struct NearestPhotonSearch {
  std::size_t count = 100;  // how many are wanted, at least 1
  float max_distance = std::numeric_limits<float>::infinity();
  // Photons whose normals differ by more belong to another wall, or the other side of this one.
  float min_cosine = 0.5f;
  bool takes_others = false;  // those that belong to another, instead
  // Distances along the normal count this many times: of two sheets with the same normal, the other
  // one is far away (the compressed disk of Jensen 1996).
  float stretch = 4;
};

// One thread at a time.
class NearestPhotons {
 public:
  // Photons that share a walk.
  static constexpr std::size_t kMostCentres = 16;

  explicit NearestPhotons(const NearestPhotonSearch& search);

  // Finds the nearest photons of `centres`, at most kMostCentres of them, themselves included. What
  // is found depends on centres and octree alone.
  Status find(std::span<const Surfel> centres, PagedOctree::Reader& reader);

  // Those of centre number i, in no particular order, but for the last one when there are more than
  // search.count: it is the next one, the first that no longer belongs to them. Valid until find().
  std::span<NearestPhoton> nearest(std::size_t i);

  // Bytes of one of these.
  static std::size_t memoryBytes(const NearestPhotonSearch& search);

 private:
  // A photon whose neighbours are searched, and those found so far.
  struct Centre {
    glm::vec3 position, normal;
    TangentFrame frame;
    std::span<NearestPhoton> photons;  // room for roomFor(search)
    std::size_t found = 0;
    float limit_sq = 0, limit = 0;  // what is not closer does not count

    void limitTo(float distance_sq);
    // Whether the node could hold a photon that counts.
    bool mayFindIn(const Node& node) const;
  };

  // Photons as vectors like them: those of a leaf, as a rule.
  static constexpr std::size_t kBlockPhotons = 16;
  struct Block {
    std::array<float, kBlockPhotons> x, y, z;  // beyond the last photon: infinity
    std::span<const Surfel> photons;

    explicit Block(std::span<const Surfel> photons);
  };

  static std::size_t roomFor(const NearestPhotonSearch& search) { return 2 * search.count + 2; }
  Status limitToNeighbourhood(PagedOctree::Reader& reader);
  Status visit(const NodeRange& range, PagedOctree::Reader& reader);
  Status visitLeaf(const Node& leaf, PagedOctree::Reader& reader);
  // Whether some centre could do with a photon of the node.
  bool mayHoldNearer(const Node& node) const;
  void test(const Block& block, Centre& centre) const;
  void keepNearest(Centre& centre) const;

  const NearestPhotonSearch search_;
  std::vector<NearestPhoton> photons_;  // of all centres
  std::vector<Centre> centres_;
  glm::vec3 middle_{0};  // of the centres
};

}  // namespace surfeit
