// What surfeit/cube_picture.h writes.
#pragma once

#include <cstdint>
#include <string>

#include "surfeit/cube_picture.h"
#include "surfeit/status.h"
#include "view/picture.h"

namespace surfeit {

// The panels, in rows of up to three, with display values (PngOptions::is_data). The traced
// coverage and depth stand to the right of the gathered ones.
Picture drawCube(const CubeViews& cubes, const CubePictureOptions& options);
// Memory that drawing and encoding it take.
std::uint64_t cubePictureBytes(const CubeViews& cubes, const CubePictureOptions& options);
// The values as OpenEXR.
Status writeCubeExr(const std::string& path, const CubeViews& cubes, UpAxis up);

}  // namespace surfeit
