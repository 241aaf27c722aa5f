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

#include "gather/vectors_of_3-inl.h"

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

// What a node that is not flat may look like, as a part of the max solid angle. A flat one is a
// tile of a surface and drawn as such; others are corners, edges or thickets, of which the receiver
// sees a part. (With .5, .67, .8, 1, at .13 sr and 14 pixels: color RMSE of the lion on a plane
// 1.9, 1.9, 2.0, 2.2 %; AO RMSE of spheres .0041, .0045, .0050, .0060.)
constexpr float kUnevenShare = 2.f / 3;

// What is seen at a cosine to the normal below this weighs less: nodes may look larger by as much,
// up to mostCoarser. Not flat ones: tiles of a surface leave gaps when they are large. (Covered of
// a closed shell of 200,000 disks .9954 with and without, and .9927 if flat ones are larger as
// well.)
constexpr float kWholeCosine = 0.8f;

// A flat node of two-sided surfels turns its back on nobody.
float facingOf(const Node& node, const CutRules& rules) {
  return node.isFlat() && node.isTwoSided() ? 0 : rules.facing;
}

float fadingOf(const Node& node, const CutRules& rules) {
  return rules.fading > 0 && node.isLeaf() ? kLeafFading : rules.fading;
}
// Of what is below, over what a node looks like as a part of what it may; without fading a step.
constexpr float kLeastFadingRange = 1e-6f;
float fadingSlope(float fading) { return 1 / std::max(2 * fading, kLeastFadingRange); }

float mostFadingSpread(const CutRules& rules) { return rules.fading > 0 ? kMostFadingSpread : 0; }
// What looks smaller or larger than these parts of what it may fades for nobody.
constexpr float kLeastFading = 0.6f, kMostFading = 1.6f;
static_assert(1 - kLeafFading > kLeastFading && 1 + kLeafFading < kMostFading);

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
  float fading[kMostSiblings] = {};   // as CutRules::fading
};
constexpr float kNodeShare = 2, kUnevenNodeShare = 2 * kUnevenShare;

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

using D = hn::CappedTag<float, kMostSiblings>;
using V = hn::Vec<D>;
using M = hn::Mask<D>;
V Splat(float value) { return hn::Set(D(), value); }

using V3 = VectorsOf3<V>;

// Some of the siblings.
struct Nodes {
  V3 position, normal;
  V radius, spread, share, area, fading;
  M is_flat;

  Nodes(const Columns& columns, std::size_t at) {
    const D d;
    position = {hn::Load(d, columns.x + at), hn::Load(d, columns.y + at),
                hn::Load(d, columns.z + at)};
    normal = {hn::Load(d, columns.normal_x + at), hn::Load(d, columns.normal_y + at),
              hn::Load(d, columns.normal_z + at)};
    radius = hn::Load(d, columns.radius + at);
    const V flatness = hn::Load(d, columns.flatness + at);
    spread =
        hn::Mul(Splat(kNormalSpread), hn::Sqrt(hn::Mul(Splat(2.f), hn::Sub(Splat(1), flatness))));
    share = hn::Load(d, columns.share + at);
    fading = hn::Load(d, columns.fading + at);
    area = hn::Mul(Splat(kPi), hn::Mul(radius, radius));
    is_flat = hn::Gt(hn::Load(d, columns.is_flat + at), hn::Zero(d));
  }
};

// Where they are, seen from a packet or a cluster.
struct Places {
  V3 offset;
  V distance_sq, distance;
  V nearest;  // distance from the closest receiver
  V highest;  // as highestPoint; without a horizon 0

  Places(const PacketView& from, const Nodes& nodes, const CutRules& rules) {
    offset = {hn::Sub(nodes.position.x, Splat(from.centre.x)),
              hn::Sub(nodes.position.y, Splat(from.centre.y)),
              hn::Sub(nodes.position.z, Splat(from.centre.z))};
    distance_sq = Dot(offset, offset);
    distance = hn::Sqrt(distance_sq);
    nearest = hn::Sub(distance, Splat(from.radius));
    highest = from.has_horizon ? HighestPoint(from, nodes, rules) : hn::Zero(D());
  }

 private:
  V HighestPoint(const PacketView& from, const Nodes& nodes, const CutRules& rules) const {
    const V zero = hn::Zero(D()), one = Splat(1);
    const V height = Dot(offset, from.axis);
    const V aside = hn::Sqrt(hn::Max(zero, hn::NegMulAdd(height, height, distance_sq)));
    const V cone_cosine = Splat(from.cone_cosine);
    const V tilted = hn::MulAdd(height, cone_cosine, hn::Mul(aside, Splat(from.cone_sine)));
    const V top = hn::IfThenElse(hn::Ge(height, hn::Mul(distance, cone_cosine)), distance, tilted);
    const V cosine = Dot(nodes.normal, from.axis);
    const V lean = hn::Sqrt(hn::Max(zero, hn::NegMulAdd(cosine, cosine, one)));
    const V lift = hn::Add(hn::Add(lean, nodes.spread), Splat(from.cone_sine));
    const V rise = rules.approximates() ? hn::Mul(nodes.radius, hn::Min(one, lift)) : nodes.radius;
    return hn::Add(hn::Add(top, rise), Splat(from.lift));
  }
};

