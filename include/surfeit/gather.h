// What a gather looks for, and how well: the settings that decide about light, for the engine
// (surfeit/engine.h) and for jobs on files (surfeit/bake.h) alike (memo 08-01, sections 3 and 7).
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <limits>
#include <optional>
#include <string>
#include <string_view>

#include "surfeit/api.h"
#include "surfeit/status.h"
#include "surfeit/surfel.h"
#include "surfeit/up_axis.h"

namespace surfeit {

// What is gathered, by which weights of directions.
enum class GatherMode : std::uint8_t {
  kOcclusion,  // over the hemisphere above the receiver; coverage alone (memo 7.5)
  kBleeding,   // the same with light (memo 3)
  kGlossy,     // over a lobe around the direction of mirror reflection (memo 7.6)
};

// What receivers get, any set of it in one pass. Light is in units of radiosity: E = pi * mean
// radiance by the weights of the mode, so that inside a closed shell of radiosity B it is B.
enum GatherOutput : std::uint32_t {
  kOutputOcclusion = 1u << 0,   // covered part, 0..1
  kOutputIrradiance = 1u << 1,  // light from surfels: irradiance; with kGlossy the reflection
  kOutputBentNormal = 1u << 2,  // mean direction of what is open, unit; 0 when nothing is (slides)
  // Mean direction that light comes from, weighted by luminance, unit; 0 without light (slides)
  kOutputIlluminationDirection = 1u << 3,
  kOutputEnvironment = 1u << 4,  // light of the environment map where nothing covers (memo 7.3)
  // For volumes: 4 pi * mean radiance over the sphere, of surfels and environment; the hemisphere
  // of a receiver with a normal counts twice
  kOutputFluence = 1u << 5,
  // 9 spherical harmonics coefficients per color of pi times the incident radiance, of surfels and
  // environment, over what the receiver sees: the sphere, or the hemisphere
  kOutputRadianceSh = 1u << 6,
};

inline constexpr std::uint32_t kAllOutputs = 2 * kOutputRadianceSh - 1;

// A set of outputs in words, "occlusion,irradiance", and the set that such words mean:
// kInvalidArgument names one that is no output. Words: occlusion, irradiance, bent_normal,
// illumination_direction, environment, fluence, radiance_sh. Safe from any thread.
SURFEIT_API std::string describeOutputs(std::uint32_t outputs);
SURFEIT_API Result<std::uint32_t> parseOutputs(std::string_view words);

// How directions weigh, and what is found there (app note 2.3). To a receiver without a normal all
// directions weigh alike.
struct GatherWeights {
  enum class Distribution : std::uint8_t { kCosine, kUniform };
  enum class FalloffMode : std::uint8_t { kExponential, kPolynomial };

  Distribution distribution = Distribution::kCosine;  // not with kGlossy
  // Half the opening angle of the cone around the normal, or around the reflection with kGlossy,
  // outside of which directions have no weight; radians, to pi / 2. 0: the hemisphere, and with
  // kGlossy to where the lobe falls to a hundredth.
  float cone_angle = 0;
  // With kGlossy: within the cone, directions weigh like cos^n of the angle to the reflection with
  // n = 2 / roughness^2 - 2; 1: all alike. Over 0 to 1.
  float roughness = 0.1f;
  // How occlusion fades with distance: exp(-falloff * distance), or (1 - distance / max_distance)
  // ^ falloff, which needs a max distance. 0: not at all. Light does not fade.
  float falloff = 0;
  FalloffMode falloff_mode = FalloffMode::kExponential;
};

// How light from all around, infinitely far away, is turned (memo 7.3).
struct EnvironmentPlacement {
  float rotation = 0;          // about the up axis, radians, counterclockwise seen from above
  std::optional<UpAxis> up{};  // absent: the scene's
  float intensity = 1;         // multiplies it, >= 0
};

// Which side of a one-sided surfel covers the raster. Only front sides send light; with kBack
// nothing does.
enum class GatherSides : std::uint8_t { kFront, kBoth, kBack };

// How the gather approximates. Scene units are the cloud's own.
struct GatherQuality {
  // sigma_max, steradians, >= 0; 0 opens every node (memo 5). Nodes that are not flat
  // keep below 2/3 of it.
  float max_solid_angle = 0.1f;
  int raster_resolution = 16;  // pixels along an edge of a cube face, even, 2..64 (memo 3.4)
  // Rays and horizon start this far above the receiver, in radii of the surfel looked at, or where
  // its longer side is known (two-sided surfels only) in widths.
  float bias = 0.15f;
  // Surfels closer than this many of their radii are ray traced (memo 3.4.1), or of eighths of
  // their longer side.
  float near_field_radii = 8;
  // Surfels farther than this do not count; scene units.
  float max_distance = 1e30f;
  GatherSides sides = GatherSides::kFront;
  // Where results vary less than this from receiver to receiver, only some are gathered and the
  // others interpolated between them: occlusion may differ by this, lights by this part of the
  // brightest nearby, directions by this part of a turn to the opposite (app note 2.2). 0: off.
  float max_variation = 0;
};

// Settings from measured tables (docs/benchmarks.md, "Errors and rates"). Standard is the default.
enum class QualityPreset : std::uint8_t { kDraft, kStandard, kFinal };

// Sets what decides about errors: max solid angle, raster resolution, near field. The rest, such as
// sides and distances, stays as it is.
SURFEIT_API void setQuality(QualityPreset preset, GatherQuality& quality);

// All that decides what a gather finds at a receiver, but the scene and the environment.
struct GatherSettings {
  GatherMode mode = GatherMode::kOcclusion;
  // Set of GatherOutput. 0: occlusion, and light unless kOcclusion; with an environment its light.
  std::uint32_t outputs = 0;
  GatherQuality quality;
  GatherWeights weights;
  // Set of the groups of surfels that send light and cover, as bits (surfeit/surfel.h); others are
  // as if they were not there. At least one must be in the scene; kAllGroups is right for any.
  std::uint64_t groups = kAllGroups;
  // With kGlossy, receivers without a view are looked at from here; NaN: all need theirs.
  glm::dvec3 eye{std::numeric_limits<double>::quiet_NaN()};
};

// The place being lit.
struct Receiver {
  glm::dvec3 position{0};  // finite, scene units, as the cloud has them
  // Finite, of any length; zero: the receiver gathers over the whole sphere, every direction with
  // weight 1 instead of the cosine.
  glm::vec3 normal{0};
  // With kGlossy, the direction that the receiver is looked along, of any length; zero: from
  // GatherSettings::eye.
  glm::vec3 view{0};
};

// What was gathered at a receiver: GatherOutput has the meanings. What was not asked for is zero.
// Floats alone, one after the other.
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
