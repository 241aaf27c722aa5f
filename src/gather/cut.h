// The cut: the nodes and surfels of the octree that a packet of receivers sees (memo, section 3).
// Walked by the gather, which draws them, and by whoever wants to know which pages that takes.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <span>

#include "core/curve_key.h"
#include "gather/gather_rules.h"
#include "gather/receiver.h"
#include "octree/node.h"
#include "surfeit/gather.h"
#include "surfeit/status.h"
#include "surfeit/surfel.h"

namespace surfeit {

// Where the receivers of a packet are and where they look: all that the cut depends on.
struct PacketView {
  glm::vec3 centre{0};
  float radius = 0;      // of a sphere around the centre that holds all receivers
  bool has_horizon = 0;  // what follows means something; false when some receiver has no normal, or
                         // when the normals differ too much
  glm::vec3 axis{0};     // mean normal, unit
  float cone_cosine = 1, cone_sine = 0;  // of the angle between the axis and the farthest normal
  float lift = 0;  // the centre lies at most this high above the horizon of a receiver

  bool has_cone = false;   // nothing is looked at outside a cone around each receiver's lobe
  glm::vec3 lobe_axis{0};  // mean axis of the lobes, unit
  float lobe_cosine = 0, lobe_sine = 1;  // of the angle to the farthest direction in any cone
};

// `receivers`: at least one. Without rules, as for a hemisphere.
PacketView viewPacket(std::span<const Receiver> receivers);
PacketView viewPacket(std::span<const Receiver> receivers, const GatherRules& rules);

// A cluster of packets divides what lies around it: what is closer to its centre than the limit
// each packet looks at by itself, the rest they look at together (docs/algorithm.md, "The shared
// far field"). The cluster's two kinds of walk take every surfel exactly once between them.
struct CutRegion {
  enum class Part : std::uint8_t { kAll, kNear, kFar };
  Part part = Part::kAll;
  PacketView cluster{};  // all its receivers
  float limit = 0;

  // Whether a surfel here is of the part.
  bool holds(const glm::vec3& position) const {
    if (part == Part::kAll) return true;
    const glm::vec3 offset = position - cluster.centre;
    const bool is_near = glm::dot(offset, offset) < limit * limit;
    return is_near == (part == Part::kNear);
  }
};

// How a cut is chosen.
struct CutRules {
  float max_solid_angle = 0;  // 0: nothing stands in for anything, and nothing visible is left out
  float max_distance = 0;
  float facing = 1;                   // 1: only fronts are seen, -1: only backs, 0: both
  std::uint64_t groups = kAllGroups;  // set of the groups that are seen
  float most_coarser = 1;             // what is low may look so many times as large
  float fading = 0;  // nodes that look by this part smaller or larger than they may fade; if any
                     // do, leaves by kLeafFading

  bool approximates() const { return max_solid_angle > 0; }
  bool seesAllGroups() const { return groups == kAllGroups; }
  bool sees(std::uint64_t some_of) const { return seesAllGroups() || (groups & some_of) != 0; }
  // Whether surfels that are not seen lie below: what the node says is not what those seen are
  // like.
  bool isMixed(const Node& node) const { return (node.groups & ~groups) != 0; }
};

// How much something counts for each receiver of a packet, 0..1, where a node fades into what is
// below it.
struct Blend {
  float at_centre = 1;  // of the packet; beyond 0..1 where only receivers beside it see a change
  glm::vec3 slope{0};   // for each unit away from there
  bool isWhole() const { return at_centre >= 1 && slope == glm::vec3(0); }
  Blend rest() const { return {1 - at_centre, -slope}; }
  // For a receiver that is here from the centre.
  float at(const glm::vec3& offset) const {
    return std::clamp(at_centre + glm::dot(slope, offset), 0.f, 1.f);
  }
};

// Of one parent.
inline constexpr std::size_t kMostSiblings = 8;

// What the test for siblings says. A node of both classes fades from one into the other.
struct SiblingClasses {
  std::uint32_t far = 0;   // bit i: node i is drawn as a whole
  std::uint32_t open = 0;  // bit i: its children or surfels are looked at
  // How much the latter count, of nodes in some class; the node itself has the rest
  Blend below(std::size_t i) const { return {at_centre[i], {slope_x[i], slope_y[i], slope_z[i]}}; }
  void setBelow(std::size_t i, const Blend& blend) {
    at_centre[i] = blend.at_centre;
    slope_x[i] = blend.slope.x;
    slope_y[i] = blend.slope.y;
    slope_z[i] = blend.slope.z;
  }
  std::array<float, kMostSiblings> at_centre, slope_x, slope_y, slope_z;
};

// From one place to the next, a node would give way to its children at once, and what they show
// differently would be a step. So it fades into them while it looks by this part smaller to this
// part larger than it may. (Largest steps of irradiance along lines in a box, of its
// mean: 2.2, 1.7, .5, .8, .3 % with 0; 1.1, 1.0, .2, .4, .2 with .015, .02 and .03, for 3 to 5 %
// more patches with .02. bench/line_steps.sh)
inline constexpr float kFading = 0.02f;
// Leaves fade by this part: their surfels are near and ray traced, which differs more, and where a
// surface touches another the next receiver may be farther by a percent. (Largest jump of
// irradiance below a sphere on the floor, bench/line_steps.sh: .62 % with kFading, .45 %, for 2 %
// more patches.)
inline constexpr float kLeafFading = 0.1f;
// Each receiver of a packet has its own blend, as long as the packet's radius is no larger than
// this part of the distance; in one that is larger all have, more and more, that of the closest:
// too many nodes would fade. (With .03 instead of .2 the largest jumps of irradiance on the floor
// are 1.0 and 1.2 instead of .2 and .6 %, where a sphere touches it and 16 receivers are as wide as
// a tenth of the way; for 2 % more patches.)
inline constexpr float kMostFadingSpread = 0.2f;

// Sorts siblings by what the packet makes of them; those in neither class are not seen, and those
// in both fade. docs/algorithm.md, "Choosing the cut", has the tests. This is the definition.
SiblingClasses classifySiblings(std::span<const Node> siblings, const PacketView& view,
                                const CutRegion& region, const CutRules& rules);

// The same, eight at once, for this machine. Results may differ where rounding decides.
using SiblingClassifier = SiblingClasses (*)(std::span<const Node>, const PacketView&,
                                             const CutRegion&, const CutRules&);
SiblingClassifier fastestSiblingClassifier();

// Calls visit.node(const Node&, const Blend&) for the nodes small enough as a whole, and
// visit.leaf(const Node&) and visit.surfels(std::span<const Surfel>, const Blend&) for leaves too
// near, of whose surfels the region may not hold all. The blend says how much they count, where a
// node fades into what is below. Surfels of groups that are not seen are left out.
// `Reader` has the functions of PagedOctree::Reader. The order depends on octree and view alone.
// One thread at a time.
class CutWalk {
 public:
  explicit CutWalk(const GatherRules& rules,
                   SiblingClassifier classify = fastestSiblingClassifier())
      : rules_{maxSolidAngle(rules), rules.quality.max_distance, facingOf(rules.quality.sides),
               rules.groups, mostCoarser(rules)},
        classify_(classify) {}

