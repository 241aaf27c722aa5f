// Gathers at some receivers of many neighbours and interpolates at the others where light varies
// little (memo 7.7; slides, "Optimization: interpolation"; app note 2.2). docs/algorithm.md,
// "Interpolation".
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "gather/packet/local_fit.h"
#include "gather/packet/packet_gatherer.h"

namespace surfeit {

// Consecutive receivers of the order that are interpolated together. Runs are whole groups.
inline constexpr std::size_t kGroupReceivers = 4096;
static_assert(kGroupReceivers % kClusterReceivers == 0);

// One thread at a time; make one per thread.
class InterpolatingGatherer {
 public:
  // `rules` must be valid, with a max variation over 0.
  explicit InterpolatingGatherer(const GatherRules& rules,
                                 const PacketKernel& kernel = fastestPacketKernel());

  // Gathers at 1 to kGroupReceivers receivers, whose values must be finite; results are as many. On
  // an error results are incomplete. They depend on the scene, the receivers given together, rules
  // and instruction set alone, bit for bit.
  Status gather(std::span<const LocalReceiver> receivers, WorldReader& world,
                std::span<GatherResult> results);

  // Of one octree, in its own coordinates.
  Status gather(std::span<const LocalReceiver> receivers, PagedOctree::Reader& octree,
                std::span<GatherResult> results) {
    WorldReader world(octree);
    return gather(receivers, world, results);
  }

  // For each receiver of the last gather.
  enum class State : std::uint8_t { kOpen, kGathered, kInterpolated };
  std::span<const State> states() const { return states_; }
  // Receivers interpolated by all gathers so far.
  std::uint64_t interpolatedCount() const { return interpolated_count_; }
  const PacketGatherer::Work& work() const { return packets_.work(); }

  // Bytes that a gatherer holds from the start.
  static std::size_t memoryBytes(const GatherRules& rules);

 private:
  using Places = std::span<const std::uint16_t>;
  // A part of the division.
  struct Cell {
    std::uint16_t begin, count;  // of places_
  };

  void begin(std::span<const LocalReceiver> receivers);
  void chooseSample(const Cell& cell);
  void findSamples(const FitPoint& about, std::vector<std::uint16_t>& near) const;
  float errorAt(std::uint16_t sample, std::span<const GatherResult> results);
  float errorOf(const LocalFit& fit, const GatherResult& actual,
                std::span<const GatherResult> results) const;
  bool isSafe(const LocalFit& fit, std::span<const GatherResult> results);
  void divideOpenCells(std::size_t size);
  bool interpolateIn(const Cell& cell, std::span<GatherResult> results);
  Status gatherOpen(std::span<const LocalReceiver> receivers, WorldReader& world,
                    std::span<GatherResult> results);
  GatherResult valueOf(const LocalFit& fit, std::span<const GatherResult> results) const;
  Status gatherChosen(std::span<const LocalReceiver> receivers, WorldReader& world,
                      std::span<GatherResult> results);
  Places placesOf(const Cell& cell) const {
    return Places(places_).subspan(cell.begin, cell.count);
  }
  FitPoint middleOf(const Cell& cell) const;

  const GatherRules rules_;
  const float most_axis_error_, most_error_;
  PacketGatherer packets_;
  std::vector<LocalReceiver> packet_receivers_;
  std::vector<GatherResult> packet_results_;

  // By place in the group
  std::vector<FitPoint> points_;
  std::vector<State> states_;
  std::vector<float> errors_;  // of samples, were they left out; negative: not known

  std::vector<std::uint16_t> places_;              // in the order of the division
  std::vector<std::uint16_t> samples_;             // that are interpolated between
  std::vector<std::uint16_t> chosen_, rest_;       // to be gathered at
  std::vector<std::uint16_t> near_, near_sample_;  // samples near a cell or sample
  std::vector<Cell> open_, divided_;
  std::uint64_t interpolated_count_ = 0;
};

}  // namespace surfeit
