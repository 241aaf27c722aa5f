// The raster of one receiver, filled from nodes and surfels in any order: collects what they
// contribute, sorts it by distance, draws it front to back and integrates (memo 3.4 and 3.5). The
// cut and the brute-force reference both end here, so they differ by their cut alone.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "gather/rules/contribution.h"
#include "gather/rules/gather_rules.h"
#include "gather/rules/receiver.h"
#include "gather/rules/result_sums.h"
#include "gather/scalar/raster_cube.h"
#include "octree/node/node.h"
#include "surfeit/cube.h"
#include "surfeit/gather.h"
#include "surfeit/surfel.h"

namespace surfeit {

// One thread at a time. Room for kReservedContributions is there from the start, far more than
// cuts with a sensible max_solid_angle have (hundreds to thousands). It grows for the most
// demanding receiver so far and is kept, so that a steady state does not allocate. With a
// max_solid_angle of 0 every surfel above the horizon contributes, and that memory is the caller's
// to budget.
class ReceiverRaster {
 public:
  static constexpr std::size_t kReservedContributions = 8192;
  static constexpr std::size_t kReservedNearSurfels = 2048;

  // `rules` must be valid, as for PointGatherer.
  explicit ReceiverRaster(const GatherRules& rules);
  ReceiverRaster(const ReceiverRaster&) = delete;
  ReceiverRaster& operator=(const ReceiverRaster&) = delete;

  // Starts over for a receiver.
  void begin(const LocalReceiver& receiver);

  // Adds a node as a whole: the far field. The receiver must lie outside the node's radius.
  void addNode(const Node& node, float part = 1);
  // Adds a surfel: the mid or the near field, or nothing when it cannot be seen.
  void addSurfel(const Surfel& stored, float part = 1);

  // Draws everything added since begin() and integrates.
  GatherResult finish();

  // Tells it what the pixels get, from the next finish() on; null, as at first: nobody. It must
  // outlive the raster, or be taken away before.
  void setRecorder(PixelRecorder* recorder);
  const RasterGeometry& geometry() const { return geometry_; }
  // Of a cone raster.
  const ConeFrame& frame() const { return frame_; }
  // A pixel of what was drawn last, as finish() integrated it.
  ResultSums::Pixel pixel(std::size_t i) const;

  const LocalReceiver& receiver() const { return receiver_; }
  // Contributions added since begin(), and near surfels among them.
  std::size_t contributionCount() const { return contributions_.size(); }
  std::size_t nearSurfelCount() const { return near_surfels_.size(); }

  // Bytes that a raster of this quality holds from the start.
  static std::size_t memoryBytes(const GatherQuality& quality);

 private:
  struct Entry {
    Contribution contribution;     // near surfels: distance and radius, the rest is zero
    std::int32_t near_index = -1;  // in near_surfels_, or -1
    CubeKind kind = CubeKind::kNothing;
  };
  template <typename NodeOrFacet>
  void addPatch(const NodeOrFacet& source, CubeKind kind, float part);
  void sortByDistance();
  bool isLessContent(const Entry& a, const Entry& b) const;
  float rayBias(const Surfel& surfel) const;
  bool showsTracedSide(const Surfel& surfel, const glm::vec3& centre) const;
  // In the frame of the raster.
  template <typename T>  // a vector, or a shape
  T inRaster(const T& v) const {
    return has_frame_ ? frame_.toLocal(v) : v;
  }
  void trace(const Surfel& surfel, float part, const DepthRange& depth);
  GatherResult integrate() const;

  const GatherRules rules_;
  const ContributionRules contribution_rules_;
  const float near_disk_radii_, near_sphere_radii_;
  float max_distance_sq_;
  const bool has_frame_;
  RasterGeometry geometry_;
  DirectionWeights weights_;
  ConeFrame frame_;
  RasterCube cube_;
  PixelRecorder* recorder_ = nullptr;
  LocalReceiver receiver_;
  bool is_spherical_ = true;
  glm::vec3 axis_{1, 0, 0};  // lobeAxis
  std::vector<Entry> contributions_;
  std::vector<Surfel> near_surfels_;
  std::vector<std::uint64_t> order_;  // [ distance_sq as bits : 32 | index : 32 ]
};

}  // namespace surfeit
