#include "bounce/bounce_receivers.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>

namespace surfeit {
namespace {

// Chosen surfels that are looked at before and after a place: what is near lies within these along
// the curve, mostly. (With 16 instead of 32, a Cornell box has 3 to 6 % more receivers, and errors
// of 1.05, 1.24 and 1.77 % instead of .98, 1.23 and 1.63 with one of 8, 16 and 32;
// bench/bounces.sh.)
constexpr std::size_t kWindow = 32;
// The reach of a receiver that stands for n surfels of area A: reach^2 = kReach n A. Greedily
// chosen by kCovering, receivers are then one of about n surfels on smooth surfaces (measured: one
// of 8.7 for 8), and more where normals turn.
constexpr float kReach = 0.5f;
// A surfel is covered by a receiver of at least this weight: within 1.3 reaches where normals are
// equal, within .6 where they agree a quarter.
constexpr float kCovering = 0.125f;
// Normals that agree have at least this cosine.
constexpr float kAgreement = 0.9f;
// Off its own plane a surfel counts as so many times as far: steps and thin gaps.
constexpr float kOffPlane = 3;

constexpr std::uint32_t kKindFlags = kSurfelSphere | kSurfelTwoSided;

// Receivers around a place, and their light at the place: of the plane that fits it best by their
// weights, so that a slope does not show as a step where they lie to one side. No less and no more
// than that of one of them.
class NearReceivers {
 public:
  void add(float weight, const glm::vec3& offset, const glm::vec3& light) {
    near_[count_++] = {double(weight), offset, light};
    weights_ += double(weight);
    middle_ += double(weight) * glm::dvec3(offset);
  }

  glm::vec3 light() const {
    // In double, for squares of small and large lengths
    const glm::dvec3 middle = middle_ / weights_;
    glm::dmat3 spread(0);
    for (const Near& each : near()) {
      const glm::dvec3 d = glm::dvec3(each.offset) - middle;
      spread += glm::outerProduct(each.weight / weights_ * d, d);
    }
    // Across a surface they do not spread, and tell nothing of the slope
    const double ridge = kRidge * (spread[0][0] + spread[1][1] + spread[2][2]);
    glm::dvec3 slope(0);
    if (ridge > 0) slope = glm::inverse(spread + glm::dmat3(ridge)) * middle;
    glm::dvec3 sum(0);
    glm::vec3 least = near_[0].light, most = least;
    for (const Near& each : near()) {
      const double along = glm::dot(slope, glm::dvec3(each.offset) - middle);
      sum += each.weight * (1 - along) * glm::dvec3(each.light);
      least = glm::min(least, each.light);
      most = glm::max(most, each.light);
    }
    return glm::clamp(glm::vec3(sum / weights_), least, most);
  }

 private:
  // Of the spread: less fits slopes to rounding and to what three receivers happen to tell.
  static constexpr double kRidge = 0.03;
  struct Near {
    double weight;
    glm::vec3 offset, light;
  };
  std::span<const Near> near() const { return std::span(near_).first(count_); }

  std::array<Near, 2 * kWindow> near_;
  std::size_t count_ = 0;
  double weights_ = 0;
  glm::dvec3 middle_{0};  // sum of weighted offsets
};

}  // namespace

float BounceReceivers::weight(const Surfel& at, const Surfel& from) const {
  if (((at.flags ^ from.flags) & kKindFlags) != 0) return 0;
  const float reach_sq = kReach * float(surfels_per_receiver_) * at.area;
  const glm::vec3 offset = from.position - at.position;
  const float height = glm::dot(offset, at.normal);  // zero for spheres
  const float distance_sq =
      glm::dot(offset, offset) + (kOffPlane * kOffPlane - 1) * height * height;
  if (!(distance_sq < 4 * reach_sq)) return 0;
  float agreement = 1;
  if (!at.isSphere()) {
    const float cosine = glm::dot(at.normal, from.normal);
    agreement = ((at.isTwoSided() ? std::abs(cosine) : cosine) - kAgreement) / (1 - kAgreement);
    if (!(agreement > 0)) return 0;
  }
  const float nearness = 1 - std::sqrt(distance_sq / reach_sq) / 2;
  return nearness * nearness * agreement;
}

bool BounceReceivers::isCovered(std::size_t i) const {
  const std::size_t begin = chosen_.size() - std::min(chosen_.size(), kWindow);
  return std::any_of(chosen_.begin() + static_cast<std::ptrdiff_t>(begin), chosen_.end(),
                     [&](const Chosen& chosen) {
                       return weight(surfels_[i], surfels_[chosen.surfel]) >= kCovering;
                     });
}

void BounceReceivers::choose(std::span<const Surfel> surfels) {
  surfels_ = surfels;
  chosen_.clear();
  chosen_before_.clear();
  receivers_.clear();
  for (std::size_t i = 0; i < surfels.size(); ++i) {
    if (surfels_per_receiver_ == 1 || !isCovered(i)) {
      chosen_.push_back({static_cast<std::uint32_t>(i)});
      receivers_.push_back({surfels[i].position, surfels[i].normal});
    }
    chosen_before_.push_back(static_cast<std::uint32_t>(chosen_.size()));
  }
  for (Chosen& chosen : chosen_) {
    const Surfel& surfel = surfels[chosen.surfel];
    if (!surfel.isTwoSided() || surfel.isSphere()) continue;
    chosen.back = static_cast<std::uint32_t>(receivers_.size());
    receivers_.push_back({surfel.position, -surfel.normal});
  }
}

glm::vec3 BounceReceivers::irradianceOf(std::size_t place,
                                        std::span<const glm::vec3> at_receivers) const {
  const std::uint32_t back = chosen_[place].back;
  return back == 0 ? at_receivers[place] : (at_receivers[place] + at_receivers[back]) * 0.5f;
}

glm::vec3 BounceReceivers::irradiance(std::size_t i,
                                      std::span<const glm::vec3> at_receivers) const {
  const std::size_t before = chosen_before_[i];
  if (before > 0 && chosen_[before - 1].surfel == i) return irradianceOf(before - 1, at_receivers);
  const std::size_t begin = before - std::min(before, kWindow);
  const std::size_t end = std::min(before + kWindow, chosen_.size());
  NearReceivers near;
  for (std::size_t place = begin; place < end; ++place) {
    const Surfel& from = surfels_[chosen_[place].surfel];
    const float w = weight(surfels_[i], from);
    if (w > 0) near.add(w, from.position - surfels_[i].position, irradianceOf(place, at_receivers));
  }
  return near.light();  // there is at least the one that covers it
}

}  // namespace surfeit
