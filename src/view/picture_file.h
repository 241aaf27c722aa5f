// Pictures as PNG and OpenEXR files. Both are encoded in memory and appear under their final name
// only when complete.
#pragma once

#include <cstddef>
#include <glm/vec3.hpp>
#include <optional>
#include <string>
#include <vector>

#include "surfeit/status.h"
#include "surfeit/view.h"
#include "view/picture.h"

namespace surfeit {

// How scene-linear pixels become the display values of a PNG file.
struct PngOptions {
  float exposure = 0;           // stops: light is multiplied by 2^exposure
  bool is_data = false;         // values are display values already: neither exposure nor curve
  glm::vec3 background{0.13f};  // behind the cloud; display values
};

// 8-bit RGB with the sRGB curve.
Result<std::vector<std::byte>> encodePng(const Picture& picture, const PngOptions& options);
// R G B A as half floats, premultiplied by alpha, and Z as float, infinite where nothing is seen.
Result<std::vector<std::byte>> encodeExr(const Picture& picture);

// Encodes in the format of the file name and writes the file. `png` matters for PNG only.
Status writePicture(const std::string& path, const Picture& picture, const PngOptions& png);

}  // namespace surfeit
