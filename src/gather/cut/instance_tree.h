// Several scenes in one world, each turned, scaled alike and moved: instances. Receivers go into
// the frame of an instance to walk its octree; what they see comes back (packet_raster.h). Above
// the instances stands a tree of their own, whose nodes stand for all instances below them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "core/symmetric_matrix.h"
#include "gather/cut/cut.h"
#include "gather/rules/receiver.h"
#include "octree/node/node.h"
#include "surfeit/status.h"
#include "surfeit/surfel.h"

namespace surfeit {

// From the frame of an instance, floats about its scene's origin, to the world, floats about the
// world's: x' = scale * rotation x + shift. Directions turn alone.
struct InstanceFrame {
  glm::mat3 rotation{1};
  float scale = 1;
  glm::vec3 shift{0};

  glm::vec3 toWorld(const glm::vec3& place) const { return scale * (rotation * place) + shift; }
  glm::vec3 directionToWorld(const glm::vec3& direction) const { return rotation * direction; }
  // A spread of directions; lengths stay.
  SymmetricMatrix spreadToWorld(const SymmetricMatrix& spread) const;

  glm::vec3 toLocal(const glm::vec3& place) const { return (place - shift) * rotation / scale; }
  glm::vec3 directionToLocal(const glm::vec3& direction) const { return direction * rotation; }
  // With the view filled in where the rules' eye gives it, which is in the world.
  LocalReceiver toLocal(const LocalReceiver& receiver) const;
  PacketView toLocal(const PacketView& view) const;
};

// What the tree needs to know of a scene that instances show.
struct InstancedScene {
  Node root;
  // Surfels from all over it, each with its part of the whole area (scaled to add up to that).
  std::vector<Surfel> sample;
};

// An instance: which scene, and where.
struct PlacedScene {
  std::uint32_t scene = 0;
  InstanceFrame frame;
};

// Immutable once made, so that threads may share it.
class InstanceTree {
 public:
  // `instances`: at least one. `flatness_limit`: of nodes that are flat (SceneHeader).
  InstanceTree(std::span<const InstancedScene> scenes, std::vector<PlacedScene> instances,
               float flatness_limit);

  std::span<const PlacedScene> instances() const { return instances_; }

  // For CutWalk: leaves are instances (Node::page is their number).
  Result<std::span<const Node>> nodes(const NodeRange& range) const {
    return std::span(nodes_).subspan(std::size_t{range.page} << 16 | range.first, range.count);
  }
  Status checkVisits(std::uint64_t, std::uint64_t) const { return {}; }

  // Of so many instances, at most.
  static std::size_t memoryBytes(std::size_t count);

 private:
  class Builder;
  std::vector<PlacedScene> instances_;
  std::vector<Node> nodes_;  // siblings side by side; the root first
};

}  // namespace surfeit
