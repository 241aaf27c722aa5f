// Pictures of a raster cube (surfeit/cube.h): panels of the unfolded cube in one PNG, or its values
// in an OpenEXR file. Needs the component `view`.
#pragma once

#include <cstdint>
#include <iterator>
#include <string>
#include <string_view>
#include <vector>

#include "surfeit/api.h"
#include "surfeit/cube.h"
#include "surfeit/status.h"
#include "surfeit/up_axis.h"

namespace surfeit {

// What a panel shows of each pixel.
enum class CubePanel : std::uint8_t { kLight, kCoverage, kDepth, kLayers, kKind };
inline constexpr CubePanel kCubePanels[] = {CubePanel::kLight, CubePanel::kCoverage,
                                            CubePanel::kDepth, CubePanel::kLayers,
                                            CubePanel::kKind};
// "light", "coverage", "depth", "layers", "kind".
SURFEIT_API std::string_view panelName(CubePanel panel);

// Of a PNG; an OpenEXR picture takes `up` alone.
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

// What the colors and brightnesses of that picture mean, and where its panels are; lines of text.
SURFEIT_API std::string cubeLegend(const CubeViews& cubes, const CubePictureOptions& options);

// Writes a picture, .png or .exr by its name, which appears when complete. A PNG has the panels, in
// rows of up to three; the traced coverage and depth stand to the right of the gathered ones. An
// OpenEXR picture is the unfolded cube, a pixel for each of the raster's: float channels R G B
// (light and environment), coverage, depth, layers, kind (CubeKind), weight (times the solid angle:
// an integral is the sum over weight); of rays reference.coverage and reference.depth. Beside the
// faces all are 0. `memory_bytes`: budget of a PNG; 0: three quarters of what the
// job may hold. Errors: kInvalidArgument (the name), kBudgetTooSmall, kIoError. Calls are
// independent.
SURFEIT_API Status writeCubePicture(const std::string& path, const CubeViews& cubes,
                                    const CubePictureOptions& options,
                                    std::uint64_t memory_bytes = 0);

}  // namespace surfeit
