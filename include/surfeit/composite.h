// Pictures from render passes and what the gather made of them: the second half of a two-pass
// render. Layers are multiplied and added, pixel by pixel:
//
//   radiosity                                          direct light
//   indirect = albedo * (irradiance + environment)     bounced light, and that of the sky
//   lit      = radiosity + indirect                    the sum
//   ao       = 1 - occlusion
//
// Irradiance has the unit of radiosity (docs/algorithm.md), so there is no pi between them. Needs
// the component `view`.
#pragma once

#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <optional>
#include <string>
#include <vector>

#include "surfeit/api.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

struct CompositeOptions {
  std::string channel;  // one of these or of the files; empty: the most telling one
  int reduce = 1;       // pixels along an edge that become one, 1..16: their mean
  // As ViewOptions has them
  float exposure = 0;
  glm::vec3 background{0.13f};
  std::optional<glm::dvec2> range;
  std::uint64_t memory_bytes = 0;  // 0: three quarters of what the job may use
};

struct CompositeStats {
  std::string channel;
  int width = 0, height = 0;            // of the picture
  std::uint64_t pixels = 0;             // of the inputs that see something, within the picture
  std::uint64_t non_finite_values = 0;  // magenta
};

// Makes `picture`, .png or .exr by its name, of OpenEXR pictures that Surfeit reads as clouds
// (docs/files.md). It has the display window of the first; pixels are those of the first,
// and the others add the channels that those before them lack. Errors:
// kInvalidArgument (options, an input that is no such picture, windows that differ),
// kBudgetTooSmall, kCorruption, kIoError, kInterrupted. Calls are independent.
SURFEIT_API Result<CompositeStats> compositePicture(const std::vector<std::string>& inputs,
                                                    const std::string& picture,
                                                    const CompositeOptions& options,
                                                    Progress& progress);

}  // namespace surfeit
