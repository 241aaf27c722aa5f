// Render passes: what every pixel of a camera sees of a cloud, as an OpenEXR picture that the
// gather takes as receivers (cloud/exr/exr_reader.h). The result of the gather is such a picture
// again, and view/composite.h multiplies the light out.
//
// Channels, float, one sample in the middle of each pixel: P.X P.Y P.Z, where the ray through the
// pixel meets the front surface; N.X N.Y N.Z, its unit normal, turned towards the eye where
// it clearly points away; A, 1 where
// there is a surface and 0 elsewhere; Z, the depth along the view, infinite elsewhere; albedo.R .G
// .B and radiosity.R .G .B where the cloud has them (or color instead). They are means over the
// overlapping surfels of the front surface, as in pictures (view/framebuffer.h). R G B are a copy
// of radiosity in half floats for programs that show nothing else. worldToCamera and worldToNDC are
// as OpenEXR has them (ImfStandardAttributes.h): row vectors times the matrix, camera space x
// right, y up, z forward.
#pragma once

#include <cstdint>
#include <string>

#include "surfeit/progress.h"
#include "surfeit/status.h"
#include "view/camera.h"
#include "view/cloud_renderer.h"
#include "view/cloud_rows.h"

namespace surfeit {

// Bytes that writePasses takes for a picture of that size.
std::uint64_t passBytes(int width, int height);

// Draws `rows` as `style` says, but for its channel, and writes the passes to `path`; the file
// appears only when complete. The camera's samples are the pixels. Reads the rows once for the
// front and once for each of normal, albedo and radiosity. Returns how many pixels see something.
Result<std::uint64_t> writePasses(const std::string& path, CloudRows& rows,
                                  const RenderStyle& style, const Camera& camera,
                                  Progress& progress);

}  // namespace surfeit
