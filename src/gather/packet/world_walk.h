// What a packet gathers from: one octree in its own coordinates, or the instances of several in a
// world; and the cut of either.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "gather/cut/cut.h"
#include "gather/cut/instance_tree.h"
#include "gather/rules/gather_rules.h"
#include "gather/rules/receiver.h"
#include "octree/read/paged_octree.h"
#include "surfeit/status.h"

namespace surfeit {

// One thread's way into a world. All that is referred to must outlive it.
class WorldReader {
 public:
  explicit WorldReader(PagedOctree::Reader& octree) : octree_(octree) {}
  // `scenes`: by the numbers of PlacedScene::scene, all in the caches of the reader.
  WorldReader(PagedOctree::Reader& octree, const InstanceTree& instances,
              std::span<const PagedOctree* const> scenes)
      : octree_(octree), instances_(&instances), scenes_(scenes) {}

  const InstanceTree* instances() const { return instances_; }  // null: one octree as it is
  PagedOctree::Reader& octree() { return octree_; }
  PagedOctree::Reader& octreeOf(const PlacedScene& instance) {
    octree_.use(*scenes_[instance.scene]);
    return octree_;
  }

 private:
  PagedOctree::Reader& octree_;
  const InstanceTree* instances_ = nullptr;
  std::span<const PagedOctree* const> scenes_;
};

// The cut of a world. Visitors are those of CutWalk; visit.setFrame(const InstanceFrame*) says
// whose coordinates what follows is in: of an instance, or null for those of the receivers. One
// thread at a time.
class WorldWalk {
 public:
  explicit WorldWalk(const GatherRules& rules) : cut_(rules), above_(rules) {}

  template <typename Visit>
  Status walk(const PacketView& view, std::span<const LocalReceiver> receivers, WorldReader& world,
              Visit&& visit) {
    nodes_visited_ = surfels_visited_ = 0;
    if (world.instances() == nullptr) {
      return walkOctree(view, receivers, world.octree(), visit, nullptr);
    }
    InstanceVisit<std::remove_reference_t<Visit>> above{*this, view, receivers, world, visit};
    const Status status = above_.walk(view, receivers, *world.instances(), above);
    nodes_visited_ += above_.nodesVisited();
    return status;
  }

  // Of the last walk.
  std::uint64_t nodesVisited() const { return nodes_visited_; }
  std::uint64_t surfelsVisited() const { return surfels_visited_; }

 private:
  // Goes into instances, and hands on the nodes above them.
  template <typename Visit>
  struct InstanceVisit {
    WorldWalk& walk;
    const PacketView& view;
    std::span<const LocalReceiver> receivers;
    WorldReader& world;
    Visit& visit;

    void node(const Node& node, const LaneParts* parts) {
      visit.setFrame(nullptr);
      visit.node(node, parts);
    }
    OpenedNode opened(const Node&, const LaneParts*, OpenedNode) { return {}; }
    Status instance(const Node& leaf, const LaneParts* parts) {
      const PlacedScene& placed = world.instances()->instances()[leaf.page];
      visit.setFrame(&placed.frame);
      for (std::size_t i = 0; i < receivers.size(); ++i) {
        walk.local_[i] = placed.frame.toLocal(receivers[i]);
      }
      walk.cut_.setScale(placed.frame.scale);
      return walk.walkOctree(placed.frame.toLocal(view),
                             std::span(walk.local_).first(receivers.size()), world.octreeOf(placed),
                             visit, parts);
    }
  };

  template <typename Visit>
  Status walkOctree(const PacketView& view, std::span<const LocalReceiver> receivers,
                    PagedOctree::Reader& octree, Visit& visit, const LaneParts* parts) {
    const Status status = cut_.walk(view, receivers, octree, visit, parts);
    nodes_visited_ += cut_.nodesVisited();
    surfels_visited_ += cut_.surfelsVisited();
    return status;
  }

  CutWalk cut_, above_;
  std::array<LocalReceiver, kPacketReceivers> local_{};
  std::uint64_t nodes_visited_ = 0, surfels_visited_ = 0;
};

}  // namespace surfeit
