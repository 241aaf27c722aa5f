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
#include "gather/rules/contribution.h"
#include "gather/rules/fidelity.h"
#include "gather/rules/gather_rules.h"
#include "gather/rules/receiver.h"
#include "gather/rules/sending_gains.h"
#include "octree/node/node.h"
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
PacketView viewPacket(std::span<const LocalReceiver> receivers);
PacketView viewPacket(std::span<const LocalReceiver> receivers, const GatherRules& rules);

// How a cut is chosen.
struct CutRules {
  float max_solid_angle = 0;  // 0: nothing stands in for anything, and nothing visible is left out
  float max_distance = 0;
  float facing = 1;                   // 1: only fronts are seen, -1: only backs, 0: both
  std::uint64_t groups = kAllGroups;  // set of the groups that are seen
  float pixels_per_slope = 0;         // of the raster
  float bias = 0;                     // of rays, in radii of surfels
  SendingGains gains{};

  bool approximates() const { return max_solid_angle > 0; }
  bool seesAllGroups() const { return groups == kAllGroups; }
  bool sees(std::uint64_t some_of) const { return seesAllGroups() || (groups & some_of) != 0; }
  // Whether surfels that are not seen lie below, or surfels of several gains: what the node says is
  // not what those seen are like.
  bool isMixed(const Node& node) const {
    return (node.groups & ~groups) != 0 || !gains.areAlike(node.groups);
  }
};

// How much something counts for each receiver of a packet, 0..1.
using LaneParts = std::array<float, kPacketReceivers>;
// Null: wholly.
inline float partOf(const LaneParts* parts, std::size_t i) {
  return parts != nullptr ? (*parts)[i] : 1;
}

// How much of what is below a node the receiver looks at instead of the node as a whole: 0 when it
// looks small enough, 1 when it does not, and in between while it fades from one into the other.
// The definition of the cut (docs/algorithm.md, "Choosing the cut").
float openPart(const Node& node, const LocalReceiver& receiver, const CutRules& rules);

// Of one parent.
inline constexpr std::size_t kMostSiblings = 8;

// What a packet makes of siblings, as bits. Those of no class are proved to be invisible, or cover
// less than a stated part of the hemisphere.
struct SiblingClasses {
  std::uint32_t far = 0;    // openPart is 0 for all receivers
  std::uint32_t open = 0;   // openPart is 1 for all receivers
  std::uint32_t mixed = 0;  // neither is known
};

// Which nodes no receiver of the packet sees anything of, and how the rest stands: eight at once,
// for this machine. Results of others may differ where rounding decides.
using SiblingClassifier = SiblingClasses (*)(std::span<const Node>, const PacketView&,
                                             const CutRules&);
SiblingClassifier fastestSiblingClassifier();

// What a visitor knows of a node that it was told to look into.
struct OpenedNode {
  std::uint32_t hull_lanes = 0;  // receivers that see its hull, or that of a node above it, as bits
};

// Calls visit.node(const Node&, const LaneParts*) for the nodes that some receiver sees as a whole,
// visit.opened(const Node&, const LaneParts*, OpenedNode) for those that some receiver looks into,
// and visit.surfels(std::span<const Surfel>, const LaneParts*) for the surfels of leaves among
// them. The parts say how much they count for each receiver; null: wholly for all. opened() is
// given what it answered of the parent. Surfels of groups that are not seen are left out. `Reader`
// has the functions of PagedOctree::Reader. The order depends on octree and view alone. A visitor
// with visit.instance(const Node&, const LaneParts*), which returns a Status, takes leaves that
// some receiver may see by that alone (InstanceTree). One thread at a time.
class CutWalk {
 public:
  explicit CutWalk(const GatherRules& rules)
      : rules_{maxSolidAngle(rules),
               rules.quality.max_distance,
               facingOf(rules.quality.sides),
               rules.groups,
               pixelsPerSlope(rules),
               rules.quality.bias,
               rules.hasLight() ? rules.gains : SendingGains()},
        classify_(fastestSiblingClassifier()) {}

  // The octree's units are this many of the world's, in which the rules are.
  void setScale(float scale) { rules_.max_distance = max_distance_ / scale; }