// As Standing. Of what does not fade, the blend is whole or nothing.
struct Standings {
  M is_far, is_open;
  V at_centre;
  V3 slope;

  Standings(const PacketView& from, const Nodes& nodes, const Places& places,
            const CutRules& rules) {
    const D d;
    const V zero = hn::Zero(d), one = Splat(1);
    const V shift =
        hn::Min(Splat(from.radius), hn::Mul(places.distance, Splat(mostFadingSpread(rules))));
    const V looked_from = hn::Add(places.nearest, shift);
    V limit = hn::Mul(hn::Mul(nodes.share, Splat(rules.max_solid_angle)),
                      hn::Mul(looked_from, looked_from));
    M grows = hn::Gt(zero, zero);
    if (from.has_horizon && rules.most_coarser > 1) {
      // As coarser
      const V tiny = Splat(std::numeric_limits<float>::min());
      const V gain =
          hn::Div(hn::Mul(Splat(kWholeCosine), looked_from), hn::Max(places.highest, tiny));
      const V most = hn::IfThenElse(nodes.is_flat, one, Splat(rules.most_coarser));
      grows = hn::And(hn::Gt(gain, one), hn::Lt(gain, most));
      limit = hn::Mul(limit, hn::Min(most, hn::Max(one, gain)));
    }
    const V looks = hn::Div(nodes.area, limit);
    const V range = hn::Max(hn::Add(nodes.fading, nodes.fading), Splat(kLeastFadingRange));
    const V steepness = hn::Div(one, range);
    at_centre = hn::Mul(hn::Sub(looks, hn::Sub(one, nodes.fading)), steepness);
    slope = {zero, zero, zero};
    V differs = zero;  // the blend within the packet, from that at the centre
    const M may_fade =
        hn::And(hn::Gt(looks, Splat(kLeastFading)), hn::Lt(looks, Splat(kMostFading)));
    if (rules.fading > 0 && from.radius > 0 && !hn::AllFalse(d, may_fade)) {
      const V part = hn::Mul(shift, Splat(1 / from.radius));
      const V scale = hn::IfThenElseZero(may_fade, hn::Mul(hn::Mul(looks, steepness), part));
      const V toward =
          hn::Div(hn::Mul(scale, hn::IfThenElse(grows, Splat(3), Splat(2))), places.distance_sq);
      const V up = hn::IfThenElseZero(grows, hn::Div(scale, places.highest));
      slope = {hn::NegMulAdd(up, Splat(from.axis.x), hn::Mul(toward, places.offset.x)),
               hn::NegMulAdd(up, Splat(from.axis.y), hn::Mul(toward, places.offset.y)),
               hn::NegMulAdd(up, Splat(from.axis.z), hn::Mul(toward, places.offset.z))};
      differs = hn::Mul(Splat(from.radius), hn::Sqrt(Dot(slope, slope)));
    }
    is_far = hn::And(hn::And(hn::Gt(places.nearest, nodes.radius),
                             hn::Lt(nodes.area, hn::Mul(Splat(kMostFading), limit))),
                     hn::Lt(hn::Sub(at_centre, differs), one));
    is_open = hn::Not(is_far);
    if (rules.fading > 0) is_open = hn::Or(is_open, hn::Gt(hn::Add(at_centre, differs), zero));
    const M fades = hn::And(is_far, is_open);
    at_centre = hn::IfThenElse(fades, at_centre, hn::IfThenElseZero(is_open, one));
    slope = {hn::IfThenElseZero(fades, slope.x), hn::IfThenElseZero(fades, slope.y),
             hn::IfThenElseZero(fades, slope.z)};
  }

  // The same for a packet of which the centre is here from that of the cluster.
  void MoveTo(const glm::vec3& offset) { at_centre = hn::Add(at_centre, Dot(slope, offset)); }
};

