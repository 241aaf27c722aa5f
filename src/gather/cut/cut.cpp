#include "gather/cut/cut.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>
#include <iterator>
#include <limits>

// Compiled once for every instruction set (Highway, "foreach_target").
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "gather/cut/cut.cpp"
#include <hwy/foreach_target.h>
// Highway's own headers come after
#include <hwy/highway.h>

#include "gather/cut/vectors_of_3-inl.h"
#include "gather/rules/fidelity.h"

#ifndef SURFEIT_CUT_CONSTANTS
#define SURFEIT_CUT_CONSTANTS
namespace surfeit {
namespace {

// The slab and the cone of a node bound what a reader decodes; lengths and cosines are rounded once
// more on the way.
constexpr float kRoundingSlack = 1e-4f;

// The square of the distance from which on a node may stand in for its surfels: where its bounding
// sphere looks smaller than twice the max solid angle, or that share of it. (A flat square of
// surfels has about 0.6 of its sphere's outline as area, so this is close to the memo's test on the
// area, but also opens sparse nodes.) What lies off the plane that it is drawn on by a pixel is
// seen in another one. (Small lights differ from place to place by .065 of their power, without by
// .080; half a pixel makes nothing better but the city, AO RMSE .0053 instead of .0056, at .6 of
// its rate.) A node that shines on one of n parts of it may look 1 / n^2 as large, as long as it
// is wider than two pixels: receivers see a part of it, lit or dark. So also where no light is
// gathered, for occlusion is the same with light and without.
//
// Inlined, so that each instruction set has code of its own. Called from theirs, code of the oldest
// set waits at every node for the upper halves of registers (a fifth of the time of a gather, on an
// Intel Xeon).
HWY_INLINE float wholeDistanceSq(const Node& node, const CutRules& rules) {
  if (!rules.approximates() || rules.isMixed(node)) return std::numeric_limits<float>::infinity();
  const float share = node.isFlat() ? 1 : kFidelity.uneven_share;
  const float looks = kPi * node.radius * node.radius / (2 * share * rules.max_solid_angle);
  const float off_plane = node.off_plane * rules.pixels_per_slope;
  float whole = std::max(looks, off_plane * off_plane);
  if (node.radiosity_variance > 0) {
    const float half_width = node.radius * rules.pixels_per_slope;
    const float parts = 1 + node.radiosity_variance;
    whole = std::max(whole, std::min(looks * parts * parts, half_width * half_width));
  }
  return whole;
}

}  // namespace
}  // namespace surfeit
#endif

HWY_BEFORE_NAMESPACE();
namespace surfeit {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<float, kMostSiblings>;
using V = hn::Vec<D>;
using M = hn::Mask<D>;
V Splat(float value) { return hn::Set(D(), value); }
V Square(V x) { return hn::Mul(x, x); }
// sqrt(1 - x^2), and of a length instead of 1 with its square.
V Other(V square, V x) { return hn::Sqrt(hn::Max(hn::Zero(D()), hn::NegMulAdd(x, x, square))); }

using V3 = VectorsOf3<V>;

// Siblings, as many as there are lanes.
struct Nodes {
  V3 position, normal;
  V radius, thickness, normal_cosine, whole_distance_sq;

  Nodes(std::span<const Node> siblings, const CutRules& rules) {
    alignas(64) float columns[10][kMostSiblings] = {};
    for (std::size_t i = 0; i < std::min(siblings.size(), hn::Lanes(D())); ++i) {
      const Node& node = siblings[i];
      const float values[] = {node.position.x,    node.position.y,
                              node.position.z,    node.normal.x,
                              node.normal.y,      node.normal.z,
                              node.radius,        node.thickness,
                              node.normal_cosine, wholeDistanceSq(node, rules)};
      for (std::size_t column = 0; column < std::size(values); ++column) {
        columns[column][i] = values[column];
      }
    }
    const auto column = [&](int i) HWY_ATTR { return hn::Load(D(), columns[i]); };
    position = {column(0), column(1), column(2)};
    normal = {column(3), column(4), column(5)};
    radius = column(6);
    thickness = column(7);
    normal_cosine = column(8);
    whole_distance_sq = column(9);
  }
};

// Where they are, seen from a packet.
struct Places {
  V3 offset;
  V distance_sq, distance;
  V nearest;  // distance from the closest receiver
  V highest;  // above the horizon of any receiver; without a horizon 0

  Places(const PacketView& from, const Nodes& nodes) {
    offset = {hn::Sub(nodes.position.x, Splat(from.centre.x)),
              hn::Sub(nodes.position.y, Splat(from.centre.y)),
              hn::Sub(nodes.position.z, Splat(from.centre.z))};
    distance_sq = Dot(offset, offset);
    distance = hn::Sqrt(distance_sq);
    nearest = hn::Sub(distance, Splat(from.radius));
    highest = from.has_horizon ? HighestPoint(from, nodes) : hn::Zero(D());
  }