  // `view`: of these receivers, 1 to kPacketReceivers. `all`: how much all of the octree counts for
  // each; null: wholly.
  template <typename Reader, typename Visit>
  Status walk(const PacketView& view, std::span<const LocalReceiver> receivers, Reader& octree,
              Visit&& visit, const LaneParts* all = nullptr) {
    nodes_visited_ = surfels_visited_ = 0;
    std::size_t stack_count = 0;
    stack_[stack_count++] = {kRootRange, all != nullptr, {}, all != nullptr ? *all : LaneParts{}};
    while (stack_count > 0) {
      const Siblings from = stack_[--stack_count];
      SURFEIT_ASSIGN_OR_RETURN(const std::span<const Node> siblings, octree.nodes(from.range));
      nodes_visited_ += siblings.size();
      SURFEIT_RETURN_IF_ERROR(octree.checkVisits(nodes_visited_, surfels_visited_));
      const SiblingClasses classes = classify_(siblings, view, rules_);
      const LaneParts* const whole = from.has_parts ? &from.parts : nullptr;
      for (std::uint32_t rest = classes.far | classes.open | classes.mixed; rest != 0;
           rest &= rest - 1) {
        const auto i = static_cast<std::size_t>(std::countr_zero(rest));
        const Node& node = siblings[i];
        const std::uint32_t bit = 1u << i;
        if constexpr (requires { visit.instance(node, whole); }) {
          if (node.isLeaf()) {
            SURFEIT_RETURN_IF_ERROR(visit.instance(node, whole));
            continue;
          }
        }
        if ((classes.far & bit) != 0) {
          visit.node(node, whole);
          continue;
        }
        const LaneParts* below = whole;
        LaneParts own_parts, below_parts;
        if ((classes.mixed & bit) != 0) {
          const Division division = divide(node, receivers, whole, own_parts, below_parts);
          if (division.has_own) visit.node(node, &own_parts);
          if (!division.has_below) continue;
          below = division.has_own ? &below_parts : whole;
        }
        const OpenedNode opened = visit.opened(node, below, from.parent);
        if (node.isLeaf()) {
          if constexpr (!requires { visit.instance(node, whole); }) {
            SURFEIT_RETURN_IF_ERROR(octree.visitLeaf(node, [&](std::span<const Surfel> run) {
              surfels_visited_ += run.size();
              visitSeen(run, below, visit);
            }));
          }
        } else if (stack_count < kStackSize) {
          Siblings& next = stack_[stack_count++];
          next.range = childrenOf(node);
          next.has_parts = below != nullptr;
          next.parent = opened;
          if (below != nullptr) next.parts = *below;
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
  // Shares out what each receiver sees of a node to the node and what is below it.
  struct Division {
    bool has_own, has_below;  // for some receiver
  };
  Division divide(const Node& node, std::span<const LocalReceiver> receivers,
                  const LaneParts* whole, LaneParts& own, LaneParts& below) const {
    Division division = {false, false};
    for (std::size_t i = 0; i < kPacketReceivers; ++i) {
      if (i >= receivers.size()) {
        own[i] = own[i - 1];
        below[i] = below[i - 1];
        continue;
      }
      const float all = partOf(whole, i);
      below[i] = all > 0 ? all * openPart(node, receivers[i], rules_) : 0;
      own[i] = all - below[i];
      division.has_own = division.has_own || own[i] > 0;
      division.has_below = division.has_below || below[i] > 0;
    }
    return division;
  }

  // Hands over the surfels of groups that are seen, as runs: neighbours are often of one group.
  template <typename Visit>
  void visitSeen(std::span<const Surfel> surfels, const LaneParts* parts, Visit& visit) const {
    if (rules_.seesAllGroups()) return visit.surfels(surfels, parts);
    const auto isSeen = [&](std::size_t i) { return rules_.sees(groupBit(surfels[i].group)); };
    for (std::size_t end = 0; end < surfels.size();) {
      std::size_t begin = end;
      while (begin < surfels.size() && !isSeen(begin)) ++begin;
      end = begin;
      while (end < surfels.size() && isSeen(end)) ++end;
      if (end > begin) visit.surfels(surfels.subspan(begin, end - begin), parts);
    }
  }

  // Every level leaves at most 7 sibling ranges behind on the way down, the last one 8.
  static constexpr std::size_t kStackSize = 7 * (kCurveLevels + 1) + 8;

  CutRules rules_;
  const float max_distance_ = rules_.max_distance;
  SiblingClassifier classify_;
  struct Siblings {
    NodeRange range;
    bool has_parts;
    OpenedNode parent;
    LaneParts parts;
  };
  std::array<Siblings, kStackSize> stack_;
  std::uint64_t nodes_visited_ = 0, surfels_visited_ = 0;
};

// For walks that are made for the pages they touch.
struct IgnoreCut {
  void node(const Node&, const LaneParts*) {}
  OpenedNode opened(const Node&, const LaneParts*, OpenedNode) { return {}; }
  void surfels(std::span<const Surfel>, const LaneParts*) {}
};

}  // namespace surfeit
