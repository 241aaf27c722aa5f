// Modes, outputs and quality of a gather: the settings that decide about its results, for the
// engine (surfeit/engine.h) and for jobs on files (surfeit/bake.h) (memo 08-01, sections 3 and 7).
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "surfeit/api.h"
#include "surfeit/status.h"
#include "surfeit/surfel.h"
#include "surfeit/up_axis.h"

namespace surfeit {

// What is gathered, and how directions weigh.
enum class GatherMode : std::uint8_t {
  kOcclusion,  // over the hemisphere above the receiver; coverage alone (memo 7.5)
  kBleeding,   // the same with light (memo 3)
  kGlossy,     // over a lobe around the direction of mirror reflection (memo 7.6)
};

// Outputs at a receiver; one pass computes any set of them. Light is in units of radiosity: E = pi
// * mean radiance, by the weights of the mode. So inside a closed shell of radiosity B, E = B.
enum GatherOutput : std::uint32_t {
  kOutputOcclusion = 1u << 0,   // covered part, 0..1
  kOutputIrradiance = 1u << 1,  // light from surfels: irradiance; with kGlossy the reflection
  kOutputBentNormal = 1u << 2,  // mean open direction, unit; 0 when nothing is open (slides)
  // Mean direction towards the light, weighted by luminance, unit; 0 without light (slides)
  kOutputIlluminationDirection = 1u << 3,
  kOutputEnvironment = 1u << 4,  // light of the environment map where nothing covers (memo 7.3)
  // For volumes: 4 pi * mean radiance over the sphere, of surfels and environment; the hemisphere
  // of a receiver with a normal counts twice
  kOutputFluence = 1u << 5,
  // 9 spherical-harmonic coefficients per color of pi times the incident radiance, of surfels and
  // environment, over the sphere; over the hemisphere for a receiver with a normal
  kOutputRadianceSh = 1u << 6,
};

inline constexpr std::uint32_t kAllOutputs = 2 * kOutputRadianceSh - 1;

// A set of outputs in words, "occlusion,irradiance", and the set that such words mean:
// kInvalidArgument names one that is no output. Words: occlusion, irradiance, bent_normal,
// illumination_direction, environment, fluence, radiance_sh. Safe from any thread.
SURFEIT_API std::string describeOutputs(std::uint32_t outputs);
SURFEIT_API Result<std::uint32_t> parseOutputs(std::string_view words);

// Weights of directions, and falloff of occlusion with distance (app note 2.3). For a receiver
// without a normal all directions weigh alike.
struct GatherWeights {
  enum class Distribution : std::uint8_t { kCosine, kUniform };
  enum class FalloffMode : std::uint8_t { kExponential, kPolynomial };

