#include "sample/surfel_maker.h"

#include <algorithm>
#include <limits>

#include "core/long_side.h"

namespace surfeit {

Surfel SurfelMaker::make(std::uint32_t triangle, const PiecePart& part, std::uint64_t seed,
                         float& there) const {
  const SurfacePoint point =
      surfacePoint(mesh_, triangle, float(part.weight.y), float(part.weight.z));
  Surfel surfel;
  surfel.position = glm::vec3(part.centroid);
  surfel.normal = point.normal;
  surfel.radius = float(part.radius * (1 + 1e-6));  // still circumscribes after rounding
  surfel.area = std::max(float(part.area), std::numeric_limits<float>::min());  // never 0
  surfel.albedo = point.albedo;
  if (light_ != nullptr) surfel.radiosity = light_->exitance(point, seed, light_->samples());
  const Material& material = mesh_.materials[mesh_.triangle_material[triangle]];
  const glm::vec3& opacity = material.opacity;
  const int most = opacity.r >= std::max(opacity.g, opacity.b) ? 0 : opacity.g >= opacity.b ? 1 : 2;
  there = opacity[most] > 0 ? point.opacity[most] / opacity[most] : 0;
  surfel.group = material.group;
  if (opacity != glm::vec3(1)) {
    surfel.setOpacity(double(opacity.r), double(opacity.g), double(opacity.b));
  }
  if (is_two_sided_ || material.is_two_sided) showBothSides(point, seed, part, surfel);
  return surfel;
}

// What has two sides has one radiosity, the mean of both.
void SurfelMaker::showBothSides(SurfacePoint point, std::uint64_t seed, const PiecePart& part,
                                Surfel& surfel) const {
  surfel.flags |= kSurfelTwoSided;
  setLongSide(glm::vec3(part.long_side), surfel);
  if (light_ == nullptr) return;
  point.normal = -point.normal;
  point.geometric_normal = -point.geometric_normal;
  const glm::vec3 back = light_->exitance(point, seed, light_->samples());
  surfel.radiosity = 0.5f * (surfel.radiosity + back);
}

void SurfelMaker::applyMasks(const std::vector<float>& there, std::size_t begin,
                             SurfelBatch& batch) const {
  if (mesh_.isOpaque()) return;
  std::size_t kept = begin;
  for (std::size_t i = begin; i < batch.surfels.size(); ++i) {
    const float part = there[i - begin];
    if (!(part > 0)) continue;
    batch.surfels[kept] = batch.surfels[i];
    batch.surfels[kept].area *= part;
    ++kept;
  }
  batch.clear += batch.surfels.size() - kept;
  batch.surfels.resize(kept);
}

}  // namespace surfeit
