// The sweep that turns leaves in curve order into a tree. It rests on one fact: a cell of level k
// is a run of keys that share k digits, so two neighbours on the curve whose keys first differ at
// level d close every open cell of level d and deeper, and nothing else.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/curve_key.h"
#include "octree/node/node_sums.h"
#include "octree/page/node_group.h"

namespace surfeit {

// A node and its sums, waiting for the parent.
struct FinishedNode {
  LevelNode node;
  NodeSums sums;
};

// Where a record went: a page, counted within its section (surfels) or level (nodes), and the
// place on it.
struct GroupPlace {
  std::uint32_t page = 0;
  std::uint16_t first = 0;
};

// Takes the children of closed cells.
class SiblingSink {
 public:
  virtual ~SiblingSink() = default;
  // Siblings of a level, to be kept side by side; the parent refers to them by what is returned.
  virtual GroupPlace addSiblings(int level, std::span<const LevelNode> siblings) = 0;
};

// How far surfels or children reach from `centre`: the radius of a sphere around it that holds
// them all. Rounding of the sums is made up for in the last digits.
float reach(const glm::vec3& centre, const glm::vec3& at, float radius);

// Open cells, at most one of a level; 3 KiB for every level. One thread at a time. Making one may
// throw std::bad_alloc.
class CellSweep {
 public:
  CellSweep(SiblingSink& sink, float flatness_limit)
      : sink_(sink), flatness_limit_(flatness_limit) {}

  // Puts `node` under the cell that it shares with the next one, from which it differs at
  // `boundary_level`, and closes the cells that end between them. When `top_level`, the level of
  // the cell that is swept, is not above the boundary, that cell ends too: true, and `node` is its
  // root. Of `surfels`, the last are those of the node and of all nodes before it in its cells, as
  // far as they are at hand: bounds from surfels are tighter than those from children.
  bool place(FinishedNode& node, int boundary_level, int top_level,
             std::span<const Surfel> surfels = {});

  bool isEmpty() const { return depth_ == 0; }

 private:
  struct OpenCell {
    int level = 0;
    std::uint8_t child_count = 0;
    NodeSums sums;
    std::array<LevelNode, 8> children;

    void add(const FinishedNode& child);
  };
  void close(const OpenCell& cell, std::span<const Surfel> surfels, FinishedNode& node);

  SiblingSink& sink_;
  const float flatness_limit_;
  // Levels rise. Not within this object: 70 KiB are much for a stack.
  std::vector<OpenCell> cells_ = std::vector<OpenCell>(kCurveLevels + 1);
  std::size_t depth_ = 0;
};

}  // namespace surfeit
