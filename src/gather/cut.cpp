#include "gather/cut.h"

#include <algorithm>
#include <cstddef>
#include <limits>

// Compiled once for every instruction set (Highway, "foreach_target").
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "gather/cut.cpp"
#include <hwy/foreach_target.h>
// Highway's own headers come after
#include <hwy/highway.h>

#ifndef SURFEIT_CUT_CONSTANTS
#define SURFEIT_CUT_CONSTANTS
namespace surfeit {
namespace {

// What rises less than this above the horizon, in radians, is left out: even a full circle of it
// covers no more than the square of this.
constexpr float kHorizonSlope = 0.01f;

// The normals of a node with flatness f spread about their mean by sqrt(2 (1 - f)), root mean
// square; what counts is all within twice that.
constexpr float kNormalSpread = 2;
// Of a flat node, as normalRange: what faces nobody within that is left out.
constexpr float kFlatSpread = 1.2248f;

// A node turns its back on the packet for sure only when it looks smaller than this: radius over
// distance.
constexpr float kMostTurnedAway = 0.5f;

// What a rough node may look like, as a part of the max solid angle. A flat node is one tile of a
// surface and drawn as such; a rough one is a corner, an edge or a thicket, of which the receiver
// sees a part whose place and size the node knows and whose shape it does not. (Color RMSE of the
// lion on a plane with .4, .7, 1: 2.4, 2.1, 2.3 %.)
constexpr float kRoughShare = 0.6f;

// What is seen at a cosine to the normal below this weighs less: nodes may look larger by as much,
// up to mostCoarser. Not flat ones: tiles of a surface leave gaps when they are large. (Covered of
// a closed shell of 200,000 disks .9954 with and without, and .9927 if flat ones are larger as
// well.)
constexpr float kWholeCosine = 0.8f;

// A flat node of two-sided surfels turns its back on nobody.
float facingOf(const Node& node, const CutRules& rules) {
  return node.isFlat() && node.isTwoSided() ? 0 : rules.facing;
}

// Of what is below, over what a node looks like as a part of what it may; without fading a step.
float fadingSlope(const CutRules& rules) { return 1 / std::max(2 * rules.fading, 1e-6f); }

float horizonSlope(const CutRules& rules) { return rules.approximates() ? kHorizonSlope : 0; }

}  // namespace
}  // namespace surfeit
#endif

