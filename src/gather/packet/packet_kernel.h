// The inner loops of the packet raster, in vectors of whatever width this machine has (Highway).
// Results of different instruction sets agree within 1e-4 of occlusion and relative irradiance, and
// within 3e-3 for two of 1000 receivers: sums are rounded differently, and rounding decides whether
// patches that hardly meet are of one thing. Of one instruction set they are the same bit for bit.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "core/symmetric_matrix.h"
#include "gather/cut/cut.h"
#include "gather/rules/contribution.h"
#include "gather/rules/coverage_rules.h"
#include "gather/rules/gather_rules.h"
#include "gather/rules/lobe_light.h"
#include "gather/rules/raster_geometry.h"
#include "gather/rules/receiver.h"
#include "octree/node/node.h"
#include "surfeit/cube.h"
#include "surfeit/gather.h"
#include "surfeit/surfel.h"

namespace surfeit {

class PixelRecorder;
struct PixelContent;

// A node or surfel of the cut, ready for the lanes. Two lines of a cache: they are drawn in another
// order than they are made in.
struct alignas(64) Patch {
  glm::vec3 position{0};
  float radius = 0;     // of a facet: the root of three times the trace of its covariance
  glm::vec3 normal{0};  // of a node: times its flatness; zero: looks round
  // How it spreads, a covariance of trace 2: of a disk I - n n^T, of a sphere the identity
  SymmetricMatrix shape{};
  float area = 0;  // all of it, whatever shows
  // The area that it shows: disk_area times the cosine, plus round_area, which everyone sees
  float disk_area = 0, round_area = 0;
  float most_area = 0;  // and no more than this
  // Of a facet that some receiver may see at its rim: normalRange, by which disk_area shows more
  float range = 0;
  float opacity = 1;      // what it hides of what it covers, itself behind itself left out: 0..1
  float filled = 1;       // of its outline in pixels: less of a tile that is larger than its area
  float clear = 0;        // what shows through a layer of it; 0: opaque, or alone
  bool has_gaps = false;  // it is a fence: nothing closes what it leaves open
  // A tile of a surface, of which the hull is widened; spheres, leaves and rough nodes may stand
  // alone
  bool is_solid = true;
  bool is_spread = false;   // a facet that may have gaps: it is spread evenly over its outline
  bool is_layered = false;  // another sheet lies close before or behind it
  bool is_ribbon = false;   // a ray traced surfel is a rectangle, not a disk
  bool is_alone = false;    // it belongs to no thing, but hides at random: a leaf, a drop of smoke
  bool is_hull = false;     // it covers nothing, but closes what others leave open
  // From where it is seen: before its front alone; from both sides of a two-sided disk or facet;
  // from both, though it sends light from its front alone; or as something else says
  enum class Seen : std::uint8_t { kFront, kBoth, kDarkBack, kAllAround };
  Seen seen = Seen::kFront;
  CubeKind kind = CubeKind::kPatch;  // of what it stands for
  std::uint32_t parts = 0;   // place in PacketCanvas::parts of what counts of the opacity; 0: all
  std::uint32_t lights = 0;  // place in PacketCanvas::lights; 0: it sends evenly
  glm::vec3 radiosity{0};    // in all directions together
  float near_distance = 0;   // closer than this it is ray traced; 0: a node, which never is
  float reach = 0;           // how far before and behind its middle it meets others
  union {
    float soft_peak = 0;  // of a disk, as it is ray traced: softDiskPeak
    float ribbon_width;   // of a ribbon
    float layers;         // of a node: how many it is behind itself
  };

  bool isRound() const { return disk_area == 0; }
  bool isNode() const { return near_distance == 0; }
  bool showsBoth() const { return seen == Seen::kBoth || seen == Seen::kDarkBack; }
};
static_assert(sizeof(Patch) == 128);

// How much of a patch counts for each receiver.
struct alignas(64) PacketParts {
  LaneParts of;
};

// The radiosity of a patch with a lobe as each receiver sees it: red, green and blue of all.
struct alignas(64) PacketLights {
  std::array<std::array<float, kPacketReceivers>, 3> colors;
  const float* of(std::size_t lane) const { return colors[0].data() + lane; }
};

// The receivers as columns, one per lane; lanes without a receiver repeat the last one.
struct alignas(64) PacketLanes {
  std::array<float, kPacketReceivers> x, y, z, normal_x, normal_y, normal_z;
  std::array<float, kPacketReceivers> spherical;  // 1: no normal, sees the whole sphere; else 0
  // Axes of the frames of cones (ConeFrame), x y z of each; of a cube, the first is the lobe's.
  std::array<std::array<float, kPacketReceivers>, 9> frame;
};

// The pixels that count: those that some receiver has above its horizon. Nothing else is drawn, or
// looked at.
struct SeenPixels {
  struct Columns {
    std::uint8_t begin = 0, end = 0;
  };
  struct Face {
    int row_begin = 0, row_end = 0;
    std::array<Columns, RasterGeometry::kMaxResolution> rows;
    bool isEmpty() const { return row_begin == row_end; }
    // Calls visit(pixel) with their places on a face of this resolution.
    template <typename Visit>
    void forEachPixel(std::size_t resolution, const Visit& visit) const {
      for (auto row = std::size_t(row_begin); row < std::size_t(row_end); ++row) {
        const auto [begin, end] = rows[row];
        for (std::size_t column = begin; column < end; ++column) visit(row * resolution + column);
      }
    }
  };
  std::array<Face, RasterGeometry::kFaces> faces;
};

// Where a packet is drawn: 16 rasters, interleaved by pixel as many at a time as a vector holds
// (FaceLanes). A pixel has room, what is open of it and of its weight; with color red, green and
// blue; the faded coverage, when occlusion fades; then things (FaceThings), and what was left and
// seen before the last one.
struct PacketCanvas {
  // Places: what all but the last thing leave open; what is open; and what is open of the weight
  static constexpr std::size_t kRoom = 0, kOpen = 1, kRest = 2;
  static constexpr std::size_t kCoverageChannels = 3, kThingChannels = 6;
  static constexpr std::size_t kTranslucentChannels = 4;  // where something is
  static std::size_t channels(const GatherRules& rules, bool is_translucent) {
    return kCoverageChannels + kThingChannels + 2 * rules.channels() +
           (is_translucent ? kTranslucentChannels : 0);
  }

