// The part of verify that checks what nodes claim of all surfels below them: sphere, slab and cone.
#pragma once

#include <functional>
#include <string>

#include "octree/read/paged_octree.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

// Holds every surfel against every node above it, with so many threads: surfels are read once more,
// and cost a comparison for each level of the tree. Nodes and surfels must have been found to be
// referenced once each, which is what bounds the walk. Calls `report` for each node that claims too
// little, from this thread. Errors: those of reading; kInterrupted.
Status verifyBounds(PagedOctree& octree, int threads, Progress& progress,
                    const std::function<void(const std::string& finding)>& report);

}  // namespace surfeit