  Distribution distribution = Distribution::kCosine;  // not with kGlossy
  // Half the opening angle of a cone around the normal, or around the reflection with kGlossy;
  // radians, up to pi / 2. Directions outside have no weight. 0: the hemisphere; with kGlossy, the
  // cone within which the lobe stays above a hundredth of its peak.
  float cone_angle = 0;
  // With kGlossy: within the cone, directions weigh like cos^n of the angle to the reflection, with
  // n = 2 / roughness^2 - 2; 1: all alike. Above 0, up to 1.
  float roughness = 0.1f;
  // Falloff of occlusion with distance: exp(-falloff * distance), or (1 - distance / max_distance)
  // ^ falloff, which needs a max distance. 0: none. Light has no falloff.
  float falloff = 0;
  FalloffMode falloff_mode = FalloffMode::kExponential;
  // Directions weigh in the output occlusion by the luminance of the environment, too: the covered
  // part of its light instead of the covered part of the directions (app note 3.3). Needs an
  // environment. 0 where none of its light can arrive. Other outputs stay.
  bool by_brightness = false;
};

// Rotation and intensity of the environment, light from infinitely far away (memo 7.3).
struct EnvironmentPlacement {
  float rotation = 0;          // about the up axis, radians, counterclockwise seen from above
  std::optional<UpAxis> up{};  // absent: the scene's
  float intensity = 1;         // factor of its light, >= 0
};

// Which sides of one-sided surfels cover the raster. Only front sides send light; with kBack no
// surfel does.
enum class GatherSides : std::uint8_t { kFront, kBoth, kBack };

// Accuracy of the gather. Scene units are the cloud's own.
struct GatherQuality {
  // The largest solid angle of a node that is drawn as a whole: sigma_max, steradians, >= 0. 0
  // opens every node (memo 5). Nodes that are not flat are opened above 2/3 of it.
  float max_solid_angle = 0.08f;
  int raster_resolution = 16;  // pixels along an edge of a cube face, even, 2..64 (memo 3.4)
  // Rays start, and the horizon lies, this far above the receiver, in radii of the surfel that is
  // tested; for two-sided surfels with a known longer side, in their widths.
  float bias = 0.15f;
  // Surfels closer than this many of their radii are ray traced (memo 3.4.1); the radius of one
  // with a known longer side is half the diagonal of its rectangle.
  float near_field_radii = 8;
  // Surfels farther than this do not count; scene units.
  float max_distance = 1e30f;
  GatherSides sides = GatherSides::kFront;
  // Where results vary less than this between receivers, only some are gathered and the others are
  // interpolated. The limit is absolute for occlusion, relative to the brightest receiver nearby
  // for lights, and a part of half a turn for directions (app note 2.2). 0: off.
  float max_variation = 0;
  // With max_variation, no more than about so many receivers lie between neighbouring samples, from
  // 4 on: pixels where receivers are those of a picture (app note 2.2, maxpixeldist). 0: no limit,
  // which is the same as 23 and more.
  int max_pixel_distance = 0;
};

// Settings from measured tables (docs/benchmarks.md, "Errors and rates"). Standard is the default.
enum class QualityPreset : std::uint8_t { kDraft, kStandard, kFinal };

// Sets the members that decide about errors: max solid angle, raster resolution, near field. The
// others, such as sides and distances, stay as they are.
SURFEIT_API void setQuality(QualityPreset preset, GatherQuality& quality);

// A factor of the light that surfels of an object group send.
struct GroupGain {
  std::uint32_t group = 0;  // 0 to kMaxGroups - 1 (surfeit/surfel.h)
  float gain = 1;           // 0 to 1e6
};

// Everything that decides about the result at a receiver, except the scene and the environment.
struct GatherSettings {
  GatherMode mode = GatherMode::kOcclusion;
  // Set of GatherOutput. 0: occlusion; light unless kOcclusion; environment light if there is an
  // environment.
  std::uint32_t outputs = 0;
  GatherQuality quality;
  GatherWeights weights;
  // Set of the object groups that send light and cover, as bits (surfeit/surfel.h). Surfels of
  // other groups are ignored. At least one group must be in the scene; kAllGroups works for any
  // scene.
  std::uint64_t groups = kAllGroups;
  // With kGlossy, the viewpoint of receivers without a view; NaN: every receiver needs its own
  // view.
  glm::dvec3 eye{std::numeric_limits<double>::quiet_NaN()};
  // Gains of object groups, no group twice: surfels send so many times their radiosity, and cover
  // as ever. Groups that are not named have 1. At least one of the others must be in the scene.
  // Nodes with surfels of several gains are opened, as those with surfels that are ignored.
  std::vector<GroupGain> gains{};
};

// The place being lit.
struct Receiver {
  glm::dvec3 position{0};  // finite, in the cloud's coordinates
  // Finite, of any length. Zero: the receiver gathers over the whole sphere, and every direction
  // has weight 1 instead of the cosine.
  glm::vec3 normal{0};
  // With kGlossy, the direction from the viewer to the receiver, of any length; zero: from
  // GatherSettings::eye.
  glm::vec3 view{0};
};

// The result at a receiver; GatherOutput has the meanings. Outputs that were not asked for are
// zero. The struct holds floats only, without padding.
struct GatherResult {
  float occlusion = 0;
  glm::vec3 irradiance{0};
  glm::vec3 bent_normal{0};
  glm::vec3 illumination_direction{0};
  glm::vec3 environment{0};
  glm::vec3 fluence{0};
  std::array<glm::vec3, 9> radiance_sh{};
};

}  // namespace surfeit
