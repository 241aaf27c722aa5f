#include "octree/page/lobe_columns.h"

#include <glm/geometric.hpp>

#include "core/thread_scratch.h"
#include "octree/page/column_codec.h"

namespace surfeit {
namespace {

// Means of unit directions are no longer than 1; codes round.
constexpr float kMostSquare = 1.001f;

}  // namespace

LobeColumns::LobeColumns(std::size_t count)
    : count_(count),
      share_(threadScratch<std::vector<std::uint8_t>>([] {})),
      mean_(threadScratch<std::vector<std::int16_t>>([] {})) {
  share_.resize(3 * count);
  mean_.resize(3 * count);
}

// A column for each color, and for each axis
void LobeColumns::set(std::size_t i, const Lobe& lobe) {
  for (std::size_t c = 0; c < 3; ++c) {
    share_[c * count_ + i] = lobe.share[c];
    mean_[c * count_ + i] = lobe.mean[c];
  }
}

Lobe LobeColumns::at(std::size_t i) const {
  Lobe lobe;
  for (std::size_t c = 0; c < 3; ++c) {
    lobe.share[c] = share_[c * count_ + i];
    lobe.mean[c] = mean_[c * count_ + i];
  }
  return lobe;
}

void LobeColumns::put(PayloadWriter& writer) const {
  putBytes8(writer, share_);
  putSmallIntegers(writer, mean_);
}

bool LobeColumns::get(PayloadReader& reader) {
  if (!getBytes8(reader, share_) || !getSmallIntegers(reader, mean_)) return false;
  for (std::size_t i = 0; i < count_; ++i) {
    const glm::vec3 direction = at(i).meanDirection();
    if (!(glm::dot(direction, direction) <= kMostSquare)) return false;
  }
  return true;
}

void putSurfelLobes(PayloadWriter& writer, std::size_t surfels, std::span<const Lobe> lobes) {
  LobeColumns columns(surfels);
  for (std::size_t i = 0; i < surfels; ++i) columns.set(i, lobes.empty() ? Lobe() : lobes[i]);
  columns.put(writer);
}

bool getSurfelLobes(PayloadReader& reader, std::size_t surfels, std::span<Lobe> lobes) {
  LobeColumns columns(surfels);
  if (!columns.get(reader)) return false;
  if (lobes.empty()) return true;
  for (std::size_t i = 0; i < surfels; ++i) lobes[i] = columns.at(i);
  return true;
}

bool getNodeLobes(PayloadReader& reader, std::span<const Node> nodes, std::span<NodeLobes> lobes) {
  std::size_t pieces = 0, next = 0;
  for (const Node& node : nodes) pieces += pieceCount(node);
  LobeColumns columns(pieces);
  if (!columns.get(reader)) return false;
  if (lobes.empty()) return true;
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    lobes[i] = {};
    for (std::size_t piece = 0; piece < pieceCount(nodes[i]); ++piece) {
      lobes[i][piece] = columns.at(next++);
    }
  }
  return true;
}

}  // namespace surfeit
