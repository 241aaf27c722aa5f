// Columns of the moments of a page's nodes: covariances of all; front moments and band 4 of
// the area of the rough ones. docs/format.md, "Node-group page", has the bytes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "octree/node/node.h"
#include "octree/page/byte_planes.h"

namespace surfeit {

// One object per thread at a time. Nodes go in, or come out, one after the other.
class MomentColumns {
 public:
  // `rough_count` of the `count` nodes are not flat.
  MomentColumns(std::size_t count, std::size_t rough_count, bool full_precision);

  // Adds those of the next node; radius and area as a reader will find them, but for rounding.
  void add(const Node& node);
  // All nodes have been added.
  void put(PayloadWriter& writer) const;

  // False when the columns end early or are not finite.
  bool get(PayloadReader& reader);
  // Gives the next node its moments; radius, area, flags and facets are there. False when these
  // cannot be moments of such a node.
  bool take(Node& node);

 private:
  static constexpr std::size_t kCovariance = SymmetricMatrix::kEntries, kFront = 9;
  static constexpr std::size_t kRough = kFront + kShCount;

  // Entry of column `k` of the covariances, or of those of rough nodes, of the node at hand.
  std::size_t covarianceAt(std::size_t k) const { return k * count_ + next_; }
  std::size_t roughAt(std::size_t k) const {
    return kCovariance * count_ + k * rough_count_ + next_rough_;
  }
  void addCodes(const Node& node);
  void takeCodes(Node& node) const;

  std::size_t count_, rough_count_;
  bool full_precision_;
  std::size_t next_ = 0, next_rough_ = 0;
  std::span<float> floats_;        // with full precision
  std::span<std::uint8_t> codes_;  // without
};

}  // namespace surfeit
