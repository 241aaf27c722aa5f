// An octree of places alone.
#pragma once

#include <string>

#include "octree/read/scene_file.h"
#include "surfeit/index.h"

namespace surfeit {

// Indexes one cloud as indexClouds does, but its sizes: surfels without have the smallest there is,
// unless options ask for normals.
// The scene has full precision and no name; `beside` is the file in whose folder it stands unless
// options say where. Options are those of index, with memory and threads set.
Result<SceneFile> indexPlaces(const std::string& input, const std::string& beside,
                              const IndexOptions& options, Progress& progress);

}  // namespace surfeit