HWY_BEFORE_NAMESPACE();
namespace surfeit {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

// Siblings as columns.
struct alignas(64) Columns {
  float x[kMostSiblings] = {}, y[kMostSiblings] = {}, z[kMostSiblings] = {};
  float normal_x[kMostSiblings] = {}, normal_y[kMostSiblings] = {}, normal_z[kMostSiblings] = {};
  float radius[kMostSiblings] = {}, flatness[kMostSiblings] = {};
  float share[kMostSiblings] = {};    // what it may look like, as a part of the max solid angle
  float is_flat[kMostSiblings] = {};  // 1: yes
  float facing[kMostSiblings] = {};   // CutRules::facing; 0: seen from both sides
};
constexpr float kNodeShare = 2, kRoughNodeShare = 2 * kRoughShare;

// Nodes with surfels of groups that are not seen are opened wherever they face. Returns, as bits,
// those with some that are.
std::uint32_t ChooseGroups(std::span<const Node> siblings, const CutRules& rules,
                           Columns& columns) {
  std::uint32_t seen = 0;
  for (std::size_t i = 0; i < siblings.size(); ++i) {
    if (rules.isMixed(siblings[i])) columns.share[i] = columns.flatness[i] = 0;
    seen |= (rules.sees(siblings[i].groups) ? 1u : 0u) << i;
  }
  return seen;
}

SiblingClasses ClassifySiblings(std::span<const Node> siblings, const PacketView& view,
                                const CutRegion& region, const CutRules& rules) {
  Columns columns;
  for (std::size_t i = 0; i < siblings.size(); ++i) {
    const Node& node = siblings[i];
    columns.x[i] = node.position.x;
    columns.y[i] = node.position.y;
    columns.z[i] = node.position.z;
    columns.normal_x[i] = node.normal.x;
    columns.normal_y[i] = node.normal.y;
    columns.normal_z[i] = node.normal.z;
    columns.radius[i] = node.radius;
    columns.flatness[i] = node.flatness;
    columns.share[i] = node.isRough() ? kRoughNodeShare : kNodeShare;
    columns.is_flat[i] = node.isFlat() ? 1 : 0;
    columns.facing[i] = facingOf(node, rules);
  }
  std::uint32_t present = (1u << siblings.size()) - 1;
  if (!rules.seesAllGroups()) present = ChooseGroups(siblings, rules, columns);

  const hn::CappedTag<float, kMostSiblings> d;
  const auto zero = hn::Zero(d), one = hn::Set(d, 1.f);
  const auto packet_radius = hn::Set(d, view.radius);
  SiblingClasses classes;
  for (std::size_t at = 0; at < siblings.size(); at += hn::Lanes(d)) {
    const auto x = hn::Sub(hn::Load(d, columns.x + at), hn::Set(d, view.centre.x));
    const auto y = hn::Sub(hn::Load(d, columns.y + at), hn::Set(d, view.centre.y));
    const auto z = hn::Sub(hn::Load(d, columns.z + at), hn::Set(d, view.centre.z));
    const auto nx = hn::Load(d, columns.normal_x + at), ny = hn::Load(d, columns.normal_y + at);
    const auto nz = hn::Load(d, columns.normal_z + at);
    const auto radius = hn::Load(d, columns.radius + at);
    const auto flatness = hn::Load(d, columns.flatness + at);
    const auto distance_sq = hn::MulAdd(x, x, hn::MulAdd(y, y, hn::Mul(z, z)));
    const auto distance = hn::Sqrt(distance_sq);
    const auto nearest = hn::Sub(distance, packet_radius);
    const auto spread = hn::Mul(hn::Set(d, kNormalSpread),
                                hn::Sqrt(hn::Mul(hn::Set(d, 2.f), hn::Sub(one, flatness))));

    // As highestPoint and coarser
    const auto highest = [&](const PacketView& from, auto fx, auto fy, auto fz, auto away_sq,
                             auto away) HWY_ATTR {
      const auto ax = hn::Set(d, from.axis.x), ay = hn::Set(d, from.axis.y);
      const auto az = hn::Set(d, from.axis.z);
      const auto height = hn::MulAdd(fx, ax, hn::MulAdd(fy, ay, hn::Mul(fz, az)));
      const auto aside = hn::Sqrt(hn::Max(zero, hn::NegMulAdd(height, height, away_sq)));
      const auto cone_cosine = hn::Set(d, from.cone_cosine);
      const auto tilted =
          hn::MulAdd(height, cone_cosine, hn::Mul(aside, hn::Set(d, from.cone_sine)));
      const auto top = hn::IfThenElse(hn::Ge(height, hn::Mul(away, cone_cosine)), away, tilted);
      const auto cosine = hn::MulAdd(nx, ax, hn::MulAdd(ny, ay, hn::Mul(nz, az)));
      const auto lean = hn::Sqrt(hn::Max(zero, hn::NegMulAdd(cosine, cosine, one)));
      const auto lift = hn::Add(hn::Add(lean, spread), hn::Set(d, from.cone_sine));
      const auto rise = rules.approximates() ? hn::Mul(radius, hn::Min(one, lift)) : radius;
      return hn::Add(hn::Add(top, rise), hn::Set(d, from.lift));
    };
    const auto is_flat = hn::Gt(hn::Load(d, columns.is_flat + at), zero);
    const auto coarser = [&](auto from_nearest, auto top) HWY_ATTR {
      const auto gain = hn::Div(hn::Mul(hn::Set(d, kWholeCosine), from_nearest),
                                hn::Max(top, hn::Set(d, std::numeric_limits<float>::min())));
      const auto most = hn::IfThenElse(is_flat, one, hn::Set(d, rules.most_coarser));
      return hn::Min(most, hn::Max(one, gain));
    };

    // Below the horizon of all
    auto seen = hn::Lt(nearest, hn::Add(radius, hn::Set(d, rules.max_distance)));
    auto most_solid_angle =
        hn::Mul(hn::Load(d, columns.share + at), hn::Set(d, rules.max_solid_angle));
    const auto most_from_cluster = most_solid_angle;
    if (view.has_horizon) {
      const auto top = highest(view, x, y, z, distance_sq, distance);
      const auto reach = hn::Max(zero, hn::Sub(nearest, radius));
      seen = hn::And(seen, hn::Gt(top, hn::Mul(reach, hn::Set(d, horizonSlope(rules)))));
      if (rules.most_coarser > 1) {
        most_solid_angle = hn::Mul(most_solid_angle, coarser(nearest, top));
      }
    }

    // Outside the cones of all
    if (view.has_cone) {
      const auto along = hn::MulAdd(
          x, hn::Set(d, view.lobe_axis.x),
          hn::MulAdd(y, hn::Set(d, view.lobe_axis.y), hn::Mul(z, hn::Set(d, view.lobe_axis.z))));
      const auto aside = hn::Sqrt(hn::Max(zero, hn::NegMulAdd(along, along, distance_sq)));
      const auto outside = hn::Sub(hn::Mul(aside, hn::Set(d, view.lobe_cosine)),
                                   hn::Mul(along, hn::Set(d, view.lobe_sine)));
      seen = hn::And(seen, hn::Le(outside, hn::Add(radius, packet_radius)));
    }

    // Small enough
    const auto area = hn::Mul(hn::Set(d, kPi), hn::Mul(radius, radius));
    const auto away = hn::Mul(hn::Load(d, columns.facing + at),
                              hn::MulAdd(x, nx, hn::MulAdd(y, ny, hn::Mul(z, nz))));
    auto limit = hn::Mul(most_solid_angle, hn::Mul(nearest, nearest));
    const auto most_faded = hn::Set(d, 1 + rules.fading);
    auto may_be_far = hn::And(hn::Gt(nearest, radius), hn::Lt(area, hn::Mul(most_faded, limit)));
    auto far = may_be_far;

    // Of the region; all walks of a cluster calculate this alike
    if (region.part != CutRegion::Part::kAll) {
      const PacketView& cluster = region.cluster;
      const auto cx = hn::Sub(hn::Load(d, columns.x + at), hn::Set(d, cluster.centre.x));
      const auto cy = hn::Sub(hn::Load(d, columns.y + at), hn::Set(d, cluster.centre.y));
      const auto cz = hn::Sub(hn::Load(d, columns.z + at), hn::Set(d, cluster.centre.z));
      const auto centre_sq = hn::MulAdd(cx, cx, hn::MulAdd(cy, cy, hn::Mul(cz, cz)));
      const auto from_centre = hn::Sqrt(centre_sq);
      const auto from_cluster = hn::Sub(from_centre, hn::Set(d, cluster.radius));
      auto cluster_most = most_from_cluster;
      if (cluster.has_horizon && rules.most_coarser > 1) {
        const auto top = highest(cluster, cx, cy, cz, centre_sq, from_centre);
        cluster_most = hn::Mul(cluster_most, coarser(from_cluster, top));
      }
      const auto cluster_limit = hn::Mul(cluster_most, hn::Mul(from_cluster, from_cluster));
      const auto far_from_cluster =
          hn::And(hn::Gt(from_cluster, radius), hn::Lt(area, hn::Mul(most_faded, cluster_limit)));
      const auto border = hn::Set(d, region.limit);
      const auto beyond = hn::Ge(hn::Sub(from_centre, radius), border);
      const auto within = hn::Lt(hn::Add(from_centre, radius), border);
      const auto middle_beyond = hn::Ge(from_centre, border);
      // On the border every walk opens what fades, and one has the node itself
      if (region.part == CutRegion::Part::kNear) {
        seen = hn::AndNot(beyond, seen);
        limit = hn::IfThenElse(within, limit, cluster_limit);
        may_be_far = hn::Or(hn::And(within, may_be_far), hn::AndNot(within, far_from_cluster));
        far = hn::And(may_be_far, hn::Or(within, hn::Not(middle_beyond)));
      } else {
        seen = hn::AndNot(within, seen);
        limit = cluster_limit;
        may_be_far = far_from_cluster;
        far = hn::And(may_be_far, middle_beyond);
      }
    }

    // As fadedPart
    const auto tiny = hn::Set(d, std::numeric_limits<float>::min());
    const auto looks = hn::Div(area, hn::Max(limit, tiny));
    const auto part =
        hn::Mul(hn::Sub(looks, hn::Set(d, 1 - rules.fading)), hn::Set(d, fadingSlope(rules)));
    const auto below = hn::IfThenElse(may_be_far, hn::Min(one, hn::Max(zero, part)), one);

    // Turned away from all
    if (rules.facing != 0 && rules.approximates()) {
      const auto is_disk = hn::And(hn::Le(below, zero), is_flat);
      const auto size = hn::Add(packet_radius, hn::IfThenZeroElse(is_disk, radius));
      const auto normals =
          hn::IfThenElse(is_disk, hn::Mul(spread, hn::Set(d, kFlatSpread / kNormalSpread)), spread);
      const auto turn = hn::MulAdd(normals, distance, hn::Mul(hn::Set(d, 1.2f), size));
      const auto small = hn::Lt(size, hn::Mul(distance, hn::Set(d, kMostTurnedAway)));
      seen = hn::AndNot(hn::And(small, hn::Gt(away, turn)), seen);
    }
    const auto far_bits = hn::And(seen, far), open_bits = hn::And(seen, hn::Gt(below, zero));
    hn::StoreU(below, d, classes.below.data() + at);
    std::uint8_t bits[2][8] = {};
    hn::StoreMaskBits(d, far_bits, bits[0]);
    hn::StoreMaskBits(d, open_bits, bits[1]);
    classes.far |= std::uint32_t{bits[0][0]} << at;
    classes.open |= std::uint32_t{bits[1][0]} << at;
  }
  classes.far &= present;
  classes.open &= present;
  return classes;
}

SiblingClassifier Classifier() { return ClassifySiblings; }

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace surfeit
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
#include <cmath>
#include <glm/geometric.hpp>

namespace surfeit {
namespace {

// The highest that a node may rise above the horizon of a receiver of the packet.
float highestPoint(const Node& node, const glm::vec3& to_node, float distance, float spread,
                   const PacketView& view, const CutRules& rules) {
  // Height of the middle for the normal in the cone that comes closest to it
  const float height = glm::dot(to_node, view.axis);
  const float aside = std::sqrt(std::max(0.f, distance * distance - height * height));
  const float top = height >= distance * view.cone_cosine
                        ? distance
                        : height * view.cone_cosine + aside * view.cone_sine;
  if (!rules.approximates()) return top + view.lift + node.radius;

  // A flat node reaches less far up than aside
  const float cosine = glm::dot(node.normal, view.axis);
  const float lean = std::sqrt(std::max(0.f, 1 - cosine * cosine));
  return top + view.lift + node.radius * std::min(1.f, lean + spread + view.cone_sine);
}

// How much larger than others a node may look, whose highest point is this high.
float coarser(const Node& node, float nearest, float highest, const PacketView& view,
              const CutRules& rules) {
  if (node.isFlat() || !view.has_horizon) return 1;
  const float gain = kWholeCosine * nearest / std::max(highest, std::numeric_limits<float>::min());
  return std::clamp(gain, 1.f, rules.most_coarser);
}

// What becomes of a node: whether it is drawn as a whole, and how much what is below it counts.
struct Standing {
  bool is_far = false;
  float below = 1;
};

// How much what is below counts of a node that looks so large, as a part of what it may.
float fadedPart(float size, const CutRules& rules) {
  return std::clamp((size - (1 - rules.fading)) * fadingSlope(rules), 0.f, 1.f);
}

// A node may stand in for its surfels when its bounding sphere looks smaller than twice the max
// solid angle, or that share of it. A flat square of surfels has about 0.6 of its sphere's outline
// as area, so this is close to the memo's test on the area, but it also opens sparse nodes, whose
// area says nothing about how far their surfels spread. Never when only some of these are seen.
Standing standingOf(const Node& node, float nearest, float coarser, const CutRules& rules) {
  if (rules.isMixed(node)) return {};
  const float share = node.isRough() ? kRoughShare * coarser : coarser;
  const float area = kPi * node.radius * node.radius;
  const float limit = 2 * share * rules.max_solid_angle * nearest * nearest;
  if (!(nearest > node.radius && area < (1 + rules.fading) * limit)) return {};
  return {true, fadedPart(area / limit, rules)};
}

// Whether the walk takes something of the node. A node on the border is drawn where its middle is
// if it is far enough from the whole cluster, and opened by all as far as it is not.
bool isOfRegion(const Node& node, float spread, const CutRegion& region, const CutRules& rules,
                Standing& standing) {
  if (region.part == CutRegion::Part::kAll) return true;
  const PacketView& cluster = region.cluster;
  const glm::vec3 to_node = node.position - cluster.centre;
  const float from_centre = glm::length(to_node), nearest = from_centre - cluster.radius;
  const float highest = highestPoint(node, to_node, from_centre, spread, cluster, rules);
  const Standing from_cluster =
      standingOf(node, nearest, coarser(node, nearest, highest, cluster, rules), rules);
  const bool middle_beyond = from_centre >= region.limit;
  if (region.part == CutRegion::Part::kNear) {
    if (from_centre + node.radius < region.limit) return true;
    standing = {from_cluster.is_far && !middle_beyond, from_cluster.below};
    return from_centre - node.radius < region.limit;
  }
  standing = {from_cluster.is_far && middle_beyond, from_cluster.below};
  return from_centre + node.radius >= region.limit;
}

}  // namespace

SiblingClasses classifySiblings(std::span<const Node> siblings, const PacketView& view,
                                const CutRegion& region, const CutRules& rules) {
  SiblingClasses classes;
  for (std::size_t i = 0; i < siblings.size(); ++i) {
    const Node& node = siblings[i];
    if (!rules.sees(node.groups)) continue;
    const glm::vec3 to_node = node.position - view.centre;
    const float distance = glm::length(to_node), nearest = distance - view.radius;
    // The surfels that are seen may face anywhere when they are few of all
    const float flatness = rules.isMixed(node) ? 0 : node.flatness;
    const float spread = kNormalSpread * std::sqrt(2 * (1 - flatness));

    // Out of reach, or below the horizon of all
    if (!(nearest < rules.max_distance + node.radius)) continue;
    const float highest = highestPoint(node, to_node, distance, spread, view, rules);
    const float least_height = horizonSlope(rules) * std::max(0.f, nearest - node.radius);
    if (view.has_horizon && !(highest > least_height)) continue;

    // Outside the cones of all
    if (view.has_cone) {
      const float along = glm::dot(to_node, view.lobe_axis);
      const float aside = std::sqrt(std::max(0.f, distance * distance - along * along));
      if (aside * view.lobe_cosine - along * view.lobe_sine > node.radius + view.radius) continue;
    }

    Standing standing =
        standingOf(node, nearest, coarser(node, nearest, highest, view, rules), rules);
    if (!isOfRegion(node, spread, region, rules, standing)) continue;

    // Turned away from all: as one disk, or all the surfels below
    if (rules.facing != 0 && rules.approximates()) {
      const float away = facingOf(node, rules) * glm::dot(to_node, node.normal);
      const bool is_disk = !(standing.below > 0) && node.isFlat();
      const float size = view.radius + (is_disk ? 0 : node.radius);
      const float normals = is_disk ? kFlatSpread / kNormalSpread * spread : spread;
      const float turn = normals * distance + 1.2f * size;
      if (size < kMostTurnedAway * distance && away > turn) continue;
    }
    classes.below[i] = standing.below;
    if (standing.is_far) classes.far |= 1u << i;
    if (standing.below > 0) classes.open |= 1u << i;
  }
  return classes;
}

HWY_EXPORT(Classifier);
SiblingClassifier fastestSiblingClassifier() { return HWY_DYNAMIC_DISPATCH(Classifier)(); }

}  // namespace surfeit
#endif
