#include "gather/packet/interpolating_gatherer.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <numeric>

#include "core/assert.h"
#include "gather/cut/packet_cluster.h"
#include "gather/rules/gather_outputs.h"

namespace surfeit {
namespace {

// Samples are chosen closer and closer until light is smooth between them: one in a cell of so many
// receivers. Finer ones than these save nothing: samples are drawn apart from each other, and each
// costs as much as 5 to 10 neighbours.
constexpr std::array<std::size_t, 2> kCellSizes = {64, 16};

// The receivers of a cell that is so many pixels wide, where there is one in each.
std::size_t mostCellSize(const GatherRules& rules) {
  const auto edge = static_cast<std::size_t>(rules.quality.max_pixel_distance);
  return edge * edge;
}

// Mean error of the samples of a fit in parts of the variation: some of them are twice as far off.
constexpr float kTolerance = 0.5f;

// Half as far apart, samples miss about a quarter as much where light bends, and as much as before
// where it is noise. With more than this part of the samples worse than so many times what is
// allowed, the next level would be for nothing.
constexpr float kMostHopeless = 0.5f, kHopeless = 3;

// A cell is left to the next level when more than this part of its receivers is.
constexpr float kMostLeft = 0.125f;

// Clusters and packets of which a larger part is to be gathered are gathered whole.
constexpr float kWholeCluster = 0.4f, kWholePacket = 0.5f;

// Samples that the fits in a cell choose from, and how they must face (cosine).
constexpr std::size_t kNearSamples = 24;
constexpr float kFacing = 0.7f;

// Receivers outside of their samples are gathered: there weights multiply errors.
constexpr float kMostGain = 3;
// So are those that lie so far above or below what samples lie on, in parts of their reach.
constexpr float kMostHeight = 0.1f;

constexpr float kUnknown = -1;

using ResultArray = std::array<float, kResultFloats>;

const float* floatsOf(const GatherResult& result) {
  return reinterpret_cast<const float*>(&result);
}

constexpr std::uint32_t kDirections = kOutputBentNormal | kOutputIlluminationDirection;

}  // namespace

InterpolatingGatherer::InterpolatingGatherer(const GatherRules& rules, const PacketKernel& kernel)
    : rules_(rules),
      most_axis_error_(rules.quality.max_variation * std::sin(rules.weights.cone_angle)),
      most_error_(kTolerance * rules.quality.max_variation),
      packets_(rules, kernel),
      packet_receivers_(kClusterReceivers),
      packet_results_(kClusterReceivers) {
  for (auto* list : {&places_, &samples_, &chosen_, &rest_, &near_, &near_sample_}) {
    list->reserve(kGroupReceivers);
  }
  for (auto* cells : {&open_, &divided_}) cells->reserve(kGroupReceivers);
  points_.reserve(kGroupReceivers);
  states_.reserve(kGroupReceivers);
  errors_.reserve(kGroupReceivers);
}

void InterpolatingGatherer::begin(std::span<const LocalReceiver> receivers) {
  const std::size_t count = receivers.size();
  points_.clear();
  for (const LocalReceiver& receiver : receivers) {
    points_.push_back({receiver, lobeAxis(receiver, rules_)});
  }
  states_.assign(count, State::kOpen);
  errors_.assign(count, kUnknown);
  samples_.clear();
  open_.clear();
  places_.resize(count);
  std::iota(places_.begin(), places_.end(), std::uint16_t{0});
  for (std::size_t i = 0; i < count; i += kClusterReceivers) {
    const std::size_t cluster_size = std::min(kClusterReceivers, count - i);
    const float radius = viewPacket(receivers.subspan(i, cluster_size)).radius;
    divideReceivers(std::span(places_).subspan(i, cluster_size), receivers, kNormalWeight * radius,
                    kPacketReceivers);
    open_.push_back({std::uint16_t(i), std::uint16_t(cluster_size)});
  }
}

// A receiver in the middle of a cell, of no other place.
FitPoint InterpolatingGatherer::middleOf(const Cell& cell) const {
  FitPoint middle;
  for (const std::uint16_t place : placesOf(cell)) {
    middle.receiver.position += points_[place].receiver.position;
    middle.receiver.normal += points_[place].receiver.normal;
  }
  middle.receiver.position /= float(cell.count);
  const float length = glm::length(middle.receiver.normal);
  if (length > 0) middle.receiver.normal /= length;
  return middle;
}

// Replaces open cells by parts of at most this many receivers.
void InterpolatingGatherer::divideOpenCells(std::size_t size) {
  divided_.clear();
  for (const Cell& cell : open_) {
    for (std::size_t i = 0; i < cell.count; i += size) {
      divided_.push_back(
          {std::uint16_t(cell.begin + i), std::uint16_t(std::min(size, cell.count - i))});
    }
  }
  open_.swap(divided_);
}

// Chooses the receiver nearest to the middle of a cell, unless it has a sample already.
void InterpolatingGatherer::chooseSample(const Cell& cell) {
  const Places places = placesOf(cell);
  if (std::any_of(places.begin(), places.end(),
                  [&](auto place) { return states_[place] == State::kGathered; })) {
    return;
  }
  const FitPoint middle = middleOf(cell);
  std::uint16_t best = places[0];
  float least = std::numeric_limits<float>::max();
  for (const std::uint16_t place : places) {
    const glm::vec3 offset = points_[place].receiver.position - middle.receiver.position;
    const float distance_sq = glm::dot(offset, offset);
    if (distance_sq < least) {
      least = distance_sq;
      best = place;
    }
  }
  chosen_.push_back(best);
}

// Gathers at what is chosen, in clusters.
Status InterpolatingGatherer::gatherChosen(std::span<const LocalReceiver> receivers,
                                           WorldReader& world, std::span<GatherResult> results) {
  for (std::size_t begin = 0; begin < chosen_.size(); begin += kClusterReceivers) {
    const std::size_t count = std::min(kClusterReceivers, chosen_.size() - begin);
    for (std::size_t i = 0; i < count; ++i) packet_receivers_[i] = receivers[chosen_[begin + i]];
    SURFEIT_RETURN_IF_ERROR(packets_.gather(std::span(packet_receivers_).first(count), world,
                                            std::span(packet_results_).first(count)));
    for (std::size_t i = 0; i < count; ++i) {
      results[chosen_[begin + i]] = packet_results_[i];
      states_[chosen_[begin + i]] = State::kGathered;
    }
  }
  return {};
}

// The samples nearest to a point that may resemble it.
void InterpolatingGatherer::findSamples(const FitPoint& about,
                                        std::vector<std::uint16_t>& near) const {
  struct Found {
    float distance_sq;
    std::uint16_t place;
    bool operator<(const Found& other) const {
      return distance_sq != other.distance_sq ? distance_sq < other.distance_sq
                                              : place < other.place;
    }
  };
  std::array<Found, kNearSamples> found;
  std::size_t count = 0;
  const LocalReceiver& receiver = about.receiver;
  for (const std::uint16_t place : samples_) {
    const LocalReceiver& sample = points_[place].receiver;
    const glm::vec3 offset = sample.position - receiver.position;
    const Found next{glm::dot(offset, offset), place};
    if (count == kNearSamples && !(next < found[count - 1])) continue;
    if (!receiver.isSpherical() && !(glm::dot(sample.normal, receiver.normal) > kFacing)) continue;
    std::size_t i = count < kNearSamples ? count++ : count - 1;
    for (; i > 0 && next < found[i - 1]; --i) found[i] = found[i - 1];
    found[i] = next;
  }
  near.clear();
  for (std::size_t i = 0; i < count; ++i) near.push_back(found[i].place);
}

// Results mixed by the weights of a fit, and brought back to what they can be.
GatherResult InterpolatingGatherer::valueOf(const LocalFit& fit,
                                            std::span<const GatherResult> results) const {
  ResultArray sum{};
  for (const OutputColumns& columns : outputColumns()) {
    if (!rules_.has(columns.output)) continue;
    for (std::size_t k = 0; k < fit.count; ++k) {
      const float* values = floatsOf(results[fit.samples[k]]);
      for (std::size_t i = columns.first; i < columns.first + columns.count; ++i) {
        sum[i] += fit.weights[k] * values[i];
      }
    }
    float* const value = &sum[columns.first];
    if ((columns.output & kDirections) != 0) {
      const float length =
          std::sqrt(value[0] * value[0] + value[1] * value[1] + value[2] * value[2]);
      for (int i = 0; i < 3; ++i) value[i] = length > 0 ? value[i] / length : 0;
    } else if (columns.output == kOutputOcclusion) {
      value[0] = std::clamp(value[0], 0.f, 1.f);
    } else if (columns.output != kOutputRadianceSh) {
      for (int i = 0; i < 3; ++i) value[i] = std::max(value[i], 0.f);
    }
  }
  return std::bit_cast<GatherResult>(sum);
}

// The greatest difference of any output: occlusion as it is, directions by half the distance of
// unit vectors, lights relative to the brightest of the samples.
float InterpolatingGatherer::errorOf(const LocalFit& fit, const GatherResult& actual,
                                     std::span<const GatherResult> results) const {
  const auto guess = std::bit_cast<ResultArray>(valueOf(fit, results));
  const auto truth = std::bit_cast<ResultArray>(actual);
  float error = 0;
  for (const OutputColumns& columns : outputColumns()) {
    if (!rules_.has(columns.output)) continue;
    float difference = 0;
    for (std::size_t i = columns.first; i < columns.first + columns.count; ++i) {
      difference = std::max(difference, std::abs(guess[i] - truth[i]));
    }
    float scale = 1;
    if ((columns.output & kDirections) != 0) {
      scale = 2;
    } else if (columns.output != kOutputOcclusion) {
      const auto brightest = [&](const float* values) {
        return std::max(
            {values[columns.first], values[columns.first + 1], values[columns.first + 2]});
      };
      scale = brightest(truth.data());
      for (std::size_t k = 0; k < fit.count; ++k) {
        scale = std::max(scale, brightest(floatsOf(results[fit.samples[k]])));
      }
    }
    if (difference > 0) error = std::max(error, difference / scale);
  }
  return error;
}

// What a fit would miss at a sample if it did not know it.
float InterpolatingGatherer::errorAt(std::uint16_t sample, std::span<const GatherResult> results) {
  if (errors_[sample] < 0) {
    findSamples(points_[sample], near_sample_);
    const LocalFit fit = fitLocally(points_, sample, near_sample_, sample);
    errors_[sample] =
        fit.count > 0 ? errorOf(fit, results[sample], results) : std::numeric_limits<float>::max();
  }
  return errors_[sample];
}

// Whether a fit resembles its receiver, and what it draws from is smooth.
bool InterpolatingGatherer::isSafe(const LocalFit& fit, std::span<const GatherResult> results) {
  if (fit.count == 0 || fit.gain > kMostGain) return false;
  if (fit.axis_error > most_axis_error_ || fit.height_error > kMostHeight) return false;
  float error = 0;
  for (std::size_t k = 0; k < fit.count; ++k) {
    error += std::abs(fit.weights[k]) * errorAt(fit.samples[k], results);
  }
  return error <= most_error_;
}

// Interpolates at the receivers of a cell where that is safe; whether it is at most of them.
bool InterpolatingGatherer::interpolateIn(const Cell& cell, std::span<GatherResult> results) {
  findSamples(middleOf(cell), near_);
  std::size_t left = 0;
  for (const std::uint16_t place : placesOf(cell)) {
    if (states_[place] == State::kGathered) continue;
    const LocalFit fit = fitLocally(points_, place, near_);
    if (isSafe(fit, results)) {
      results[place] = valueOf(fit, results);
      states_[place] = State::kInterpolated;
    } else {
      states_[place] = State::kOpen;
      ++left;
    }
  }
  return float(left) <= kMostLeft * float(cell.count);
}

// Chooses what is still open, and more of a packet or cluster of which much is open: neighbours
// cost less together than scattered ones apart. Clusters that are gathered whole come at once.
Status InterpolatingGatherer::gatherOpen(std::span<const LocalReceiver> receivers,
                                         WorldReader& world, std::span<GatherResult> results) {
  const auto isOpen = [&](auto place) { return states_[place] == State::kOpen; };
  const auto openIn = [&](Places places) {
    return float(std::count_if(places.begin(), places.end(), isOpen)) / float(places.size());
  };
  rest_.clear();
  for (std::size_t begin = 0; begin < places_.size(); begin += kClusterReceivers) {
    const Places cluster =
        Places(places_).subspan(begin, std::min(kClusterReceivers, places_.size() - begin));
    if (openIn(cluster) > kWholeCluster) {
      chosen_.assign(cluster.begin(), cluster.end());
      std::sort(chosen_.begin(), chosen_.end());
      SURFEIT_RETURN_IF_ERROR(gatherChosen(receivers, world, results));
      continue;
    }
    for (std::size_t i = 0; i < cluster.size(); i += kPacketReceivers) {
      const Places packet = cluster.subspan(i, std::min(kPacketReceivers, cluster.size() - i));
      const bool is_whole = openIn(packet) > kWholePacket;
      std::copy_if(packet.begin(), packet.end(), std::back_inserter(rest_), [&](auto place) {
        return is_whole ? states_[place] != State::kGathered : isOpen(place);
      });
    }
  }
  chosen_.swap(rest_);
  return gatherChosen(receivers, world, results);
}

Status InterpolatingGatherer::gather(std::span<const LocalReceiver> receivers, WorldReader& world,
                                     std::span<GatherResult> results) {
  SURFEIT_ASSERT(!receivers.empty() && receivers.size() <= kGroupReceivers);
  begin(receivers);
  const std::size_t most_size = mostCellSize(rules_);
  std::size_t before = std::numeric_limits<std::size_t>::max();
  for (const std::size_t usual_size : kCellSizes) {
    const std::size_t size = std::min(usual_size, most_size);
    if (size == before) break;
    before = size;
    // More samples, where they are needed
    divideOpenCells(size);
    chosen_.clear();
    for (const Cell& cell : open_) chooseSample(cell);
    SURFEIT_RETURN_IF_ERROR(gatherChosen(receivers, world, results));
    samples_.insert(samples_.end(), chosen_.begin(), chosen_.end());
    for (const std::uint16_t sample : samples_) errors_[sample] = kUnknown;

    // Between them
    std::erase_if(open_, [&](const Cell& cell) { return interpolateIn(cell, results); });
    const auto hopeless = std::count_if(samples_.begin(), samples_.end(), [&](auto sample) {
      return errorAt(sample, results) > kHopeless * most_error_;
    });
    if (float(hopeless) > kMostHopeless * float(samples_.size())) break;
  }
  SURFEIT_RETURN_IF_ERROR(gatherOpen(receivers, world, results));
  interpolated_count_ +=
      std::uint64_t(std::count(states_.begin(), states_.end(), State::kInterpolated));
  return {};
}

std::size_t InterpolatingGatherer::memoryBytes(const GatherRules& rules) {
  constexpr std::size_t kByPlace = sizeof(FitPoint) + sizeof(State) + sizeof(float) +
                                   6 * sizeof(std::uint16_t) + 2 * sizeof(Cell);
  return sizeof(InterpolatingGatherer) - sizeof(PacketGatherer) +
         PacketGatherer::memoryBytes(rules) +
         kClusterReceivers * (sizeof(LocalReceiver) + sizeof(GatherResult)) +
         kGroupReceivers * kByPlace;
}

}  // namespace surfeit