// As isOfRegion. Returns those of which the walk takes something.
M TakeRegion(const Nodes& nodes, const PacketView& view, const CutRegion& region,
             const CutRules& rules, Standings& standings) {
  const Places places(region.cluster, nodes, rules);
  Standings from_cluster(region.cluster, nodes, places, rules);
  from_cluster.MoveTo(view.centre - region.cluster.centre);
  const V border = Splat(region.limit);
  const M beyond = hn::Ge(hn::Sub(places.distance, nodes.radius), border);
  const M within = hn::Lt(hn::Add(places.distance, nodes.radius), border);
  const M middle_beyond = hn::Ge(places.distance, border);
  if (region.part == CutRegion::Part::kFar) {
    standings = from_cluster;
    standings.is_far = hn::And(standings.is_far, middle_beyond);
    return hn::Not(within);
  }
  const auto choose = [&](V own, V common) HWY_ATTR { return hn::IfThenElse(within, own, common); };
  standings.is_far = hn::Or(hn::And(within, standings.is_far),
                            hn::AndNot(hn::Or(within, middle_beyond), from_cluster.is_far));
  standings.is_open =
      hn::Or(hn::And(within, standings.is_open), hn::AndNot(within, from_cluster.is_open));
  standings.at_centre = choose(standings.at_centre, from_cluster.at_centre);
  standings.slope = {choose(standings.slope.x, from_cluster.slope.x),
                     choose(standings.slope.y, from_cluster.slope.y),
                     choose(standings.slope.z, from_cluster.slope.z)};
  return hn::Not(beyond);
}

// Outside the cones of all.
M IsOutsideCones(const PacketView& view, const Nodes& nodes, const Places& places) {
  const V along = Dot(places.offset, view.lobe_axis);
  const V aside = hn::Sqrt(hn::Max(hn::Zero(D()), hn::NegMulAdd(along, along, places.distance_sq)));
  const V outside =
      hn::Sub(hn::Mul(aside, Splat(view.lobe_cosine)), hn::Mul(along, Splat(view.lobe_sine)));
  return hn::Gt(outside, hn::Add(nodes.radius, Splat(view.radius)));
}

// Turned away from all: as one disk, or all the surfels below.
M TurnsAway(const PacketView& view, const Nodes& nodes, const Places& places, V facing, M is_open) {
  const V away = hn::Mul(facing, Dot(places.offset, nodes.normal));
  const M is_disk = hn::AndNot(is_open, nodes.is_flat);
  const V size = hn::Add(Splat(view.radius), hn::IfThenZeroElse(is_disk, nodes.radius));
  const V normals = hn::IfThenElse(
      is_disk, hn::Mul(nodes.spread, Splat(kFlatSpread / kNormalSpread)), nodes.spread);
  const V turn = hn::MulAdd(normals, places.distance, hn::Mul(Splat(1.2f), size));
  const M is_small = hn::Lt(size, hn::Mul(places.distance, Splat(kMostTurnedAway)));
  return hn::And(is_small, hn::Gt(away, turn));
}

Columns ColumnsOf(std::span<const Node> siblings, const CutRules& rules) {
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
    columns.share[i] = node.isFlat() ? kNodeShare : kUnevenNodeShare;
    columns.is_flat[i] = node.isFlat() ? 1 : 0;
    columns.facing[i] = facingOf(node, rules);
    columns.fading[i] = fadingOf(node, rules);
  }
  return columns;
}

