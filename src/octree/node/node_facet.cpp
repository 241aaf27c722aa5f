#include "octree/node/node_facet.h"

#include <algorithm>

namespace surfeit {

NodeFacet NodeFacet::encode(const Facet& facet, const glm::vec3& position, float radius,
                            float area) {
  NodeFacet codes{};
  codes.radiosity = facet.radiosity;
  for (int axis = 0; axis < 3; ++axis) {
    const auto i = static_cast<std::size_t>(axis);
    codes.normal[i] = signedCode(facet.normal[axis], 1);
    codes.offset[i] = signedFractionCode((facet.position[axis] - position[axis]) / radius);
  }
  const float part = 65535 * std::min(1.f, facet.area / area);
  codes.area = static_cast<std::uint16_t>(std::max(1.f, part + 0.5f));
  codes.covariance = covarianceCodes(facet.covariance, radius);
  codes.transparency = transparencyOf(double(facet.opacity.r));
  codes.tint = tintOf(codes.transparency, transparencyOf(double(facet.opacity.g)),
                      transparencyOf(double(facet.opacity.b)));
  return codes;
}

}  // namespace surfeit
