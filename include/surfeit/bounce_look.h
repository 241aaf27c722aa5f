// Controls of the look of bounce light, for art direction: a color correction of all of it, one for
// what each object group reflects, and filters by place and direction (course, "GI in Animated Film
// Production"). bounceScene (surfeit/bounce.h) applies them at its surfels, gatherCloud
// (surfeit/bake.h) at its receivers. All are off by default. Plain data.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <limits>
#include <vector>

#include "surfeit/api.h"
#include "surfeit/status.h"

namespace surfeit {

// C(E) = gain * tint * max(0, Y + saturation * (E - Y)), Y: luminance of E (Rec. 709). Luminance
// does not depend on the saturation, but where a color is cut off at 0.
struct ColorCorrection {
  float gain = 1;        // 0 to 1e6
  float saturation = 1;  // 0: grey; 1: as it is; more: stronger colors; up to 1e6
  glm::vec3 tint{1};     // factors of red, green and blue, 0 to 1e6

  bool isOff() const { return gain == 1 && saturation == 1 && tint == glm::vec3(1); }
};

// A filter corrects bounce light within its reach: mix(E, C(E), w), w = w_place * w_angle. Both
// fall smoothly from 1 to 0: with t = (outer - x) / (outer - inner), cut to 0..1, w = t^2 (3 - 2t).
// Where both ends are equal, w is 1 up to them and 0 beyond.
struct BounceFilter {
  ColorCorrection correction;
  // x: distance to a centre, in scene units; the default is everywhere.
  glm::dvec3 centre{0};
  float inner_radius = std::numeric_limits<float>::infinity();
  float outer_radius = std::numeric_limits<float>::infinity();
  // x: angle between the normal of what is lit and a direction, in radians; a direction of length
  // 0, the default, is all of them. A filter with a direction leaves what has no normal as it is.
  // What has two sides gets the mean weight of both.
  glm::vec3 direction{0};
  float inner_angle = 0;  // 0 to pi
  float outer_angle = 0;  // inner_angle to pi
};

// The correction comes first, then the filters in their order.
struct BounceLook {
  ColorCorrection correction;
  std::vector<BounceFilter> filters;  // at most 1000

  bool isOff() const { return correction.isOff() && filters.empty(); }
};

// What surfels of an object group reflect.
struct GroupCorrection {
  std::uint32_t group = 0;  // 0 to kMaxGroups - 1 (surfeit/surfel.h)
  ColorCorrection correction;
};

}  // namespace surfeit
