// The part of verify that checks what nodes claim of all surfels below them: sphere, slab, cone and
// sums.
#pragma once

#include <functional>
#include <string>

#include "octree/read/paged_octree.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

// Holds every surfel against every node above it, with so many threads, and the sums over the
// surfels below against every node: surfels are read once more, and cost a comparison for each
// level of the tree. Nodes and surfels must have been found to be referenced once each, which is
// what bounds the walk. `brightest`: the largest radiosity of the file. Calls `report` for each
// node that claims too little or what is not so, one call at a time. Errors: those of reading;
// kInterrupted.
Status verifyBounds(PagedOctree& octree, int threads, float brightest, Progress& progress,
                    const std::function<void(const std::string& finding)>& report);

}  // namespace surfeit
