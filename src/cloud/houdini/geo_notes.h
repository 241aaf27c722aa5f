// What a cloud of Houdini's points leaves behind.
#pragma once

#include <fmt/format.h>

#include <cstdint>
#include <string>

namespace surfeit {

// Empty for none. Particles are such a primitive, too.
inline std::string noteOfGeoPrimitives(std::uint64_t primitives) {
  if (primitives == 0) return {};
  return fmt::format(
      "{} primitives (polygons, curves, particles ...) are not kept: the points alone are the "
      "cloud; "
      "sample reads curves",
      primitives);
}

}  // namespace surfeit
