// Columns of the lobes of a page: of its surfels, or of the flat pieces of its nodes, one after the
// other. docs/format.md, "Lobes".
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "octree/node/lobe.h"
#include "octree/page/byte_planes.h"

namespace surfeit {

// One object per thread at a time.
class LobeColumns {
 public:
  explicit LobeColumns(std::size_t count);

  void set(std::size_t i, const Lobe& lobe);
  Lobe at(std::size_t i) const;

  void put(PayloadWriter& writer) const;
  // False when the columns end early, or hold what is no lobe.
  bool get(PayloadReader& reader);

 private:
  const std::size_t count_;
  std::vector<std::uint8_t>& share_;
  std::vector<std::int16_t>& mean_;
};

// The columns of a page of surfels; no lobes: all are even.
void putSurfelLobes(PayloadWriter& writer, std::size_t surfels, std::span<const Lobe> lobes);
// Into the first of `lobes`, unless that is empty. False as LobeColumns::get.
bool getSurfelLobes(PayloadReader& reader, std::size_t surfels, std::span<Lobe> lobes);

// The same of nodes: `nodeAt(i)` is one of `count`.
template <typename NodeAt>
void putNodeLobes(PayloadWriter& writer, std::size_t count, const NodeAt& nodeAt,
                  std::span<const NodeLobes> lobes) {
  std::size_t pieces = 0, next = 0;
  for (std::size_t i = 0; i < count; ++i) pieces += pieceCount(nodeAt(i));
  LobeColumns columns(pieces);
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t piece = 0; piece < pieceCount(nodeAt(i)); ++piece) {
      columns.set(next++, lobes.empty() ? Lobe() : lobes[i][piece]);
    }
  }
  columns.put(writer);
}
bool getNodeLobes(PayloadReader& reader, std::span<const Node> nodes, std::span<NodeLobes> lobes);

}  // namespace surfeit
