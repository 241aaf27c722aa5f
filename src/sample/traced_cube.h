// The raster cube of a receiver, traced on the true triangles: what the gathered one
// (surfeit/cube.h) is held to.
#pragma once

#include "sample/meshes/mesh.h"
#include "sample/ray_scene.h"
#include "surfeit/cube.h"
#include "surfeit/sample.h"

namespace surfeit {

// The same receiver, faces and pixels as `cube`, with coverage and depth of rays in a grid over
// each pixel; there is no light, and one layer. Rays begin 1/10000 of the mesh's diagonal above the
// receiver, and those below its horizon do not count; a pixel without others sees nothing. depth is
// that of the nearest hit. occlusion is that of the pixels by their weights. `rays` must be of
// `mesh`.
CubeImage traceCube(const CubeImage& cube, const Mesh& mesh, const RayScene& rays,
                    const TracedCubeOptions& options);

}  // namespace surfeit
