// All that decides what a gather finds at a receiver, but the scene: what it looks for, how well,
// and by which weights.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <limits>

#include "gather/rules/fidelity.h"
#include "gather/rules/raster_geometry.h"
#include "gather/rules/receiver.h"
#include "gather/rules/sending_gains.h"
#include "surfeit/gather.h"
#include "surfeit/surfel.h"

namespace surfeit {

class EnvironmentCube;
class EnvironmentMap;

// Half angle of the cone that is all above a receiver.
inline constexpr float kHemisphere = kPi / 2;

// Half angle of the widest cone with a raster of its own (surfeit/cube.h): the outermost pixels of
// wider ones would be too narrow.
inline constexpr float kWidestConeRaster = kPi / 3;

// Of the cosine, as Blinn-Phong lobes of a Beckmann roughness have it.
inline float lobeExponent(float roughness) { return 2 / (roughness * roughness) - 2; }

// The weights with the cone angle filled in if it was left open.
inline GatherWeights withConeAngle(GatherWeights weights, GatherMode mode) {
  if (weights.cone_angle > 0) {
    weights.cone_angle = std::min(weights.cone_angle, kHemisphere);
    return weights;
  }
  const float exponent = mode == GatherMode::kGlossy ? lobeExponent(weights.roughness) : 0;
  weights.cone_angle =
      exponent > 0 ? std::acos(std::pow(kFidelity.lobe_end, 1 / exponent)) : kHemisphere;
  return weights;
}

// What a mode usually gives.
constexpr std::uint32_t usualOutputs(GatherMode mode) {
  return mode == GatherMode::kOcclusion ? kOutputOcclusion : kOutputOcclusion | kOutputIrradiance;
}

struct GatherRules {
  GatherRules(GatherMode gather_mode, const GatherQuality& gather_quality)
      : mode(gather_mode),
        outputs(usualOutputs(gather_mode)),
        quality(gather_quality),
        weights(withConeAngle({}, gather_mode)) {}

  // `settings` must be checked (checkGatherSettings). With an environment see gatherRules in
  // gather/light/environment_map.h.
  explicit GatherRules(const GatherSettings& settings)
      : mode(settings.mode),
        outputs(settings.outputs != 0 ? settings.outputs : usualOutputs(settings.mode)),
        quality(settings.quality),
        weights(withConeAngle(settings.weights, settings.mode)),
        groups(settings.groups),
        gains(settings.gains),
        eye(glm::vec3(settings.eye)) {}

  GatherMode mode;
  std::uint32_t outputs;  // set of GatherOutput
  // Both null, or of one map.
  const EnvironmentMap* environment = nullptr;
  const EnvironmentCube* environment_cube = nullptr;  // of the raster's resolution
  GatherQuality quality;
  GatherWeights weights;              // with the cone angle filled in
  std::uint64_t groups = kAllGroups;  // set of the groups of surfels that are seen
  SendingGains gains;                 // of what they send
  glm::vec3 eye{0};                   // with kGlossy: receivers are looked at from here

