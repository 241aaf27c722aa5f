// Results as sums over the pixels of a raster.
#pragma once

#include <cstddef>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include "core/spherical_harmonics.h"
#include "gather/rules/gather_rules.h"
#include "gather/rules/receiver.h"

namespace surfeit {

// The result of sums over the pixels, each times the direction's weight and the solid angle; those
// of fluence and harmonics times the solid angle alone. Dividing by the sum of the weights rather
// than by pi makes a wholly covered hemisphere exactly 1, whatever the resolution.
// Directions are means, of any length.
inline GatherResult resultOf(const GatherResult& sums, float weight, const GatherRules& rules,
                             bool is_spherical) {
  const float inverse = weight > 0 ? 1 / weight : 0;
  GatherResult result;
  if (rules.has(kOutputOcclusion)) result.occlusion = sums.occlusion * inverse;
  if (rules.has(kOutputIrradiance)) result.irradiance = sums.irradiance * inverse;
  if (rules.has(kOutputBentNormal)) result.bent_normal = sums.bent_normal * inverse;
  if (rules.has(kOutputIlluminationDirection)) {
    result.illumination_direction = sums.illumination_direction * inverse;
  }
  if (rules.has(kOutputEnvironment)) result.environment = sums.environment * inverse;
  // Radiosity is pi times radiance
  if (rules.has(kOutputFluence)) result.fluence = sums.fluence * ((is_spherical ? 1 : 2) / kPi);
  if (rules.has(kOutputRadianceSh)) result.radiance_sh = sums.radiance_sh;
  return result;
}

inline void makeDirectionsUnit(GatherResult& result) {
  for (glm::vec3* const direction : {&result.bent_normal, &result.illumination_direction}) {
    const float length = glm::length(*direction);
    *direction = length > 0 ? *direction / length : glm::vec3(0);
  }
}

// Adds what a gather of one color found (docs/algorithm.md, "Tints"): of what has colors that one,
// of what has none the mean of the three. Of the illumination direction it is this color's share.
inline void addColor(const GatherResult& found, int color, GatherResult& sum) {
  sum.occlusion += found.occlusion / 3;
  sum.bent_normal += found.bent_normal / 3.f;
  sum.illumination_direction += found.illumination_direction;
  sum.irradiance[color] = found.irradiance[color];
  sum.environment[color] = found.environment[color];
  sum.fluence[color] = found.fluence[color];
  for (std::size_t i = 0; i < kShCount; ++i) {
    sum.radiance_sh[i][color] = found.radiance_sh[i][color];
  }
}

}  // namespace surfeit
