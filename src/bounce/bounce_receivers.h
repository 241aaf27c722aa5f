// At which surfels of a stretch along the curve a bounce gathers, and what the others receive then.
// With one surfel per receiver at all of them. Else receivers are chosen greedily: a surfel becomes
// one unless a chosen one before it is near and faces the same way; the others interpolate.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "gather/rules/receiver.h"
#include "surfeit/surfel.h"

namespace surfeit {

// One thread at a time.
class BounceReceivers {
 public:
  explicit BounceReceivers(int surfels_per_receiver)
      : surfels_per_receiver_(surfels_per_receiver) {}

  // Chooses from surfels in curve order, which must stay as they are until irradiance() is called
  // for the last time.
  void choose(std::span<const Surfel> surfels);

  // Where to gather: at a disk with its normal, at a two-sided one on both sides, at a sphere over
  // all directions. First the fronts, in curve order, then the backs.
  std::span<const LocalReceiver> receivers() const { return receivers_; }

  // What surfel `i` receives, given what the receivers do: the mean of both sides where there are
  // two.
  glm::vec3 irradiance(std::size_t i, std::span<const glm::vec3> at_receivers) const;

  // Bytes for stretches of so many surfels.
  static constexpr std::size_t memoryBytes(std::size_t surfels) {
    return surfels * (2 * sizeof(LocalReceiver) + sizeof(Chosen) + sizeof(std::uint32_t));
  }

 private:
  // A surfel at which is gathered.
  struct Chosen {
    std::uint32_t surfel = 0;
    std::uint32_t back = 0;  // its second receiver; 0: none
  };

  // How well `from` stands for `at`, 0 to 1: 0 beyond twice the reach, or where normals or kinds
  // differ.
  float weight(const Surfel& at, const Surfel& from) const;
  bool isCovered(std::size_t i) const;
  glm::vec3 irradianceOf(std::size_t place, std::span<const glm::vec3> at_receivers) const;

  const int surfels_per_receiver_;
  std::span<const Surfel> surfels_;
  std::vector<Chosen> chosen_;                // fronts are receivers of the same number
  std::vector<std::uint32_t> chosen_before_;  // by surfel: how many were, it included
  std::vector<LocalReceiver> receivers_;
};

}  // namespace surfeit
