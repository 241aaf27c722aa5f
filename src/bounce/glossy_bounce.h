// Glossy bounces: the lobe around the mirror direction that a surfel sends for the light that
// arrives at it (memo 9). docs/many_gathers.md, "Glossy bounces".
#pragma once

#include <array>
#include <glm/vec3.hpp>
#include <vector>

#include "octree/node/lobe.h"
#include "surfeit/bounce.h"
#include "surfeit/gather.h"
#include "surfeit/status.h"

namespace surfeit {

// Narrower lobes than of this roughness are narrower than what a raster and surfels resolve.
inline constexpr float kLeastGloss = 0.05f;

// Of a group.
struct Gloss {
  float share = 0;        // of what is reflected
  float mean_cosine = 0;  // of the lobe's directions with its axis
};
using GlossOfGroup = std::array<Gloss, kMaxGroups>;

// kInvalidArgument names the value that is out of range, or the group that is there twice.
Status checkGlossy(const std::vector<GroupGloss>& glossy);
GlossOfGroup glossByGroup(const std::vector<GroupGloss>& glossy);

// The largest solid angle of nodes, in steradians, that shows the narrowest of these lobes well;
// infinite without any. A node has one lobe, so it must be small beside it: a fourth of the
// solid angle that cos^n fills, which is nearly pi roughness^2.
float lobeNodeAngle(const std::vector<GroupGloss>& glossy);

// Luminance of the light that arrives, over all directions, and the same times the direction: of
// the harmonics of what arrives.
struct ArrivingLight {
  float around = 0;
  glm::vec3 towards{0};
};
ArrivingLight arrivingLight(const std::array<glm::vec3, 9>& radiance_sh);

// `sent`: what the surfel reflects, `radiosity`: that and all else that it sends.
Lobe mirrorLobe(const Gloss& gloss, const ArrivingLight& light, const glm::vec3& normal,
                const glm::vec3& sent, const glm::vec3& radiosity);

}  // namespace surfeit
