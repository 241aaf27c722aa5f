// Options for cameras that decide how densely surfels lie, of `surfeit sample` and `surfeit
// convert`.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "surfeit/camera_density.h"
#include "surfeit/status.h"

namespace surfeit {

// "1280x960". Throws CLI's usage error, which names --size and what it expects.
void parseSize(const std::string& text, int& width, int& height);

// "x0,y0,x1,y1": columns from x0 to x1 - 1, rows from y0 to y1 - 1. Throws likewise, for --crop.
PixelWindow parseCrop(const std::string& text);

// What addDensityOptions parses into.
struct DensityArguments {
  CameraDensity density;
  double fov_degrees = 35;  // of cameras without their own
  std::vector<std::string> cameras, files;
  std::vector<const CLI::Option*> details;  // the options that mean nothing without a camera

  // The density with all cameras. Errors of files, and of options that need a camera where there is
  // none.
  Result<CameraDensity> cameraDensity() const;
};

// Adds --camera, --camera-file, --pixels, --max-solid-angle, --stereo, --fov and --size. Parsing
// fills `arguments`, which must outlive `app`. Returns --camera and --camera-file, which
// exclude other ways to choose a density.
std::vector<CLI::Option*> addDensityOptions(CLI::App& app, DensityArguments& arguments);
// Adds --crop, which is another thing where clouds are cropped.
void addCameraCropOption(CLI::App& app, DensityArguments& arguments);

}  // namespace surfeit
