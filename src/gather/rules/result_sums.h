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
inline GatherResult resultOf(const GatherResult& sums, float weight, const GatherRules& rules,
                             bool is_spherical) {
  const auto unit = [](const glm::vec3& v) {
    const float length = glm::length(v);
    return length > 0 ? v / length : glm::vec3(0);
  };
  const float inverse = weight > 0 ? 1 / weight : 0;
  GatherResult result;
  if (rules.has(kOutputOcclusion)) result.occlusion = sums.occlusion * inverse;
  if (rules.has(kOutputIrradiance)) result.irradiance = sums.irradiance * inverse;
  if (rules.has(kOutputBentNormal)) result.bent_normal = unit(sums.bent_normal);
  if (rules.has(kOutputIlluminationDirection)) {
    result.illumination_direction = unit(sums.illumination_direction);
  }
  if (rules.has(kOutputEnvironment)) result.environment = sums.environment * inverse;
  // Radiosity is pi times radiance
  if (rules.has(kOutputFluence)) result.fluence = sums.fluence * ((is_spherical ? 1 : 2) / kPi);
  if (rules.has(kOutputRadianceSh)) result.radiance_sh = sums.radiance_sh;
  return result;
}

}  // namespace surfeit
