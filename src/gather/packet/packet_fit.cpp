#include "gather/packet/packet_fit.h"

#include <algorithm>
#include <cmath>

#include "core/assert.h"
#include "gather/rules/interpolation_limits.h"

namespace surfeit {

void PacketFit::begin(const FitPoint& about, float reach, std::size_t channels) {
  SURFEIT_ASSERT(reach > 0 && channels <= kResultFloats);
  about_ = about;
  scale_ = 1 / reach;
  weight_ = 0;
  channels_ = channels;
  moments_.fill(Terms{});
  std::fill_n(products_.begin(), channels, Terms{});
}

PacketFit::Terms PacketFit::termsOf(const FitPoint& point) const {
  const glm::vec3 p = (point.position - about_.position) * scale_;
  const glm::vec3 a = point.axis - about_.axis;
  return {1,         p.x,       p.y,       p.z,       a.x,       a.y,      a.z,
          p.x * p.x, p.y * p.y, p.z * p.z, p.x * p.y, p.y * p.z, p.z * p.x};
}

void PacketFit::add(const FitPoint& sample, float weight, const float* values) {
  const Terms terms = termsOf(sample);
  for (std::size_t i = 0; i < kTerms; ++i) {
    const float factor = weight * terms[i];
    for (std::size_t j = 0; j < kLanes; ++j) moments_[i][j] += factor * terms[j];
  }
  for (std::size_t channel = 0; channel < channels_; ++channel) {
    const float factor = weight * values[channel];
    for (std::size_t j = 0; j < kLanes; ++j) products_[channel][j] += factor * terms[j];
  }
  weight_ += weight;
}

bool PacketFit::solve() {
  if (!(weight_ > 0)) return false;
  for (std::size_t i = 0; i < kTerms; ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      double sum = double(moments_[i][j]);
      if (i == j && i > 0) sum += kInterpolation.ridge * double(weight_);
      for (std::size_t k = 0; k < j; ++k) sum -= root_[i][k] * root_[j][k];
      if (i > j) {
        root_[i][j] = sum / root_[j][j];
      } else if (sum > 0) {
        root_[i][i] = std::sqrt(sum);
      } else {
        return false;  // rounding
      }
    }
  }
  for (std::size_t channel = 0; channel < channels_; ++channel) {
    std::array<double, kTerms> solved;
    for (std::size_t i = 0; i < kTerms; ++i) {
      double sum = double(products_[channel][i]);
      for (std::size_t k = 0; k < i; ++k) sum -= root_[i][k] * solved[k];
      solved[i] = sum / root_[i][i];
    }
    factors_[channel] = {};
    for (std::size_t i = kTerms; i-- > 0;) {
      double sum = solved[i];
      for (std::size_t k = i + 1; k < kTerms; ++k) sum -= root_[k][i] * solved[k];
      solved[i] = sum / root_[i][i];
      factors_[channel][i] = float(solved[i]);
    }
  }
  return true;
}

double PacketFit::leverage(const FitPoint& point) const {
  const Terms terms = termsOf(point);
  std::array<double, kTerms> solved;
  double sum_sq = 0;
  for (std::size_t i = 0; i < kTerms; ++i) {
    double sum = double(terms[i]);
    for (std::size_t k = 0; k < i; ++k) sum -= root_[i][k] * solved[k];
    solved[i] = sum / root_[i][i];
    sum_sq += solved[i] * solved[i];
  }
  return sum_sq * double(weight_);
}

void PacketFit::value(const FitPoint& point, float* values) const {
  const Terms terms = termsOf(point);
  for (std::size_t channel = 0; channel < channels_; ++channel) {
    float sum = 0;
    for (std::size_t i = 0; i < kTerms; ++i) sum += factors_[channel][i] * terms[i];
    values[channel] = sum;
  }
}

}  // namespace surfeit
