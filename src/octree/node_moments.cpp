#include "octree/node_moments.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "core/thread_scratch.h"
#include "octree/column_codec.h"

namespace surfeit {
namespace {

// Moments may exceed their limits by rounding.
constexpr float kTolerance = 1.01f;

template <typename T>
std::span<T> threadColumns(std::size_t size) {
  std::vector<T>& values = threadScratch<std::vector<T>>([] {});
  if (values.size() < size) values.resize(size);
  return std::span(values).first(size);
}

// 0..1, and -1..1 with 0 exact, as a byte. What is outside, and NaN, becomes an end.
std::uint8_t fractionCode(float value) {
  return static_cast<std::uint8_t>(255 * std::clamp(value > 0 ? value : 0, 0.f, 1.f) + 0.5f);
}
float fractionOf(std::uint8_t code) { return float(code) * (1.f / 255); }
std::uint8_t signedFractionCode(float value) {
  return static_cast<std::uint8_t>(127 * std::clamp(value > -1 ? value : -1, -1.f, 1.f) + 128.5f);
}
float signedFractionOf(std::uint8_t code) { return float(int{code} - 128) * (1.f / 127); }

// The largest front moment of a node; of clouds near the limits of all sizes it would be infinite.
float mostFrontMoment(const Node& node) {
  return std::min(node.area * node.radius, std::numeric_limits<float>::max());
}

// Off the diagonal an entry is no more than half of the trace.
constexpr float kMostShear = 0.5f;

// Two-sided disks count twice: 8 pi / 9 times the greatest value of a basis function, Y40 = 0.846.
constexpr float kMostBand4 = 2.4f;

// Moment `k` of a rough node: the rows of its front moment, then band 4 of its area.
template <typename NodeType>
auto& roughMoment(NodeType& node, std::size_t k) {
  return k < 9 ? node.front_moment[k / 3][static_cast<int>(k % 3)] : node.area_band_4[k - 9];
}

}  // namespace

MomentColumns::MomentColumns(std::size_t count, std::size_t rough_count, bool full_precision)
    : count_(count), rough_count_(rough_count), full_precision_(full_precision) {
  const std::size_t size = kCovariance * count + kRough * rough_count;
  if (full_precision) {
    floats_ = threadColumns<float>(size);
  } else {
    codes_ = threadColumns<std::uint8_t>(size);
  }
}

void MomentColumns::add(const Node& node) {
  if (full_precision_) {
    for (std::size_t k = 0; k < kCovariance; ++k) {
      floats_[covarianceAt(k)] = node.covariance.entries[k];
    }
    for (std::size_t k = 0; k < kRough && !node.isFlat(); ++k) {
      floats_[roughAt(k)] = roughMoment(node, k);
    }
  } else {
    addCodes(node);
  }
  ++next_;
  next_rough_ += node.isFlat() ? 0 : 1;
}

// A covariance is the root of its trace over the radius, and its entries over the trace; zz follows
// from the others. A front moment is over area times radius.
void MomentColumns::addCodes(const Node& node) {
  const SymmetricMatrix& covariance = node.covariance;
  const float trace = covariance.trace();
  codes_[covarianceAt(0)] = fractionCode(std::sqrt(trace) / node.radius);
  for (std::size_t k = 0; k < 2; ++k) {
    codes_[covarianceAt(1 + k)] = fractionCode(covariance.entries[k] / trace);
  }
  for (std::size_t k = 3; k < kCovariance; ++k) {
    codes_[covarianceAt(k)] = signedFractionCode(covariance.entries[k] / (kMostShear * trace));
  }
  if (node.isFlat()) return;
  const float inverse = 1 / mostFrontMoment(node);
  for (std::size_t k = 0; k < kFront; ++k) {
    codes_[roughAt(k)] = signedFractionCode(roughMoment(node, k) * inverse);
  }
  for (std::size_t k = kFront; k < kRough; ++k) {
    codes_[roughAt(k)] = signedFractionCode(roughMoment(node, k) / (kMostBand4 * node.area));
  }
}

void MomentColumns::put(PayloadWriter& writer) const {
  full_precision_ ? putFloats(writer, floats_) : putBytes8(writer, codes_);
}

bool MomentColumns::get(PayloadReader& reader) {
  return full_precision_ ? getFloats(reader, floats_) : getBytes8(reader, codes_);
}

bool MomentColumns::take(Node& node) {
  node.front_moment = {};
  node.area_band_4 = {};
  if (full_precision_) {
    for (std::size_t k = 0; k < kCovariance; ++k) {
      node.covariance.entries[k] = floats_[covarianceAt(k)];
    }
    for (std::size_t k = 0; k < kRough && !node.isFlat(); ++k) {
      roughMoment(node, k) = floats_[roughAt(k)];
    }
  } else {
    takeCodes(node);
  }
  ++next_;
  next_rough_ += node.isFlat() ? 0 : 1;
  const float radius_sq = node.radius * node.radius, largest = mostFrontMoment(node);
  if (!std::isfinite(radius_sq)) return false;
  if (!full_precision_) return true;

  const auto isWithin = [](float value, float limit) {
    return std::abs(value) <= kTolerance * limit;
  };
  for (const float entry : node.covariance.entries) {
    if (!isWithin(entry, radius_sq)) return false;
  }
  for (const glm::vec3& row : node.front_moment) {
    for (int column = 0; column < 3; ++column) {
      if (!isWithin(row[column], largest)) return false;
    }
  }
  for (const float value : node.area_band_4) {
    if (!isWithin(value, kMostBand4 * node.area)) return false;
  }
  return true;
}

void MomentColumns::takeCodes(Node& node) const {
  const float deviation = node.radius * fractionOf(codes_[covarianceAt(0)]);
  const float trace = deviation * deviation;
  std::array<float, kCovariance>& entries = node.covariance.entries;
  const float xx = fractionOf(codes_[covarianceAt(1)]), yy = fractionOf(codes_[covarianceAt(2)]);
  entries[0] = trace * xx;
  entries[1] = trace * yy;
  entries[2] = trace * std::max(0.f, 1 - xx - yy);
  for (std::size_t k = 3; k < kCovariance; ++k) {
    entries[k] = trace * kMostShear * signedFractionOf(codes_[covarianceAt(k)]);
  }
  if (node.isFlat()) return;
  const float scale = mostFrontMoment(node);
  for (std::size_t k = 0; k < kFront; ++k) {
    roughMoment(node, k) = scale * signedFractionOf(codes_[roughAt(k)]);
  }
  for (std::size_t k = kFront; k < kRough; ++k) {
    roughMoment(node, k) = kMostBand4 * node.area * signedFractionOf(codes_[roughAt(k)]);
  }
}

}  // namespace surfeit
