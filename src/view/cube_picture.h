// Pictures of a raster cube (surfeit/cube.h): panels of the unfolded cube in one PNG, or its values
// in an OpenEXR file.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "surfeit/cube.h"
#include "surfeit/status.h"
#include "view/camera.h"
#include "view/picture.h"

namespace surfeit {

// What a panel shows of each pixel.
enum class CubePanel : std::uint8_t { kLight, kCoverage, kDepth, kLayers, kKind };
inline constexpr CubePanel kCubePanels[] = {CubePanel::kLight, CubePanel::kCoverage,
                                            CubePanel::kDepth, CubePanel::kLayers,
                                            CubePanel::kKind};
// "light", "coverage", "depth", "layers", "kind".
std::string_view panelName(CubePanel panel);

struct CubePictureOptions {
  std::vector<CubePanel> panels{std::begin(kCubePanels), std::end(kCubePanels)};
  int zoom = 0;        // edge of a pixel in the picture; 0: faces of about 128, a cone's of 384
  float exposure = 0;  // stops, of light
  UpAxis up = UpAxis::kY;
};

// A cube and, where it was traced, what rays meet in the same pixels; null without.
struct CubeViews {
  const CubeImage* gathered = nullptr;
  const CubeImage* traced = nullptr;
};

// The panels, in rows of up to three, with display values (PngOptions::is_data). The traced
// coverage and depth stand to the right of the gathered ones.
Picture drawCube(const CubeViews& cubes, const CubePictureOptions& options);
// Memory that drawing and encoding it take.
std::uint64_t cubePictureBytes(const CubeViews& cubes, const CubePictureOptions& options);
// What the colors and brightnesses of that picture mean, and where its panels are; lines of text.
std::string cubeLegend(const CubeViews& cubes, const CubePictureOptions& options);

// The unfolded cube, a pixel for each of the raster's: float channels R G B (light and
// environment), coverage, depth, layers, kind (CubeKind), weight (times the solid angle: an
// integral is the sum over weight); of rays reference.coverage and reference.depth. Beside the
// faces all are 0.
Status writeCubeExr(const std::string& path, const CubeViews& cubes, UpAxis up);

}  // namespace surfeit
