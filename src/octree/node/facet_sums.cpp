#include "octree/node/facet_sums.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "octree/node/hidden_layers.h"

namespace surfeit {
namespace {

double dotOfNormals(const AreaSums& a, const AreaSums& b) {
  return a.normal[0] * b.normal[0] + a.normal[1] * b.normal[1] + a.normal[2] * b.normal[2];
}

// Whether two-sided groups lie in about one plane, and only their normals are turned: not so the
// opposite walls of a house.
bool areTurned(const FacetGroup& a, const FacetGroup& b) {
  constexpr double kFarthest = 0.1;  // from each other's plane, over the root of the area
  if (!a.is_two_sided || !(dotOfNormals(a, b) < 0)) return false;
  const FacetGroup& larger = a.area > b.area ? a : b;
  const glm::dvec3 between = a.middle() - b.middle();
  double distance = 0;
  for (int axis = 0; axis < 3; ++axis) distance += between[axis] * larger.normal[axis];
  return std::abs(distance) <= kFarthest * std::sqrt(larger.area) * larger.normalLength();
}

// Of the normals, as they are when those are turned back.
double facingDot(const FacetGroup& a, const FacetGroup& b) {
  const double dot = dotOfNormals(a, b);
  return areTurned(a, b) ? -dot : dot;
}

bool areOneKind(const FacetGroup& a, const FacetGroup& b) {
  return a.is_two_sided == b.is_two_sided && a.is_translucent == b.is_translucent;
}

bool areLayers(const FacetGroup& a, const FacetGroup& b) {
  if ((a.hidden | b.hidden) == 0 || a.is_two_sided != b.is_two_sided) return false;
  return a.hidden != (areTurned(a, b) ? turnedSides(b.hidden) : b.hidden);
}

// From 0 to 1.
double differenceOf(const FacetGroup& a, const FacetGroup& b) {
  if (a.is_translucent != b.is_translucent || areLayers(a, b)) return 1;
  return a.is_translucent ? double(hidingDifference(a.opacity(), b.opacity())) : 0;
}

bool hideAlike(const FacetGroup& a, const FacetGroup& b) {
  return differenceOf(a, b) < kAlikeOpacitySq;
}

// Within 10 degrees.
bool faceAlike(const FacetGroup& a, const FacetGroup& b) {
  if (a.is_two_sided != b.is_two_sided || !hideAlike(a, b)) return false;
  const double dot = facingDot(a, b);
  return dot > 0 && dot * dot > kAlikeCosineSq * dotOfNormals(a, a) * dotOfNormals(b, b);
}

}  // namespace

FacetGroup::FacetGroup(const AreaSums& sums, const Surfel& surfel)
    : AreaSums(sums),
      is_two_sided(surfel.isTwoSided()),
      is_translucent(surfel.isTranslucent()),
      hidden(hiddenSidesOf(surfel)) {
  for (int axis = 0; axis < 3; ++axis) {
    normal[axis] = area * double(surfel.normal[axis]);
    for (int color = 0; color < 3; ++color) {
      power_normal[color][axis] = radiosity[color] * double(surfel.normal[axis]);
    }
  }
}

void FacetGroup::add(const FacetGroup& other) {
  const bool is_turned = areTurned(*this, other);
  hidden &= is_turned ? turnedSides(other.hidden) : other.hidden;
  AreaSums sums = other;
  if (is_turned) {
    for (int axis = 0; axis < 3; ++axis) {
      sums.normal[axis] = -sums.normal[axis];
      for (auto& by_color : sums.power_normal) by_color[axis] = -by_color[axis];
    }
  }
  AreaSums::add(sums);
}

void FacetSums::add(const FacetGroup& facet) {
  if (has_given_up_) return;
  for (std::size_t i = 0; i < count_; ++i) {
    if (faceAlike(groups_[i], facet)) return groups_[i].add(facet);
  }
  groups_[count_++] = facet;
  if (count_ > kMostFacets) merge(*closest());  // of seven groups, two are of one of four kinds
}

void FacetSums::add(const FacetSums& child, const double (&shift)[3]) {
  if (child.has_given_up_) giveUp();
  for (FacetGroup group : child.groups()) {
    group.move(shift);
    add(group);
  }
}

void FacetSums::giveUp() {
  has_given_up_ = true;
  count_ = 0;
}

std::optional<FacetSums::Pair> FacetSums::closest() const {
  std::array<double, kMostFacets + 1> lengths;
  for (std::size_t i = 0; i < count_; ++i) lengths[i] = groups_[i].normalLength();
  std::optional<Pair> closest;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < count_; ++i) {
    for (std::size_t j = i + 1; j < count_; ++j) {
      if (!areOneKind(groups_[i], groups_[j])) continue;
      const double both_sq =
          lengths[i] * lengths[i] + lengths[j] * lengths[j] + 2 * facingDot(groups_[i], groups_[j]);
      double loss = lengths[i] + lengths[j] - std::sqrt(std::max(0.0, both_sq));
      loss += differenceOf(groups_[i], groups_[j]) * std::min(groups_[i].area, groups_[j].area);
      if (!closest || loss < least) {
        least = loss;
        closest = Pair{i, j};
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

bool FacetSums::hideDifferently() const {
  for (std::size_t i = 0; i < count_; ++i) {
    for (std::size_t j = i + 1; j < count_; ++j) {
      if (!hideAlike(groups_[i], groups_[j])) return true;
    }
  }
  return false;
}

std::uint8_t FacetSums::hiddenSides() const {
  std::uint8_t all = count_ > 0 ? kHiddenSides : 0;
  for (const FacetGroup& group : groups()) all &= group.hidden;
  return all;
}

FacetSums FacetSums::fewest(float flatness) const {
  FacetSums fewest;
  FacetSums fewer = *this;
  while (fewer.count_ > 0) {
    double area = 0, facing = 0;
    for (const FacetGroup& group : fewer.groups()) {
      area += group.area;
      facing += group.normalLength();
    }
    if (!(facing > double(flatness) * area)) break;
    fewest = fewer;
    const std::optional<Pair> closest = fewer.closest();
    if (!closest) break;
    if (!hideAlike(fewer.groups_[closest->first], fewer.groups_[closest->second])) break;
    fewer.merge(*closest);
  }
  return fewest;
}

}  // namespace surfeit