  const PacketLanes* lanes;
  std::size_t receiver_count;  // vectors of lanes without any are left out
  const GatherRules* rules;
  const RasterGeometry* geometry;
  const DirectionWeights* weights;
  float max_distance_sq;  // may be infinite
  glm::vec3 luminance;    // of the colors whose light counts in its direction
  float packet_radius;
  float* pixels;  // aligned to 64 bytes
  // Faces that were drawn to; the pixels of others hold nothing of this packet.
  std::array<bool, RasterGeometry::kFaces>* is_face_used;
  const SeenPixels* seen;
  bool is_translucent;                  // a patch may be, other than those that are alone
  const PacketParts* parts;             // of the patches
  const PacketLights* lights;           // of the patches
  PixelRecorder* recorder;              // of what the first receiver sees; null: nobody's
  std::vector<std::uint64_t>* scratch;  // of the drawing; grows
};

struct RoughSight {
  FacingAreas facing;
  glm::vec3 radiosity;  // of the fronts that face the receivers
};

// An entry of the order: one patch on one face of the cube, [ face : 3 | distance : 29 | index of
// the patch : 32 ]. Faces are drawn one after the other, because the pixels of one face of 16
// receivers fit a near cache. `distance` is the upper part of the squared distance's bits,
// which sort like the distance.
namespace draw_order {
inline std::uint64_t key(int face, float distance_sq, std::uint32_t index) {
  const std::uint64_t distance = std::bit_cast<std::uint32_t>(distance_sq) >> 2;
  return static_cast<std::uint64_t>(face) << 61 | distance << 32 | index;
}
// Its bits of the distance.
inline std::uint64_t distance(std::uint64_t key) { return key << 3 >> 35; }
inline int face(std::uint64_t key) { return static_cast<int>(key >> 61); }
inline std::uint32_t index(std::uint64_t key) { return static_cast<std::uint32_t>(key); }
}  // namespace draw_order

struct PacketKernel {
  const char* name;  // of the instruction set
  void (*findSeenPixels)(const PacketCanvas& canvas, SeenPixels& seen);
  // The faces on which some receiver may see something of the patch, as bits; of a cone's raster
  // the first.
  std::uint32_t (*facesThatSee)(const PacketCanvas& canvas, const Patch& patch);
  // What the receivers see of a patch with this lobe.
  void (*seeLobe)(const PacketLanes& lanes, std::size_t receiver_count, const Patch& patch,
                  const LobeLight& lobe, PacketLights& lights);
  // How much brighter they see a facet with these slopes of colors, in world axes, and this range
  // of normals, than its mean: times what `lights` holds.
  void (*seeSlope)(const PacketLanes& lanes, std::size_t receiver_count, const Patch& patch,
                   const std::array<glm::vec3, 3>& slopes, float range, PacketLights& lights);
  // What the receivers see of a rough node in unit direction `direction` from them.
  void (*seeRoughNode)(const Node& node, const glm::vec3& direction, RoughSight& sight);
  // Draws patches in this order, all of one face after those of another.
  void (*draw)(const PacketCanvas& canvas, const Patch* patches,
               std::span<const std::uint64_t> order);
  void (*integrate)(const PacketCanvas& canvas, std::span<GatherResult> results);
  // What the first receiver has in its pixels.
  void (*readPixels)(const PacketCanvas& canvas, std::span<PixelContent> pixels);
};

// For the fastest instruction set of this machine.
const PacketKernel& fastestPacketKernel();
// For all that this machine has and the build knows, for tests and benches.
std::span<const PacketKernel> packetKernels();

}  // namespace surfeit
