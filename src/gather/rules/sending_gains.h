// Gains of the light that surfels send, by their object groups (GatherSettings::gains).
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>

#include "surfeit/gather.h"
#include "surfeit/surfel.h"

namespace surfeit {

// Plain data.
class SendingGains {
 public:
  SendingGains() { gains_.fill(1); }
  // Checked ones.
  explicit SendingGains(std::span<const GroupGain> gains) : SendingGains() {
    for (const GroupGain& of_group : gains) gains_[of_group.group] = of_group.gain;
    for (std::size_t group = 0; group < kMaxGroups; ++group) {
      for (std::size_t other = 0; other < kMaxGroups; ++other) {
        if (gains_[other] == gains_[group]) alike_[group] |= groupBit(std::uint32_t(other));
      }
    }
    is_off_ = gains_ == SendingGains().gains_;
  }

  bool isOff() const { return is_off_; }
  float of(std::uint32_t group) const { return gains_[group]; }

  // Whether surfels of all these groups, at least one, have one gain; and that gain.
  bool areAlike(std::uint64_t groups) const {
    return is_off_ || (groups & ~alike_[firstOf(groups)]) == 0;
  }
  float ofAlike(std::uint64_t groups) const { return gains_[firstOf(groups)]; }

 private:
  static std::size_t firstOf(std::uint64_t groups) {
    return std::size_t(std::countr_zero(groups)) % kMaxGroups;
  }

  bool is_off_ = true;
  std::array<float, kMaxGroups> gains_;
  std::array<std::uint64_t, kMaxGroups> alike_{};  // of each group, the groups with its gain
};

}  // namespace surfeit
