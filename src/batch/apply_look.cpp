#include "surfeit/apply_look.h"

#include <cmath>

#include "batch/bounce_look.h"
#include "core/surfel_normal.h"

namespace surfeit {

Status applyLook(const BounceLook& look, const glm::dvec3& origin, const Receiver* receivers,
                 std::size_t count, glm::vec3* irradiance) {
  SURFEIT_RETURN_IF_ERROR(checkLook(look));
  if (look.isOff()) return {};
  const BounceLook about_origin = countedFrom(look, origin);
  for (std::size_t i = 0; i < count; ++i) {
    if (std::isnan(irradiance[i].x)) continue;  // of a receiver that is not valid
    const Receiver& receiver = receivers[i];
    glm::vec3 normal;
    normalise(double{receiver.normal.x}, double{receiver.normal.y}, double{receiver.normal.z},
              normal);
    irradiance[i] =
        lookedAt(about_origin, irradiance[i], glm::vec3(receiver.position - origin), normal, false);
  }
  return {};
}

}  // namespace surfeit
