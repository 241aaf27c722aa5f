// Which facet of a node is which group of its surfels. Surfels as they are stored may group a
// little otherwise than the indexer found them: then none is.
#pragma once

#include <array>
#include <cstddef>
#include <optional>

#include "octree/node/facet_sums.h"
#include "octree/node/node.h"

namespace surfeit {

// The facet of each group, by area, normal and place; nothing where they are not the same, one for
// one. Positions of the groups are relative to `origin`.
using FacetMatch = std::array<std::size_t, kMostFacets>;
std::optional<FacetMatch> matchFacets(const FacetSums& groups, const double (&origin)[3],
                                      const Node& node);

}  // namespace surfeit
