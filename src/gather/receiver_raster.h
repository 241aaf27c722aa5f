// The raster of one receiver, filled from nodes and surfels in any order: collects what they
// contribute, sorts it by distance, draws it front to back and integrates (memo 3.4 and 3.5). The
// cut and the brute-force reference both end here, so they differ by their cut alone.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <limits>
#include <span>
#include <vector>

#include "gather/contribution.h"
#include "gather/raster_cube.h"
#include "octree/node.h"
#include "surfeit/gather.h"
#include "surfeit/surfel.h"

namespace surfeit {

// The place being lit. Without a normal (zero) it gathers over the whole sphere, every direction
// with weight 1 instead of the cosine; there is no horizon then and no bias.
struct Receiver {
  glm::vec3 position{0};  // finite
  glm::vec3 normal{0};    // unit length or zero

  bool isSpherical() const { return normal == glm::vec3(0); }
};

// Height of a point above the receiver's horizon; infinite for a spherical receiver, which has
// none. `offset` leads from the receiver to the point.
inline float heightAboveHorizon(const Receiver& receiver, const glm::vec3& offset) {
  return receiver.isSpherical() ? std::numeric_limits<float>::infinity()
                                : glm::dot(offset, receiver.normal);
}

struct GatherResult {
  // Covered part of the hemisphere by cosine, or of the sphere; 0..1.
  float occlusion = 0;
  // With kBleeding, E = pi * mean radiance = mean radiosity, by the same weights; else zero.
  glm::vec3 irradiance{0};
};

// One thread at a time. Room for kReservedContributions is there from the start, far more than
// cuts with a sensible max_solid_angle have (hundreds to thousands). It grows for the most
// demanding receiver so far and is kept, so that a steady state does not allocate. With a
// max_solid_angle of 0 every surfel above the horizon contributes, and that memory is the caller's
// to budget.
class ReceiverRaster {
 public:
  static constexpr std::size_t kReservedContributions = 8192;
  static constexpr std::size_t kReservedNearSurfels = 2048;

  // `quality` must be valid, as for PointGatherer.
  ReceiverRaster(GatherMode mode, const GatherQuality& quality);
  ReceiverRaster(const ReceiverRaster&) = delete;
  ReceiverRaster& operator=(const ReceiverRaster&) = delete;

  // Starts over for a receiver.
  void begin(const Receiver& receiver);

  // Adds a node as a whole: the far field. The receiver must lie outside the node's radius.
  void addNode(const Node& node);
  // Adds a surfel: the mid or the near field, or nothing when it cannot be seen.
  void addSurfel(const Surfel& surfel);

  // Draws everything added since begin() and integrates.
  GatherResult finish();

  const Receiver& receiver() const { return receiver_; }
  // Contributions added since begin(), and near surfels among them.
  std::size_t contributionCount() const { return contributions_.size(); }
  std::size_t nearSurfelCount() const { return near_surfels_.size(); }

  // Bytes that a raster of this quality holds from the start.
  static std::size_t memoryBytes(const GatherQuality& quality);

 private:
  struct Entry {
    Contribution contribution;     // near surfels: distance and radius, the rest is zero
    std::int32_t near_index = -1;  // in near_surfels_, or -1
  };
  void sortByDistance();
  bool isLessContent(const Entry& a, const Entry& b) const;
  float rayBias(const Surfel& surfel) const;
  void trace(const Surfel& surfel, const DepthRange& depth);
  GatherResult integrate() const;

  GatherQuality quality_;
  ContributionRules rules_;
  float max_distance_sq_;
  RasterGeometry geometry_;
  RasterCube cube_;
  Receiver receiver_;
  bool is_spherical_ = true;
  std::vector<Entry> contributions_;
  std::vector<Surfel> near_surfels_;
  std::vector<std::uint64_t> order_;  // [ distance_sq as bits : 32 | index : 32 ]
};

}  // namespace surfeit
