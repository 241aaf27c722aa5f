#include "view/value_map.h"

#include <fmt/format.h>

namespace surfeit {
namespace {

// Maps [low, high] to [0, 1]; a range without width becomes mid-grey.
ValueMap stretch(double low, double high) {
  if (low == high) return {glm::vec3(0), glm::vec3(0.5f)};
  const double scale = 1 / (high - low);
  return {glm::vec3(float(scale)), glm::vec3(float(-low * scale))};
}

}  // namespace

ValueMap chooseValueMap(const std::optional<glm::dvec2>& range, const Channel& channel,
                        const ValueExtent& extent, PictureFormat format, Progress& progress) {
  if (range) return stretch(range->x, range->y);
  if (format == PictureFormat::kExr) return {};
  switch (channel.kind()) {
    case ValueKind::kLight:
      return {};
    case ValueKind::kScalar:
      if (!(extent.lowest <= extent.highest)) return {};
      progress.inform(fmt::format("channel {}: black is {:.6g}, white is {:.6g}", channel.name(),
                                  extent.lowest, extent.highest));
      return stretch(extent.lowest, extent.highest);
    case ValueKind::kNormal:
      return stretch(-1, 1);
    case ValueKind::kPosition: {
      const glm::dvec3 size = extent.bounds.extent();
      const double scale = 1 / std::max({size.x, size.y, size.z, 1e-30});
      return {glm::vec3(float(scale)), glm::vec3(-scale * extent.bounds.min)};
    }
  }
  return {};
}

}  // namespace surfeit
