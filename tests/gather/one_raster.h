// The raster of one receiver that tests draw patches to.
#pragma once

#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <vector>

#include "core/spherical_harmonics.h"
#include "gather/cut/cut.h"
#include "gather/packet/packet_raster.h"
#include "gather/packet/pixel_record.h"
#include "gather/rules/gather_rules.h"

namespace surfeit {

inline constexpr glm::vec3 kRound{0};  // the normal of what looks the same from everywhere
inline constexpr glm::vec3 kWhite{1};

// A patch that shows the same solid angle from everywhere, and lies between two distances.
// `spread`: its area over its squared distance.
inline Patch patchAt(const glm::vec3& direction, const glm::vec3& normal, float solid_angle,
                     float spread = 0, float begin = .9f, float end = 1.1f) {
  const float distance = .5f * (begin + end), square = distance * distance;
  Patch patch;
  patch.position = distance * direction;
  patch.radius = std::sqrt(solid_angle) * distance;
  patch.normal = normal;
  patch.shape = withoutDirection(normal);
  patch.area = spread * square;
  patch.round_area = patch.most_area = solid_angle * square;
  patch.reach = .5f * (end - begin);
  patch.radiosity = kWhite;
  patch.seen = Patch::Seen::kAllAround;
  return patch;
}

// The raster of a receiver at the origin, with all directions alike.
class OneRaster {
 public:
  explicit OneRaster(int resolution, const glm::vec3& normal = kRound)
      : rules_(rulesOf(resolution)), raster_(rules_), receiver_{glm::vec3(0), normal} {
    clear();
  }

  void clear() {
    raster_.begin({&receiver_, 1}, viewPacket({&receiver_, 1}, rules_));
    pixels_.clear();
  }
  void add(const Patch& patch) {
    raster_.addPatch(patch);
    pixels_.clear();
  }
  std::size_t size() const { return raster_.geometry().pixels().size(); }
  float solidAngle(std::size_t pixel) const {
    return raster_.geometry().pixels()[pixel].solid_angle;
  }
  float coverage(std::size_t pixel) { return pixels()[pixel].coverage; }
  glm::vec3 radiosity(std::size_t pixel) { return pixels()[pixel].radiosity; }
  const RasterGeometry& geometry() const { return raster_.geometry(); }

  // Covered solid angle of the whole cube.
  double coveredSolidAngle() {
    double sum = 0;
    for (std::size_t i = 0; i < size(); ++i) sum += double(coverage(i)) * double(solidAngle(i));
    return sum;
  }

 private:
  static GatherRules rulesOf(int resolution) {
    GatherQuality quality;
    quality.raster_resolution = resolution;
    quality.bias = 0;
    GatherRules rules(GatherMode::kBleeding, quality);
    rules.weights.distribution = GatherWeights::Distribution::kUniform;
    return rules;
  }
  // Drawn when it is looked at.
  const std::vector<PixelContent>& pixels() {
    if (!pixels_.empty()) return pixels_;
    pixels_.resize(size());
    raster_.sort();
    raster_.draw();
    raster_.readPixels(pixels_);
    return pixels_;
  }

  GatherRules rules_;
  PacketRaster raster_;
  LocalReceiver receiver_;
  std::vector<PixelContent> pixels_;
};

}  // namespace surfeit
