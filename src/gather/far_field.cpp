#include "gather/far_field.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <new>

namespace surfeit {
namespace {

// Packets tell about the place of another one by a bell curve of this many times the radius of the
// widest packet, and those whose horizon is the same: what is below a packet's own is not drawn.
// (Color of Sponza at draft quality: 1.9 % with .995, 1.3 with .9999 and without slopes.)
constexpr float kReach = 2, kSameHorizon = 0.9999f;

// Where packets lie in a line, nothing is known about the directions across.
constexpr float kLeastAcross = 0.02f;

// The two axes of the world along which the packets spread most.
std::array<int, 2> widestAxes(const PacketCluster& cluster) {
  glm::vec3 least(std::numeric_limits<float>::max()), most(-least);
  for (std::size_t i = 0; i < cluster.packetCount(); ++i) {
    if (!cluster.shares(i)) continue;
    least = glm::min(least, cluster.packet(i).centre);
    most = glm::max(most, cluster.packet(i).centre);
  }
  const glm::vec3 size = most - least;
  std::array<int, 3> axes = {0, 1, 2};
  std::stable_sort(axes.begin(), axes.end(), [&](int a, int b) { return size[a] > size[b]; });
  return {axes[0], axes[1]};
}

}  // namespace

FarField::FarField(const GatherRules& rules, const PacketKernel& kernel)
    : raster_(rules, kernel),
      pixels_(hwy::AllocateAligned<FarPixel>(kPacketReceivers * raster_.pixelCount())) {
  if (pixels_ == nullptr) throw std::bad_alloc();
  raster_.noteBegins();
}

std::size_t FarField::memoryBytes(const GatherRules& rules) {
  const std::size_t pixels = RasterGeometry::pixelCount(rules.quality.raster_resolution);
  return sizeof(FarField) - sizeof(PacketRaster) + PacketRaster::memoryBytes(rules) +
         kPacketReceivers * pixels * (sizeof(float) + sizeof(FarPixel));
}

void FarField::finish(const PacketCluster& cluster) {
  findSlopes(cluster);
  raster_.finishFarField(slopes_, pixels_.get());
}

// By least squares: the plane through what packet i sees that comes closest to what others see,
// near ones most.
void FarField::findSlopes(const PacketCluster& cluster) {
  slopes_ = {};
  slopes_.axes = widestAxes(cluster);
  slopes_.distance = cluster.farDistance();
  float width = 0;
  for (std::size_t i = 0; i < cluster.packetCount(); ++i) {
    if (cluster.shares(i)) width = std::max(width, cluster.packet(i).radius);
  }
  const float reach_sq = kReach * kReach * width * width;
  for (std::size_t i = 0; i < cluster.packetCount(); ++i) {
    if (!cluster.shares(i)) continue;
    const PacketView& packet = cluster.packet(i);
    std::array<float, kPacketReceivers> u{}, v{}, weights{};
    float uu = 0, uv = 0, vv = 0;
    for (std::size_t k = 0; k < cluster.packetCount(); ++k) {
      const Receiver& centre = cluster.centres()[k];
      const bool tells = cluster.shares(k) && (centre.isSpherical() ||
                                               glm::dot(centre.normal, packet.axis) > kSameHorizon);
      if (k == i || !tells) continue;
      const glm::vec3 offset = centre.position - packet.centre;
      u[k] = offset[slopes_.axes[0]];
      v[k] = offset[slopes_.axes[1]];
      weights[k] = std::exp(-0.5f * glm::dot(offset, offset) / reach_sq);
      uu += weights[k] * u[k] * u[k];
      uv += weights[k] * u[k] * v[k];
      vv += weights[k] * v[k] * v[k];
    }
    const float spread = uu + vv;
    if (!(spread > 1e-3f * width * width)) continue;  // nothing near enough to tell
    uu += kLeastAcross * spread;
    vv += kLeastAcross * spread;
    const float inverse = 1 / (uu * vv - uv * uv);
    for (std::size_t k = 0; k < cluster.packetCount(); ++k) {
      const float along_u = inverse * weights[k] * (vv * u[k] - uv * v[k]);
      const float along_v = inverse * weights[k] * (uu * v[k] - uv * u[k]);
      slopes_.of[0][k][i] += along_u;
      slopes_.of[1][k][i] += along_v;
      slopes_.of[0][i][i] -= along_u;
      slopes_.of[1][i][i] -= along_v;
    }
  }
}

SharedFarField FarField::of(const PacketCluster& cluster, std::size_t i) const {
  return {.pixels = pixels_.get() + i * raster_.pixelCount(),
          .is_face_used = &raster_.isFaceUsed(),
          .has_thickets = raster_.hasThickets(),
          .axes = slopes_.axes,
          .centre = cluster.packet(i).centre};
}

}  // namespace surfeit