  template <typename Reader, typename Visit>
  Status walk(const PacketView& view, const CutRegion& region, Reader& octree, Visit&& visit) {
    nodes_visited_ = surfels_visited_ = 0;
    std::size_t stack_count = 0;
    stack_[stack_count++] = {kRootRange, {}};
    while (stack_count > 0) {
      const auto [range, blend] = stack_[--stack_count];
      const bool fades = !blend.isWhole();
      SURFEIT_ASSIGN_OR_RETURN(const std::span<const Node> siblings, octree.nodes(range));
      nodes_visited_ += siblings.size();
      SURFEIT_RETURN_IF_ERROR(octree.checkVisits(nodes_visited_, surfels_visited_));
      // What is below something that fades fades no more by itself
      rules_.fading = fades ? 0 : kFading;
      const SiblingClasses classes = classify_(siblings, view, region, rules_);
      for (std::uint32_t far = classes.far; far != 0; far &= far - 1) {
        const auto i = static_cast<std::size_t>(std::countr_zero(far));
        visit.node(siblings[i], fades ? blend : classes.below(i).rest());
      }
      for (std::uint32_t open = classes.open; open != 0; open &= open - 1) {
        const auto i = static_cast<std::size_t>(std::countr_zero(open));
        const Node& node = siblings[i];
        const Blend below = fades ? blend : classes.below(i);
        if (node.isLeaf()) {
          visit.leaf(node);
          SURFEIT_RETURN_IF_ERROR(octree.visitLeaf(node, [&](std::span<const Surfel> run) {
            surfels_visited_ += run.size();
            visitSeen(run, below, visit);
          }));
        } else if (stack_count < kStackSize) {
          stack_[stack_count++] = {childrenOf(node), below};
        } else {
          return Status::corruption("octree: deeper than its curve has levels");
        }
      }
    }
    return {};
  }

  // Of the last walk.
  std::uint64_t nodesVisited() const { return nodes_visited_; }
  std::uint64_t surfelsVisited() const { return surfels_visited_; }

 private:
  static float facingOf(GatherSides sides) {
    return sides == GatherSides::kFront ? 1.f : sides == GatherSides::kBack ? -1.f : 0.f;
  }
  // Hands over the surfels of groups that are seen, as runs: neighbours are often of one group.
  template <typename Visit>
  void visitSeen(std::span<const Surfel> surfels, const Blend& blend, Visit& visit) const {
    if (rules_.seesAllGroups()) return visit.surfels(surfels, blend);
    const auto isSeen = [&](std::size_t i) { return rules_.sees(groupBit(surfels[i].group)); };
    for (std::size_t end = 0; end < surfels.size();) {
      std::size_t begin = end;
      while (begin < surfels.size() && !isSeen(begin)) ++begin;
      end = begin;
      while (end < surfels.size() && isSeen(end)) ++end;
      if (end > begin) visit.surfels(surfels.subspan(begin, end - begin), blend);
    }
  }

  // Every level leaves at most 7 sibling ranges behind on the way down, the last one 8.
  static constexpr std::size_t kStackSize = 7 * (kCurveLevels + 1) + 8;

  CutRules rules_;
  SiblingClassifier classify_;
  struct Siblings {
    NodeRange range;
    Blend blend;
  };
  std::array<Siblings, kStackSize> stack_;
  std::uint64_t nodes_visited_ = 0, surfels_visited_ = 0;
};

// For walks that are made for the pages they touch.
struct IgnoreCut {
  void node(const Node&, const Blend&) {}
  void leaf(const Node&) {}
  void surfels(std::span<const Surfel>, const Blend&) {}
};

}  // namespace surfeit
