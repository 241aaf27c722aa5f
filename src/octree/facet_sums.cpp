#include "octree/facet_sums.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace surfeit {
namespace {

double dotOfNormals(const AreaSums& a, const AreaSums& b) {
  return a.normal[0] * b.normal[0] + a.normal[1] * b.normal[1] + a.normal[2] * b.normal[2];
}

// Within 10 degrees.
bool faceAlike(const AreaSums& a, const AreaSums& b) {
  constexpr double kCosineSq = 0.97;
  const double dot = dotOfNormals(a, b);
  return dot > 0 && dot * dot > kCosineSq * dotOfNormals(a, a) * dotOfNormals(b, b);
}

}  // namespace

void FacetSums::add(const AreaSums& facet) {
  if (has_given_up_) return;
  for (std::size_t i = 0; i < count_; ++i) {
    if (faceAlike(groups_[i], facet)) return groups_[i].add(facet);
  }
  groups_[count_++] = facet;
  if (count_ > kMostFacets) merge(closest());
}

void FacetSums::add(const FacetSums& child, const double (&shift)[3]) {
  if (child.has_given_up_) giveUp();
  for (AreaSums group : child.groups()) {
    group.move(shift);
    add(group);
  }
}

void FacetSums::giveUp() {
  has_given_up_ = true;
  count_ = 0;
}

FacetSums::Pair FacetSums::closest() const {
  std::array<double, kMostFacets + 1> lengths;
  for (std::size_t i = 0; i < count_; ++i) lengths[i] = groups_[i].normalLength();
  Pair closest{0, 1};
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < count_; ++i) {
    for (std::size_t j = i + 1; j < count_; ++j) {
      const double both_sq = lengths[i] * lengths[i] + lengths[j] * lengths[j] +
                             2 * dotOfNormals(groups_[i], groups_[j]);
      const double loss = lengths[i] + lengths[j] - std::sqrt(std::max(0.0, both_sq));
      if (loss < least) {
        least = loss;
        closest = {i, j};
      }
    }
  }
  return closest;
}

void FacetSums::merge(const Pair& pair) {
  groups_[pair.first].add(groups_[pair.second]);
  --count_;
  groups_[pair.second] = groups_[count_];
}

FacetSums FacetSums::fewest(float flatness) const {
  FacetSums fewest;
  for (FacetSums fewer = *this; fewer.count_ > 0; fewer.merge(fewer.closest())) {
    double area = 0, facing = 0;
    for (const AreaSums& group : fewer.groups()) {
      area += group.area;
      facing += group.normalLength();
    }
    if (!(facing > double(flatness) * area)) break;
    fewest = fewer;
    if (fewer.count_ == 1) break;
  }
  return fewest;
}

}  // namespace surfeit
