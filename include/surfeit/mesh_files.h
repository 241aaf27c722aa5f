// The files that belong to a mesh. Needs the component `sample`. Safe from any thread.
#pragma once

#include <string>
#include <vector>

#include "surfeit/api.h"

namespace surfeit {

// The files that an OBJ mesh names and that are read with it: material files of OBJ and their
// pictures, those of them that are there. Reads the mesh once; empty for other meshes, for pipes,
// and for what cannot be read. For callers that want to know what they must not write to.
SURFEIT_API std::vector<std::string> filesNamedByMesh(const std::string& mesh);

}  // namespace surfeit
