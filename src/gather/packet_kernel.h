// The inner loops of the packet raster, in vectors of whatever width this machine has (Highway).
// Results of different instruction sets agree within 1e-4 of occlusion and relative irradiance:
// sums are rounded differently. Of one instruction set they are the same bit for bit.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>

#include "gather/raster_cube.h"
#include "gather/receiver.h"
#include "surfeit/gather.h"
#include "surfeit/surfel.h"

namespace surfeit {

// What a patch shows to whom.
enum class PatchKind : std::uint32_t {
  kRound,     // the same area to everyone, and light: rough nodes, spheres
  kFront,     // a disk that is seen from its front
  kTwoSided,  // a disk that is seen and sends light on both sides
  kDarkBack,  // a disk that is seen on both sides and sends light from its front
};

// A node or surfel of the cut, ready for the lanes. 64 bytes.
struct Patch {
  glm::vec3 position{0};
  float radius = 0;
  glm::vec3 normal{0};  // of a node: times its flatness; zero: looks round
  float area = 0;       // seen head-on; of kRound: seen at all
  glm::vec3 radiosity{0};
  float most_area = 0;  // that it shows at any angle
  PatchKind kind = PatchKind::kRound;
  float near_distance = 0;  // closer than this it is ray traced; 0: a node, which never is
  std::array<std::uint32_t, 2> reserved{};
};
static_assert(sizeof(Patch) == 64);

// The receivers as columns, one per lane; lanes without a receiver repeat the last one.
struct alignas(64) PacketLanes {
  std::array<float, kPacketReceivers> x, y, z, normal_x, normal_y, normal_z;
  std::array<float, kPacketReceivers> spherical;  // 1: no normal, sees the whole sphere; else 0
};

// Where a packet is drawn: 16 raster cubes interleaved by pixel. A pixel has 16 lanes each of room,
// layer and the layer's end (RasterCube::Coverage), and with color of red, green and blue.
struct PacketCanvas {
  static constexpr std::size_t kCoverageChannels = 3, kColorChannels = 3;
  static constexpr std::size_t pixelFloats(bool has_color) {
    return (kCoverageChannels + (has_color ? kColorChannels : 0)) * kPacketReceivers;
  }

  const PacketLanes* lanes;
  const RasterGeometry* geometry;
  bool has_color;
  float bias;             // of rays, in radii of the surfel
  float max_distance_sq;  // may be infinite
  glm::vec3 centre;       // of the packet
  float packet_radius;
  float* pixels;  // aligned to 64 bytes
  // Faces that were drawn to; the pixels of others hold nothing of this packet.
  std::array<bool, RasterGeometry::kFaces>* is_face_used;
};

struct PacketKernel {
  const char* name;  // of the instruction set
  // Whether any receiver sees something of the patch, which stands for a surfel.
  bool (*isSeen)(const PacketCanvas& canvas, const Patch& patch);
  // Draws patches in this order: [ ignored : 32 | index : 32 ].
  void (*draw)(const PacketCanvas& canvas, const Patch* patches,
               std::span<const std::uint64_t> order);
  void (*integrate)(const PacketCanvas& canvas, std::span<GatherResult> results);
};

// For the fastest instruction set of this machine.
const PacketKernel& fastestPacketKernel();
// For all that this machine has and the build knows, for tests and benches.
std::span<const PacketKernel> packetKernels();

}  // namespace surfeit