SiblingClasses ClassifySiblings(std::span<const Node> siblings, const PacketView& view,
                                const CutRegion& region, const CutRules& rules) {
  Columns columns = ColumnsOf(siblings, rules);
  std::uint32_t present = (1u << siblings.size()) - 1;
  if (!rules.seesAllGroups()) present = ChooseGroups(siblings, rules, columns);

  const D d;
  SiblingClasses classes;
  for (std::size_t at = 0; at < siblings.size(); at += hn::Lanes(d)) {
    const Nodes nodes(columns, at);
    const Places places(view, nodes, rules);
    M seen = hn::Lt(places.nearest, hn::Add(nodes.radius, Splat(rules.max_distance)));
    if (view.has_horizon) {
      const V reach = hn::Max(hn::Zero(d), hn::Sub(places.nearest, nodes.radius));
      seen = hn::And(seen, hn::Gt(places.highest, hn::Mul(reach, Splat(horizonSlope(rules)))));
    }
    if (view.has_cone) seen = hn::AndNot(IsOutsideCones(view, nodes, places), seen);
    Standings standings(view, nodes, places, rules);
    if (region.part != CutRegion::Part::kAll) {
      seen = hn::And(seen, TakeRegion(nodes, view, region, rules, standings));
    }
    if (rules.facing != 0 && rules.approximates()) {
      const V facing = hn::Load(d, columns.facing + at);
      seen = hn::AndNot(TurnsAway(view, nodes, places, facing, standings.is_open), seen);
    }
    hn::StoreU(standings.at_centre, d, classes.at_centre.data() + at);
    hn::StoreU(standings.slope.x, d, classes.slope_x.data() + at);
    hn::StoreU(standings.slope.y, d, classes.slope_y.data() + at);
    hn::StoreU(standings.slope.z, d, classes.slope_z.data() + at);
    std::uint8_t bits[2][8] = {};
    hn::StoreMaskBits(d, hn::And(seen, standings.is_far), bits[0]);
    hn::StoreMaskBits(d, hn::And(seen, standings.is_open), bits[1]);
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

// What becomes of a node: whether it is drawn as a whole, whether what is below it is looked at,
// and how much that counts.
struct Standing {
  bool is_far = false, is_open = true;
  Blend below;
};

// A node may stand in for its surfels when its bounding sphere looks smaller than twice the max
// solid angle, or that share of it. A flat square of surfels has about 0.6 of its sphere's outline
// as area, so this is close to the memo's test on the area, but it also opens sparse nodes, whose
// area says nothing about how far their surfels spread. Never when only some of these are seen.
Standing standingOf(const Node& node, const glm::vec3& to_node, float highest,
                    const PacketView& view, const CutRules& rules) {
  if (rules.isMixed(node)) return {};
  const float distance = glm::length(to_node), nearest = distance - view.radius;
  const float shift = std::min(view.radius, mostFadingSpread(rules) * distance);
  const float looked_from = nearest + shift;
  const float gain = coarser(node, looked_from, highest, view, rules);
  const float share = node.isFlat() ? gain : kUnevenShare * gain;
  const float area = kPi * node.radius * node.radius;
  const float limit = 2 * share * rules.max_solid_angle * looked_from * looked_from;
  if (!(nearest > node.radius && area < kMostFading * limit)) return {};
  const float looks = area / limit;
  const float fading = fadingOf(node, rules), steepness = fadingSlope(fading);
  Blend below{(looks - (1 - fading)) * steepness, glm::vec3(0)};
  if (fading > 0 && view.radius > 0 && looks > kLeastFading) {
    // The limit changes with the distance squared and, for what is low, with the distance over the
    // height
    const bool grows = gain > 1 && gain < rules.most_coarser;
    const glm::vec3 toward = ((grows ? 3.f : 2.f) / (distance * distance)) * to_node;
    const glm::vec3 change = grows ? toward - view.axis / highest : toward;
    below.slope = looks * steepness * (shift / view.radius) * change;
  }
  const float differs = view.radius * glm::length(below.slope);
  if (!(below.at_centre - differs < 1)) return {};
  if (!(fading > 0 && below.at_centre + differs > 0)) {
    return {true, false, {0, glm::vec3(0)}};
  }
  return {true, true, below};
}

// Whether the walk takes something of the node. A node on the border is drawn where its middle is
// if it is far enough from the whole cluster, and opened by all as far as it is not.
bool isOfRegion(const Node& node, float spread, const PacketView& view, const CutRegion& region,
                const CutRules& rules, Standing& standing) {
  if (region.part == CutRegion::Part::kAll) return true;
  const PacketView& cluster = region.cluster;
  const glm::vec3 to_node = node.position - cluster.centre;
  const float from_centre = glm::length(to_node);
  const float highest = highestPoint(node, to_node, from_centre, spread, cluster, rules);
  Standing from_cluster = standingOf(node, to_node, highest, cluster, rules);
  from_cluster.below.at_centre += glm::dot(from_cluster.below.slope, view.centre - cluster.centre);
  const bool middle_beyond = from_centre >= region.limit;
  if (region.part == CutRegion::Part::kNear) {
    if (from_centre + node.radius < region.limit) return true;
    standing = from_cluster;
    standing.is_far = standing.is_far && !middle_beyond;
    return from_centre - node.radius < region.limit;
  }
  standing = from_cluster;
  standing.is_far = standing.is_far && middle_beyond;
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

    Standing standing = standingOf(node, to_node, highest, view, rules);
    if (!isOfRegion(node, spread, view, region, rules, standing)) continue;

    // Turned away from all: as one disk, or all the surfels below
    if (rules.facing != 0 && rules.approximates()) {
      const float away = facingOf(node, rules) * glm::dot(to_node, node.normal);
      const bool is_disk = !standing.is_open && node.isFlat();
      const float size = view.radius + (is_disk ? 0 : node.radius);
      const float normals = is_disk ? kFlatSpread / kNormalSpread * spread : spread;
      const float turn = normals * distance + 1.2f * size;
      if (size < kMostTurnedAway * distance && away > turn) continue;
    }
    classes.setBelow(i, standing.below);
    if (standing.is_far) classes.far |= 1u << i;
    if (standing.is_open) classes.open |= 1u << i;
  }
  return classes;
}

HWY_EXPORT(Classifier);
SiblingClassifier fastestSiblingClassifier() { return HWY_DYNAMIC_DISPATCH(Classifier)(); }

}  // namespace surfeit
#endif
