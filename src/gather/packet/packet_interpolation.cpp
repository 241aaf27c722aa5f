#include "gather/packet/packet_interpolation.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

#include "core/assert.h"
#include "gather/rules/gather_outputs.h"

namespace surfeit {
namespace {

constexpr std::uint32_t kUnitVectors = kOutputBentNormal | kOutputIlluminationDirection;

// Packets of the cells that have one sample at first: a power of 2, of no more receivers than a
// square of so many in a row.
std::size_t widestCell(const GatherRules& rules) {
  const auto edge = static_cast<std::size_t>(rules.quality.max_pixel_distance);
  std::size_t cell = kInterpolation.widest_cell;
  while (edge > 0 && cell > 1 && cell * kPacketReceivers > edge * edge) cell /= 2;
  return cell;
}

// Calls visit(index, columns, first float of a packed row) for each output of the rules.
template <typename Visit>
void forEachOutput(const GatherRules& rules, Visit&& visit) {
  std::size_t index = 0, first = 0;
  for (const OutputColumns& columns : outputColumns()) {
    if (!rules.has(columns.output)) continue;
    visit(index++, columns, first);
    first += columns.count;
  }
}

// What an output's errors are relative to: nothing for occlusion, half a turn for directions, the
// brightest color for lights.
float scaleOf(const OutputColumns& columns, const float* values) {
  if (columns.output == kOutputOcclusion) return 1;
  if ((columns.output & kUnitVectors) != 0) return 2;
  return std::max({values[0], values[1], values[2]});
}

}  // namespace

PacketInterpolation::PacketInterpolation(const GatherRules& rules)
    : rules_(rules),
      axis_scale_(1 / std::sin(rules.weights.cone_angle)),
      channels_(resultFloats(rules.outputs)) {
  SURFEIT_ASSERT(outputColumns().size() <= kMostOutputs);
  points_.reserve(kGroupReceivers);
  places_.reserve(kGroupReceivers);
  rows_.resize(kGroupReceivers * channels_);
  guess_.resize(kPacketReceivers * channels_);
  packets_.reserve(kGroupPackets);
  samples_.reserve(kGroupPackets);
  chosen_.reserve(kGroupPackets);
}

void PacketInterpolation::begin(std::span<const PacketCluster> clusters) {
  SURFEIT_ASSERT(!clusters.empty() && clusters.size() <= kGroupClusters);
  points_.clear();
  places_.clear();
  packets_.clear();
  samples_.clear();
  chosen_.clear();
  for (std::size_t i = 0; i < clusters.size(); ++i) {
    for (std::size_t packet = 0; packet < clusters[i].packetCount(); ++packet) {
      addPacket(clusters[i].receivers(packet), clusters[i].places(packet), i);
    }
  }
  cell_ = widestCell(rules_);
  interpolated_count_ = 0;
}

void PacketInterpolation::addPacket(std::span<const LocalReceiver> receivers,
                                    std::span<const std::uint16_t> places, std::size_t cluster) {
  Packet packet;
  packet.begin = std::uint16_t(points_.size());
  packet.count = std::uint16_t(receivers.size());
  for (std::size_t i = 0; i < receivers.size(); ++i) {
    points_.push_back({receivers[i].position, axis_scale_ * lobeAxis(receivers[i], rules_)});
    places_.push_back(std::uint16_t(cluster * kClusterReceivers + places[i]));
    packet.middle.position += receivers[i].position;
    packet.middle.axis += points_.back().axis;
    packet.normal += receivers[i].normal;
    packet.is_mixed |= receivers[i].isSpherical() != receivers[0].isSpherical();
  }
  packet.middle.position /= float(receivers.size());
  packet.middle.axis /= float(receivers.size());
  const float length = glm::length(packet.normal);
  if (length > 0) packet.normal /= length;
  packets_.push_back(packet);
}

std::span<const std::uint16_t> PacketInterpolation::next(std::span<GatherResult> results) {
  takeSamples(results);
  if (!samples_.empty()) interpolateOpen(results);
  chooseSamples(cell_);
  cell_ = std::max<std::size_t>(cell_ / 2, 1);
  for (std::size_t i = 0; i < packets_.size(); ++i) {
    if (packets_[i].state == State::kChosen) chosen_.push_back(std::uint16_t(i));
  }
  return chosen_;
}

void PacketInterpolation::takeSamples(std::span<const GatherResult> results) {
  for (const std::uint16_t at : chosen_) {
    Packet& packet = packets_[at];
    packet.state = State::kSample;
    float* const rows = &rows_[packet.begin * channels_];
    for (std::size_t i = 0; i < packet.count; ++i) {
      packResult(results[places_[packet.begin + i]], rules_.outputs, rows + i * channels_);
    }
    packet.brightest = brightestOf({rows, packet.count * channels_});
    samples_.push_back(at);
  }
  chosen_.clear();
  for (const std::uint16_t at : samples_) packets_[at].foretold = Foretold::kUnknown;
}

PacketInterpolation::PerOutput PacketInterpolation::brightestOf(std::span<const float> rows) const {
  PerOutput brightest{};
  for (std::size_t row = 0; row < rows.size(); row += channels_) {
    forEachOutput(rules_, [&](std::size_t i, const OutputColumns& columns, std::size_t first) {
      brightest[i] = std::max(brightest[i], scaleOf(columns, &rows[row + first]));
    });
  }
  return brightest;
}

// One sample in each cell that needs one: the open packet in the middle of those.
void PacketInterpolation::chooseSamples(std::size_t size) {
  for (std::size_t begin = 0; begin < packets_.size(); begin += size) {
    const auto cell = std::span(packets_).subspan(begin, std::min(size, packets_.size() - begin));
    glm::vec3 middle(0);
    std::size_t open = 0;
    bool has_sample = false;
    for (const Packet& packet : cell) {
      has_sample |= packet.state == State::kSample || packet.state == State::kChosen;
      if (packet.state != State::kOpen) continue;
      middle += packet.middle.position;
      ++open;
    }
    if (open == 0 || has_sample) continue;
    middle /= float(open);
    Packet* best = nullptr;
    float least = std::numeric_limits<float>::max();
    for (Packet& packet : cell) {
      if (packet.state != State::kOpen) continue;
      const float distance = glm::distance(packet.middle.position, middle);
      if (best != nullptr && !(distance < least)) continue;
      least = distance;
      best = &packet;
    }
    best->state = State::kChosen;
  }
}

bool PacketInterpolation::resemble(const Packet& a, const Packet& b, const glm::vec3& offset,
                                   float distance_sq) const {
  const bool is_spherical = a.normal == glm::vec3(0);
  if (a.is_mixed || b.is_mixed || is_spherical != (b.normal == glm::vec3(0))) return false;
  if (is_spherical) return true;
  if (!(glm::dot(a.normal, b.normal) > kInterpolation.least_cosine)) return false;
  const float rise = 0.5f * glm::dot(offset, a.normal + b.normal);
  return rise * rise <= kInterpolation.most_rise * kInterpolation.most_rise * distance_sq;
}

// The samples nearest to a packet that resemble it, but for itself.
PacketInterpolation::Near PacketInterpolation::findNear(std::size_t packet) const {
  struct Found {
    float distance_sq;
    std::uint16_t packet;
    bool operator<(const Found& other) const {
      return distance_sq != other.distance_sq ? distance_sq < other.distance_sq
                                              : packet < other.packet;
    }
  };
  constexpr std::size_t kMost = kInterpolation.most_samples;
  std::array<Found, kMost> found;
  std::size_t count = 0;
  const Packet& about = packets_[packet];
  for (const std::uint16_t at : samples_) {
    if (at == packet) continue;
    const glm::vec3 offset = packets_[at].middle.position - about.middle.position;
    const Found next{glm::dot(offset, offset), at};
    if (count == kMost && !(next < found[count - 1])) continue;
    if (!resemble(about, packets_[at], offset, next.distance_sq)) continue;
    std::size_t i = count < kMost ? count++ : count - 1;
    for (; i > 0 && next < found[i - 1]; --i) found[i] = found[i - 1];
    found[i] = next;
  }

  Near near;
  if (count < kInterpolation.least_samples) return near;
  near.count = count;
  // Weights end where one more sample would be: on a surface squared distances grow as the number
  const float reach_sq = found[count - 1].distance_sq * float(count + 1) / float(count);
  if (!(reach_sq > 0)) return Near{};
  near.reach = std::sqrt(reach_sq);
  for (std::size_t i = 0; i < near.count; ++i) {
    const float fade = 1 - found[i].distance_sq / reach_sq;
    near.packets[i] = found[i].packet;
    near.weights[i] = fade * fade;
  }
  return near;
}

bool PacketInterpolation::fit(const Packet& about, const Near& near) {
  if (near.count == 0) return false;
  fit_.begin(about.middle, near.reach, channels_);
  for (std::size_t i = 0; i < near.count; ++i) {
    const Packet& sample = packets_[near.packets[i]];
    for (std::size_t at = sample.begin; at < std::size_t(sample.begin) + sample.count; ++at) {
      fit_.add(points_[at], near.weights[i], &rows_[at * channels_]);
    }
  }
  if (!fit_.solve()) return false;
  for (std::size_t at = about.begin; at < std::size_t(about.begin) + about.count; ++at) {
    if (!(fit_.leverage(points_[at]) <= kInterpolation.most_leverage)) return false;
  }
  return true;
}

// Brought back to what results can be.
void PacketInterpolation::valueAt(std::size_t point, float* row) const {
  fit_.value(points_[point], row);
  forEachOutput(rules_, [&](std::size_t, const OutputColumns& columns, std::size_t first) {
    float* const value = row + first;
    if ((columns.output & kUnitVectors) != 0) {
      const float length =
          std::sqrt(value[0] * value[0] + value[1] * value[1] + value[2] * value[2]);
      for (int i = 0; i < 3; ++i) value[i] = length > 0 ? value[i] / length : 0;
    } else if (columns.output == kOutputOcclusion) {
      value[0] = std::clamp(value[0], 0.f, 1.f);
    } else if (columns.output != kOutputRadianceSh) {
      for (std::size_t i = 0; i < columns.count; ++i) value[i] = std::max(value[i], 0.f);
    }
  });
}

// The errors of a sample, had it not been gathered.
void PacketInterpolation::foretell(std::size_t sample) {
  Packet& packet = packets_[sample];
  if (packet.foretold != Foretold::kUnknown) return;
  packet.foretold = Foretold::kNo;
  if (!fit(packet, findNear(sample))) return;
  packet.foretold = Foretold::kYes;
  packet.error = {};
  for (std::size_t i = 0; i < packet.count; ++i) {
    valueAt(packet.begin + i, guess_.data());
    const float* const row = &rows_[(packet.begin + i) * channels_];
    forEachOutput(rules_, [&](std::size_t at, const OutputColumns& columns, std::size_t first) {
      for (std::size_t k = first; k < first + columns.count; ++k) {
        packet.error[at] = std::max(packet.error[at], std::abs(guess_[k] - row[k]));
      }
    });
  }
}

// Whether the samples are foretold well enough, where light is so bright.
bool PacketInterpolation::isWithin(const Near& near, const PerOutput& brightest) {
  PerOutput sum_sq{};
  float weight = 0;
  std::size_t count = 0;
  for (std::size_t i = 0; i < near.count; ++i) {
    foretell(near.packets[i]);
    const Packet& sample = packets_[near.packets[i]];
    if (sample.foretold != Foretold::kYes) continue;
    for (std::size_t k = 0; k < kMostOutputs; ++k) {
      sum_sq[k] += near.weights[i] * sample.error[k] * sample.error[k];
    }
    weight += near.weights[i];
    ++count;
  }
  if (count < kInterpolation.least_foretold) return false;
  const float most = kInterpolation.tolerance * rules_.quality.max_variation;
  for (std::size_t k = 0; k < kMostOutputs; ++k) {
    const float limit = most * brightest[k];
    if (!(sum_sq[k] <= weight * limit * limit)) return false;
  }
  return true;
}

bool PacketInterpolation::interpolate(Packet& packet, std::span<GatherResult> results) {
  const Near near = findNear(std::size_t(&packet - packets_.data()));
  if (near.count == 0) return false;
  PerOutput brightest{};
  for (std::size_t i = 0; i < near.count; ++i) {
    for (std::size_t k = 0; k < kMostOutputs; ++k) {
      brightest[k] = std::max(brightest[k], packets_[near.packets[i]].brightest[k]);
    }
  }
  if (!isWithin(near, brightest) || !fit(packet, near)) return false;
  for (std::size_t i = 0; i < packet.count; ++i) {
    valueAt(packet.begin + i, &guess_[i * channels_]);
  }
  // In the shade of bright samples, their errors are too large
  if (!isWithin(near, brightestOf(std::span(guess_).first(packet.count * channels_)))) return false;
  for (std::size_t i = 0; i < packet.count; ++i) {
    results[places_[packet.begin + i]] = unpackResult(&guess_[i * channels_], rules_.outputs);
  }
  return true;
}

void PacketInterpolation::interpolateOpen(std::span<GatherResult> results) {
  for (Packet& packet : packets_) {
    if (packet.state != State::kOpen || !interpolate(packet, results)) continue;
    packet.state = State::kInterpolated;
    interpolated_count_ += packet.count;
  }
}

std::size_t PacketInterpolation::memoryBytes(const GatherRules& rules) {
  return kGroupReceivers * (sizeof(FitPoint) + sizeof(std::uint16_t)) +
         (kGroupReceivers + kPacketReceivers) * resultFloats(rules.outputs) * sizeof(float) +
         kGroupPackets * (sizeof(Packet) + 2 * sizeof(std::uint16_t));
}

}  // namespace surfeit
