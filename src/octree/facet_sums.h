// The facets of a node while it is summed up.
#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "octree/area_sums.h"
#include "octree/node_facet.h"

namespace surfeit {

// Groups of surfels that face about one way. What is added joins the group that it resembles, and
// when there are too many, the two groups become one that lose least by it: the loss is the area
// that faces one way less, |N_a| + |N_b| - |N_a + N_b| with N = sum A n. The order of adding
// decides what is grouped with what. Plain data.
class FacetSums {
 public:
  void add(const AreaSums& facet);
  // Those of a child, `shift` farther from our origin.
  void add(const FacetSums& child, const double (&shift)[3]);
  // There are no facets and will be none: some surfels have no front, or two.
  void giveUp();

  // As few groups as hold together more than `flatness` of the area, as sum |N| over sum A; none
  // when all do not.
  FacetSums fewest(float flatness) const;
  std::span<const AreaSums> groups() const { return std::span(groups_).first(count_); }

 private:
  struct Pair {
    std::size_t first, second;
  };
  Pair closest() const;
  void merge(const Pair& pair);

  std::array<AreaSums, kMostFacets + 1> groups_;
  std::size_t count_ = 0;
  bool has_given_up_ = false;
};

}  // namespace surfeit