  bool has(std::uint32_t some) const { return (outputs & some) != 0; }
  // Whether the radiosity of surfels matters, and whether distance does.
  bool hasLight() const {
    return has(kOutputIrradiance | kOutputIlluminationDirection | kOutputFluence |
               kOutputRadianceSh);
  }
  bool fades() const { return weights.falloff > 0 && has(kOutputOcclusion); }
  bool isGlossy() const { return mode == GatherMode::kGlossy; }
  // Whether only a cone is looked at, and drawn to a raster of its own.
  bool hasCone() const { return weights.cone_angle < kHemisphere; }
  bool hasConeRaster() const { return weights.cone_angle <= kWidestConeRaster; }
  std::uint32_t channels() const { return (hasLight() ? 3u : 0u) + (fades() ? 1u : 0u); }
};

// From here on a max distance is none: its square is no float.
inline constexpr float kNoDistance = 1e19f;
inline float maxDistanceSquared(const GatherRules& rules) {
  const float distance = rules.quality.max_distance;
  return distance < kNoDistance ? distance * distance : std::numeric_limits<float>::infinity();
}

// The raster that is drawn to.
inline RasterGeometry rasterGeometry(const GatherRules& rules) {
  const int resolution = rules.quality.raster_resolution;
  return rules.hasConeRaster() ? RasterGeometry::cone(resolution, rules.weights.cone_angle)
                               : RasterGeometry(resolution);
}

inline float pixelsPerSlope(const GatherRules& rules) {
  const float slope = rules.hasConeRaster() ? std::tan(rules.weights.cone_angle) : 1;
  return 0.5f * float(rules.quality.raster_resolution) / slope;
}

// The largest solid angle, as area over the square of the distance, that anything is drawn with as
// one patch: the image of a larger one is no parallelogram.
inline float largestPatch(const GatherRules& rules) {
  const float pixel = 1 / pixelsPerSlope(rules);
  return kFidelity.most_node_pixels * pixel * pixel;
}

// A raster that looks closer needs smaller clusters, and disks where others have patches. Shares of
// the hemisphere keep their number of clusters.
inline float maxSolidAngle(const GatherRules& rules) {
  const float share =
      std::min(1.f, kFidelity.cone_share * (1 - std::cos(rules.weights.cone_angle)));
  return std::min(rules.quality.max_solid_angle * (rules.hasConeRaster() ? share : 1),
                  largestPatch(rules));
}
// In radii of a surfel. Disks more than two pixels wide are ray traced in any case, unless nothing
// is: between such patches the widest hull leaves gaps. Spheres stand alone, and rays through the
// middles of pixels are no measure of how large they are.
inline float nearFieldRadii(const GatherRules& rules, bool is_sphere) {
  const float slope = rules.hasConeRaster() ? std::tan(rules.weights.cone_angle) : 1;
  const float radii = rules.quality.near_field_radii / std::sqrt(std::min(1.f, slope));
  return radii > 0 && !is_sphere ? std::max(radii, pixelsPerSlope(rules)) : radii;
}

// The axis that directions weigh about: the normal, or the view mirrored at it. Unit; without a
// normal something.
inline glm::vec3 lobeAxis(const LocalReceiver& receiver, const GatherRules& rules) {
  if (receiver.isSpherical()) return {1, 0, 0};
  if (!rules.isGlossy()) return receiver.normal;
  const glm::vec3 view =
      receiver.view != glm::vec3(0) ? receiver.view : receiver.position - rules.eye;
  const float length = glm::length(view);
  if (!(length > 0)) return receiver.normal;
  const glm::vec3 mirrored =
      view / length - 2 * glm::dot(view / length, receiver.normal) * receiver.normal;
  return mirrored / glm::length(mirrored);
}

// How directions weigh by the cosine of their angle to an axis, the normal or the reflection
// (packet_integral-inl.h).
class DirectionWeights {
 public:
  // `pixel`: angle of a pixel of the raster; the edge of a cone fades over as much.
  DirectionWeights(const GatherRules& rules, float pixel) {
    exponent_ = rules.isGlossy() ? lobeExponent(rules.weights.roughness) : 0;
    is_cosine_ =
        !rules.isGlossy() && rules.weights.distribution == GatherWeights::Distribution::kCosine;
    if (rules.hasCone()) {
      edge_cosine_ = std::cos(rules.weights.cone_angle);
      edge_slope_ = 1 / (pixel * std::sin(rules.weights.cone_angle));
    }
  }

  bool isPlainCosine() const { return is_cosine_ && edge_slope_ == 0; }
  bool isCosine() const { return is_cosine_; }
  float exponent() const { return exponent_; }
  float edgeCosine() const { return edge_cosine_; }
  float edgeSlope() const { return edge_slope_; }  // 0: no cone

 private:
  bool is_cosine_ = true;
  float exponent_ = 0, edge_cosine_ = 0, edge_slope_ = 0;
};

}  // namespace surfeit
