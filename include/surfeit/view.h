// Pictures of surfel clouds, streamed: the memory it takes depends on the picture, not on the
// cloud. Needs the component `view`, which links libpng (docs/engine.md).
#pragma once

#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <optional>
#include <string>

#include "surfeit/api.h"
#include "surfeit/color_range.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"
#include "surfeit/up_axis.h"

namespace surfeit {

enum class PictureFormat : std::uint8_t { kPng, kExr };

// The format that a file name asks for; kInvalidArgument when it is neither .png nor .exr.
SURFEIT_API Result<PictureFormat> pictureFormat(const std::string& path);

// A camera in perspective, in scene units; whatever is absent is chosen so that the bounds of the
// cloud fill the picture.
struct CameraOptions {
  std::optional<glm::dvec3> eye;
  std::optional<glm::dvec3> look_at;  // absent: the centre of the bounds
  std::optional<glm::dvec3> up;       // absent: up_axis
  UpAxis up_axis = kDefaultUpAxis;
  double fov_degrees = 35;  // vertical field of view, 1..170
};

// How surfels are drawn.
enum class ViewMode : std::uint8_t {
  kDiscs,    // disks in perspective; spheres where there is no normal
  kPoints,   // squares of a fixed number of pixels
  kNormals,  // as kDiscs, colored by 0.5 n + 0.5
};

struct ViewOptions {
  ViewMode mode = ViewMode::kDiscs;
  // What to show: a property or triple of the cloud (radiosity, irradiance, albedo, color, normal,
  // position, ...), or lit = radiosity + albedo * (irradiance + environment), indirect = albedo *
  // (irradiance + environment), ao = 1 - occlusion. Empty: the first of lit, ao, radiosity, color,
  // albedo, normal, position that the cloud has.
  std::string channel;
  CameraOptions camera;            // but for its up axis
  std::optional<UpAxis> up{};      // absent: the cloud's
  int width = 1280, height = 960;  // pixels
  int samples = 2;                 // along each edge of a pixel, 1..8
  float point_size = 1;            // kPoints: edge of a square, pixels
  float radius = 0;                // > 0: radius of every surfel, scene units
  float radius_scale = 1;          // times the cloud's, estimated or given radius
  bool cull_back = false;          // leave out disks that are seen from behind
  float exposure = 0;              // PNG: stops, on channels of light
  glm::vec3 background{0.13f};     // PNG: display values, 0..1
  // Value shown black and value shown white, for any channel. Absent: scalars other than occlusion
  // are stretched over the values they take, in PNG; everything else is shown as it is.
  std::optional<glm::dvec2> range;
  // Where to write what every pixel sees, as OpenEXR: position, normal, depth, albedo and
  // radiosity, receivers for a gather. A name in .exr; empty: nowhere.
  std::string passes;
  // Channels of the cloud to be called otherwise, "FROM=TO,FROM=TO" (docs/files.md), and of a file
  // with several parts (grids, layers, elements) the one to read; empty: the first with a cloud.
  std::string channels, part;
  // Which records are read, "classification == 2" (docs/files.md, "Filters"); empty: all but those
  // that the format marks as not to be used.
  std::string filter;
  // How colors are read whose numbers do not say what they mean.
  ColorRange color_range = ColorRange::kAuto;
  // A brick map of whose values the cloud takes those of its surfels (docs/brick.md), over that
  // width or over each surfel's diameter; empty: none.
  std::string brick;
  std::optional<double> filter_width;
  std::uint64_t memory_bytes = 0;  // budget; 0: three quarters of what the job may use
  int threads = 0;                 // 0: all that the job may use
};

struct ViewStats {
  std::uint64_t records = 0;
  std::uint64_t skipped_records = 0;    // cannot be drawn: not finite, or a radius <= 0
  std::uint64_t drawn_surfels = 0;      // at least partly on the screen
  std::uint64_t non_finite_values = 0;  // drawn in magenta
  double coverage = 0;                  // part of the picture that the cloud covers, 0..1
  std::string channel;                  // the one shown
  std::uint64_t pass_pixels = 0;        // of the passes that see something
  bool radius_estimated = false;
  float mean_estimated_radius = 0;
  glm::dvec3 eye{0}, look_at{0};  // the camera that was used
  std::uint64_t framebuffer_bytes = 0;
  int threads = 0;
  double seconds = 0;
};

// Draws `input`, a cloud or a .sft file, into `picture`, .png or .exr by its name; it appears only
// when complete. `picture` may be empty where options.passes is not. The picture depends on the
// cloud and the options alone, not on the threads; reordering the records changes it by rounding
// only. EXR files hold the channel's own values. Errors: kInvalidArgument (options, or a channel
// that the cloud lacks: the message lists those it has), kBudgetTooSmall (picture too large),
// kCorruption, kIoError, kInterrupted. Calls are independent, so threads may call at once.
SURFEIT_API Result<ViewStats> viewCloud(const std::string& input, const std::string& picture,
                                        const ViewOptions& options, Progress& progress);

}  // namespace surfeit
