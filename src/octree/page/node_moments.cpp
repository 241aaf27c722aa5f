#include "octree/page/node_moments.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "core/thread_scratch.h"
#include "octree/node/moment_codes.h"
#include "octree/page/column_codec.h"

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

// The largest front moment of a node; of clouds near the limits of all sizes it would be infinite.
float mostFrontMoment(const Node& node) {
  return std::min(node.area * node.radius, std::numeric_limits<float>::max());
}

// Two-sided disks count twice: 8 pi / 9 times the greatest value of a basis function, Y40 = 0.846.
constexpr float kMostBand4 = 2.4f;

// Moment `k` of a rough node: the rows of its front moment, then band 4 of its area.
template <typename NodeType>
auto& roughMoment(NodeType& node, std::size_t k) {
  return k < 9 ? node.rough.front_moment[k / 3][static_cast<int>(k % 3)]
               : node.rough.area_band_4[k - 9];
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
    for (std::size_t k = 0; k < kRough && node.isRough(); ++k) {
      floats_[roughAt(k)] = roughMoment(node, k);
    }
  } else {
    addCodes(node);
  }
  ++next_;
  next_rough_ += node.isRough() ? 1 : 0;
}

// A front moment is over area times radius.
void MomentColumns::addCodes(const Node& node) {
  const CovarianceCodes covariance = covarianceCodes(node.covariance, node.radius);
  for (std::size_t k = 0; k < kCovariance; ++k) codes_[covarianceAt(k)] = covariance[k];
  if (!node.isRough()) return;
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
  if (full_precision_) {
    for (std::size_t k = 0; k < kCovariance; ++k) {
      node.covariance.entries[k] = floats_[covarianceAt(k)];
    }
    for (std::size_t k = 0; k < kRough && node.isRough(); ++k) {
      roughMoment(node, k) = floats_[roughAt(k)];
    }
  } else {
    takeCodes(node);
  }
  ++next_;
  next_rough_ += node.isRough() ? 1 : 0;
  const float radius_sq = node.radius * node.radius, largest = mostFrontMoment(node);
  if (!std::isfinite(radius_sq)) return false;
  if (!full_precision_) return true;

  const auto isWithin = [](float value, float limit) {
    return std::abs(value) <= kTolerance * limit;
  };
  for (const float entry : node.covariance.entries) {
    if (!isWithin(entry, radius_sq)) return false;
  }
  if (!node.isRough()) return true;
  for (const glm::vec3& row : node.rough.front_moment) {
    for (int column = 0; column < 3; ++column) {
      if (!isWithin(row[column], largest)) return false;
    }
  }
  for (const float value : node.rough.area_band_4) {
    if (!isWithin(value, kMostBand4 * node.area)) return false;
  }
  return true;
}

void MomentColumns::takeCodes(Node& node) const {
  CovarianceCodes covariance;
  for (std::size_t k = 0; k < kCovariance; ++k) covariance[k] = codes_[covarianceAt(k)];
  node.covariance = covarianceOf(covariance, node.radius);
  if (!node.isRough()) return;
  const float scale = mostFrontMoment(node);
  for (std::size_t k = 0; k < kFront; ++k) {
    roughMoment(node, k) = scale * signedFractionOf(codes_[roughAt(k)]);
  }
  for (std::size_t k = kFront; k < kRough; ++k) {
    roughMoment(node, k) = kMostBand4 * node.area * signedFractionOf(codes_[roughAt(k)]);
  }
}

}  // namespace surfeit