 private:
  // Of anything of the node, for any normal in the cone.
  V HighestPoint(const PacketView& from, const Nodes& nodes) const {
    const V zero = hn::Zero(D()), one = Splat(1);
    const V height = Dot(offset, from.axis);
    const V cone_cosine = Splat(from.cone_cosine), cone_sine = Splat(from.cone_sine);
    const V aside = hn::Mul(Other(distance_sq, height), cone_sine);
    const V tilted = hn::MulAdd(height, cone_cosine, aside);
    const V top = hn::IfThenElse(hn::Ge(height, hn::Mul(distance, cone_cosine)), distance, tilted);
    const V k = hn::Min(one, hn::Abs(Dot(nodes.normal, from.axis)));
    const V least =
        hn::Max(zero, hn::Sub(hn::Mul(k, cone_cosine), hn::Mul(Other(one, k), cone_sine)));
    const V across = Other(Square(nodes.radius), nodes.thickness);
    const V slanted = hn::MulAdd(nodes.thickness, least, hn::Mul(across, Other(one, least)));
    const V rise = hn::IfThenElse(hn::Le(hn::Mul(nodes.radius, least), nodes.thickness),
                                  nodes.radius, slanted);
    return hn::Add(hn::Add(top, rise), Splat(from.lift));
  }
};

// Outside the cones of all.
M IsOutsideCones(const PacketView& view, const Nodes& nodes, const Places& places) {
  const V along = Dot(places.offset, view.lobe_axis);
  const V aside = Other(places.distance_sq, along);
  const V outside =
      hn::Sub(hn::Mul(aside, Splat(view.lobe_cosine)), hn::Mul(along, Splat(view.lobe_sine)));
  return hn::Gt(outside, hn::Add(nodes.radius, Splat(view.radius)));
}

// Whether every surfel below shows its back to every receiver, and to where its rays begin.
M TurnsAway(const PacketView& view, const Nodes& nodes, const Places& places,
            const CutRules& rules) {
  const V along = hn::Mul(Splat(rules.facing), Dot(places.offset, nodes.normal));
  const V slack = hn::Mul(Splat(kRoundingSlack), places.distance);
  const V before = hn::MulAdd(Splat(rules.bias), nodes.radius, Splat(view.radius));
  const V size = hn::Add(hn::Add(before, nodes.thickness), slack);
  const V depth = hn::Max(hn::Zero(D()), hn::Sub(along, size));
  const V aside = hn::Add(Other(places.distance_sq, along), hn::Add(nodes.radius, before));
  return hn::Gt(hn::Mul(depth, nodes.normal_cosine),
                hn::Mul(aside, Other(Splat(1), nodes.normal_cosine)));
}

struct Bounds {
  M is_far, is_open;
};

// What openPart is for all receivers.
Bounds BoundsOf(const PacketView& view, const Nodes& nodes, const Places& places) {
  const V tiny = Splat(std::numeric_limits<float>::min());
  const V farthest = hn::Add(places.distance, Splat(view.radius));
  const V looks_most = hn::Div(nodes.whole_distance_sq, hn::Max(Square(places.nearest), tiny));
  const V looks_least = hn::Div(nodes.whole_distance_sq, hn::Max(Square(farthest), tiny));
  return {hn::And(hn::Gt(places.nearest, nodes.radius),
                  hn::Lt(looks_most, Splat(1 - kFidelity.fading))),
          hn::Or(hn::Lt(farthest, nodes.radius), hn::Gt(looks_least, Splat(1 + kFidelity.fading)))};
}

SiblingClasses ClassifySiblings(std::span<const Node> siblings, const PacketView& view,
                                const CutRules& rules) {
  const D d;
  std::uint32_t present = 0;
  for (std::size_t i = 0; i < siblings.size(); ++i) {
    present |= (rules.sees(siblings[i].groups) ? 1u : 0u) << i;
  }
  SiblingClasses classes;
  std::uint32_t all_seen = 0;
  for (std::size_t at = 0; at < siblings.size(); at += hn::Lanes(d)) {
    const Nodes nodes(siblings.subspan(at), rules);
    const Places places(view, nodes);
    M seen = hn::Lt(places.nearest, hn::Add(nodes.radius, Splat(rules.max_distance)));
    if (view.has_horizon) {
      const float slope = rules.approximates() ? kFidelity.horizon_slope : 0;
      const V reach = hn::Max(hn::Zero(d), hn::Sub(places.nearest, nodes.radius));
      seen = hn::And(seen, hn::Gt(places.highest, hn::Mul(reach, Splat(slope))));
    }
    if (view.has_cone) seen = hn::AndNot(IsOutsideCones(view, nodes, places), seen);
    if (rules.facing != 0 && rules.approximates()) {
      seen = hn::AndNot(TurnsAway(view, nodes, places, rules), seen);
    }
    const Bounds bounds = BoundsOf(view, nodes, places);
    std::uint8_t bits[3][8] = {};
    hn::StoreMaskBits(d, seen, bits[0]);
    hn::StoreMaskBits(d, bounds.is_far, bits[1]);
    hn::StoreMaskBits(d, bounds.is_open, bits[2]);
    all_seen |= std::uint32_t{bits[0][0]} << at;
    classes.far |= std::uint32_t{bits[1][0]} << at;
    classes.open |= std::uint32_t{bits[2][0]} << at;
  }
  all_seen &= present;
  classes.far &= all_seen;
  classes.open &= all_seen;
  classes.mixed = all_seen & ~(classes.far | classes.open);
  return classes;
}

SiblingClassifier Classifier() { return ClassifySiblings; }

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace surfeit
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

namespace surfeit {

float openPart(const Node& node, const LocalReceiver& receiver, const CutRules& rules) {
  const glm::vec3 to_node = node.position - receiver.position;
  const float distance_sq = glm::dot(to_node, to_node);
  if (!(std::sqrt(distance_sq) > node.radius)) return 1;
  const float looks = wholeDistanceSq(node, rules) / distance_sq, fading = kFidelity.fading;
  return std::clamp((looks - (1 - fading)) / (2 * fading), 0.f, 1.f);
}

HWY_EXPORT(Classifier);
SiblingClassifier fastestSiblingClassifier() { return HWY_DYNAMIC_DISPATCH(Classifier)(); }

}  // namespace surfeit
#endif
