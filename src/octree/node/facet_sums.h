// The facets of a node while it is summed up.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "octree/node/area_sums.h"
#include "octree/node/node_facet.h"

namespace surfeit {

// Normals within 10 degrees of each other are alike: the square of their cosine is above this.
inline constexpr double kAlikeCosineSq = 0.97;
// So are opacities, in every color: the square of their difference is below that of the sine, .03.
// Two sheets of a and b let through (1 - a) (1 - b), two of their mean a fourth of the square more.
inline constexpr double kAlikeOpacitySq = 1 - kAlikeCosineSq;

// Surfels that face about one way; two-sided ones of a plane may face the other way as well.
struct FacetGroup : AreaSums {
  // `normal` and `power_normal` are sums of those turned to one side, within a plane.
  bool is_two_sided = false;
  bool is_translucent = false;
  std::uint8_t hidden = 0;  // HiddenSides of all of them, by that normal

  FacetGroup() = default;
  // One surfel; it has a normal. `sums` are its own.
  FacetGroup(const AreaSums& sums, const Surfel& surfel);
  void add(const FacetGroup& other);
  // Area-weighted mean, by color.
  glm::vec3 opacity() const {
    return glm::vec3(glm::dvec3(covered[0], covered[1], covered[2]) / area);
  }
};

// Groups of surfels that face about one way. What is added joins the group that it resembles, and
// when there are too many, the two groups become one that lose least by it: the loss is the area
// that faces one way less, |N_a| + |N_b| - |N_a + N_b| with N = sum A n, and the smaller area times
// the square of the difference of their opacities, or all of it where one has hidden sides that the
// other has not. The order of adding decides what is grouped with what. One-sided and two-sided
// surfels stay apart, and so do opaque and translucent ones: the mean of a wall and a pane hides as
// neither does. Plain data.
class FacetSums {
 public:
  void add(const FacetGroup& facet);
  // Those of a child, `shift` farther from our origin.
  void add(const FacetSums& child, const double (&shift)[3]);
  // There are no facets and will be none: some surfels have no normal.
  void giveUp();

  // As few groups as hold together more than `flatness` of the area, as sum |N| over sum A, and are
  // hidden alike; none when all do not.
  FacetSums fewest(float flatness) const;
  // One piece would hide otherwise than they do: some of one kind have other hidden sides or other
  // opacities than others, or some are translucent and others opaque.
  bool hideDifferently() const;
  // Sides that are hidden of all.
  std::uint8_t hiddenSides() const;
  std::span<const FacetGroup> groups() const { return std::span(groups_).first(count_); }

 private:
  struct Pair {
    std::size_t first, second;
  };
  // None where all are different kinds.
  std::optional<Pair> closest() const;
  void merge(const Pair& pair);

  std::array<FacetGroup, kMostFacets + 1> groups_;
  std::size_t count_ = 0;
  bool has_given_up_ = false;
};

}  // namespace surfeit
