// Which packets of a group are gathered, and what the others get (memo 7.7; slides, "Optimization:
// interpolation"; app note 2.2). docs/many_gathers.md, "Interpolation".
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "gather/cut/packet_cluster.h"
#include "gather/packet/packet_fit.h"
#include "gather/rules/gather_rules.h"
#include "gather/rules/interpolation_limits.h"
#include "surfeit/gather.h"

namespace surfeit {

// Clusters whose receivers are interpolated together. Runs are whole groups.
inline constexpr std::size_t kGroupClusters = 16;
inline constexpr std::size_t kGroupReceivers = kGroupClusters * kClusterReceivers;
inline constexpr std::size_t kGroupPackets = kGroupClusters * kClusterPackets;

// One thread at a time. It allocates nothing after it is made.
class PacketInterpolation {
 public:
  // `rules` must be valid, with a max variation over 0.
  explicit PacketInterpolation(const GatherRules& rules);

  // Starts over with 1 to kGroupClusters clusters; all but the last are full.
  void begin(std::span<const PacketCluster> clusters);
  // Packets of the group to gather at next, in ascending order; kClusterPackets of them are a
  // cluster. None: all results are there. `results` are those of the group's receivers, by cluster
  // and place, of which packets that were asked for have their results; others are filled in.
  std::span<const std::uint16_t> next(std::span<GatherResult> results);

  // Receivers interpolated since begin().
  std::size_t interpolatedCount() const { return interpolated_count_; }

  // Bytes that it holds beside itself.
  static std::size_t memoryBytes(const GatherRules& rules);

 private:
  static constexpr std::size_t kMostOutputs = 8;
  using PerOutput = std::array<float, kMostOutputs>;

  enum class State : std::uint8_t { kOpen, kChosen, kSample, kInterpolated };
  enum class Foretold : std::uint8_t { kUnknown, kYes, kNo };
  struct Packet {
    FitPoint middle;
    glm::vec3 normal{0};                 // mean; zero: without normals
    std::uint16_t begin = 0, count = 0;  // of points_, places_ and rows
    State state = State::kOpen;
    bool is_mixed = false;  // of receivers with and without normals
    // Of samples
    Foretold foretold = Foretold::kUnknown;
    PerOutput brightest{};  // scale of each output, for errors are relative
    PerOutput error{};      // of each output, were it foretold by the others
  };
  // Samples around a packet, nearest first.
  struct Near {
    std::size_t count = 0;
    float reach = 0;
    std::array<std::uint16_t, kInterpolation.most_samples> packets;
    std::array<float, kInterpolation.most_samples> weights;
  };

  void addPacket(std::span<const LocalReceiver> receivers, std::span<const std::uint16_t> places,
                 std::size_t cluster);
  void takeSamples(std::span<const GatherResult> results);
  void interpolateOpen(std::span<GatherResult> results);
  bool interpolate(Packet& packet, std::span<GatherResult> results);
  void chooseSamples(std::size_t size);
  Near findNear(std::size_t packet) const;
  bool resemble(const Packet& a, const Packet& b, const glm::vec3& offset, float distance_sq) const;
  // The fit about a packet; whether it holds at all receivers there.
  bool fit(const Packet& about, const Near& near);
  void valueAt(std::size_t point, float* row) const;
  PerOutput brightestOf(std::span<const float> rows) const;
  void foretell(std::size_t sample);
  bool isWithin(const Near& near, const PerOutput& brightest);

  const GatherRules rules_;
  const float axis_scale_;
  const std::size_t channels_;  // floats of a row

  // Packet by packet
  std::vector<FitPoint> points_;
  std::vector<std::uint16_t> places_;  // in the results of the group
  std::vector<float> rows_;            // packed results, of samples
  std::vector<float> guess_;           // packed results of a packet

  std::vector<Packet> packets_;
  std::vector<std::uint16_t> samples_, chosen_;
  std::size_t cell_ = 0;  // packets of the cells that are chosen from next
  std::size_t interpolated_count_ = 0;
  PacketFit fit_;
};

}  // namespace surfeit
