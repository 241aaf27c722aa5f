#include "octree/page/facet_columns.h"

#include <array>
#include <cstddef>

#include "core/thread_scratch.h"
#include "octree/node/hidden_layers.h"
#include "octree/page/column_codec.h"
#include "octree/page/transparency_columns.h"

namespace surfeit {
namespace {

// Entries of a facet: its area and normal in 16 bits, its offset and covariance in bytes.
// Where facets have an opacity, its code in two bytes more; where they have tints, in four more.
constexpr std::size_t kWide = 4, kBytes = 3 + SymmetricMatrix::kEntries;

// Entry `k` of all facets lies side by side.
struct Codes {
  std::size_t count;
  bool has_opacity, has_tints;
  std::vector<std::int16_t>& wide = threadScratch<std::vector<std::int16_t>>([] {});
  std::vector<std::uint8_t>& bytes = threadScratch<std::vector<std::uint8_t>>([] {});

  Codes(std::size_t facets, const PageForm& form)
      : count(facets), has_opacity(form.has_opacity), has_tints(form.has_tints) {
    wide.resize(kWide * facets);
    bytes.resize((kBytes + (has_opacity ? 2 : 0) + (has_tints ? 4 : 0)) * facets);
  }
  bool get(PayloadReader& reader) {
    return getSmallIntegers(reader, wide) && getBytes8(reader, bytes);
  }

  void set(std::size_t i, const NodeFacet& facet) {
    wide[i] = static_cast<std::int16_t>(facet.area);
    for (std::size_t k = 0; k < 3; ++k) wide[(1 + k) * count + i] = facet.normal[k];
    for (std::size_t k = 0; k < 3; ++k) bytes[k * count + i] = facet.offset[k];
    for (std::size_t k = 0; k < facet.covariance.size(); ++k) {
      bytes[(3 + k) * count + i] = facet.covariance[k];
    }
    if (has_opacity) setPair(0, i, facet.transparency);
    for (std::size_t k = 0; has_tints && k < 2; ++k) setPair(1 + k, i, facet.tint[k]);
  }
  NodeFacet at(std::size_t i) const {
    NodeFacet facet{};
    facet.area = static_cast<std::uint16_t>(wide[i]);
    for (std::size_t k = 0; k < 3; ++k) facet.normal[k] = wide[(1 + k) * count + i];
    for (std::size_t k = 0; k < 3; ++k) facet.offset[k] = bytes[k * count + i];
    for (std::size_t k = 0; k < facet.covariance.size(); ++k) {
      facet.covariance[k] = bytes[(3 + k) * count + i];
    }
    if (has_opacity) facet.transparency = pairAt(0, i);
    for (std::size_t k = 0; has_tints && k < 2; ++k) facet.tint[k] = pairAt(1 + k, i);
    return facet;
  }

  // Of transparency and tint: low byte and high byte.
  void setPair(std::size_t pair, std::size_t i, std::uint16_t code) {
    const std::size_t at = (kBytes + 2 * pair) * count + i;
    bytes[at] = static_cast<std::uint8_t>(code & 0xff);
    bytes[at + count] = static_cast<std::uint8_t>(code >> 8);
  }
  std::uint16_t pairAt(std::size_t pair, std::size_t i) const {
    const std::size_t at = (kBytes + 2 * pair) * count + i;
    return static_cast<std::uint16_t>(bytes[at] | bytes[at + count] << 8);
  }
};

// Radiosities of all facets as columns.
MutableAxes colorColumns(std::size_t count) {
  std::vector<float>& values = threadScratch<std::vector<float>>([] {});
  values.resize(3 * count);
  const std::span<float> all(values);
  return {all.first(count), all.subspan(count, count), all.subspan(2 * count)};
}

// Of all pieces, code by code.
std::vector<std::uint8_t>& slopeBytes(std::size_t pieces) {
  std::vector<std::uint8_t>& bytes = threadScratch<std::vector<std::uint8_t>>([] {});
  bytes.resize(RadiositySlope::kCodes * pieces);
  return bytes;
}

// Numbers of facets have this bit where hidden sides follow for the pieces of the node.
constexpr std::uint8_t kHasHidden = 0x80;

std::size_t countFacets(std::span<const Node> nodes) {
  std::size_t count = 0;
  for (const Node& node : nodes) count += node.facet_count;
  return count;
}

// Of the nodes whose counts say so; only two-sided pieces have another side.
bool getHidden(PayloadReader& reader, std::span<const std::uint8_t> counts,
               std::size_t hidden_count, std::span<Node> nodes) {
  std::vector<std::uint8_t>& hidden = threadScratch<std::vector<std::uint8_t>>([] {});
  hidden.resize(hidden_count);
  if (!getBytes8(reader, hidden)) return false;
  std::size_t next = 0;
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    if ((counts[i] & kHasHidden) == 0) continue;
    Node& node = nodes[i];
    for (std::size_t k = 0; k < pieceCount(node); ++k, ++next) {
      const int most = node.isTwoSided(k) ? kHiddenSides : kHiddenFront;
      if (hidden[next] > most) return false;
      (node.isFlat() ? node.hidden : node.facets[k].hidden) = hidden[next];
    }
  }
  return true;
}

bool getSlopes(PayloadReader& reader, std::span<Node> nodes) {
  std::size_t pieces = 0, next = 0;
  for (const Node& node : nodes) pieces += pieceCount(node);
  std::vector<std::uint8_t>& bytes = slopeBytes(pieces);
  if (!getBytes8(reader, bytes)) return false;
  for (Node& node : nodes) {
    for (std::size_t k = 0; k < pieceCount(node); ++k, ++next) {
      for (std::size_t i = 0; i < RadiositySlope::kCodes; ++i) {
        node.slopes[k].codes[i] = static_cast<std::int8_t>(bytes[i * pieces + next]);
      }
    }
  }
  return true;
}

}  // namespace

FacetColumns::FacetColumns()
    : counts_(threadScratch<std::vector<std::uint8_t>>([] {})),
      facets_(threadScratch<std::vector<NodeFacet>>([] {})),
      slopes_(threadScratch<std::vector<RadiositySlope>>([] {})),
      hidden_(threadScratch<std::vector<std::uint8_t>>([] {})) {
  counts_.clear();
  facets_.clear();
  slopes_.clear();
  hidden_.clear();
}

void FacetColumns::add(const Node& node) {
  std::uint8_t any = 0;
  for (std::size_t k = 0; k < pieceCount(node); ++k) any |= node.hiddenSides(k);
  counts_.push_back(node.facet_count | (any != 0 ? kHasHidden : std::uint8_t{0}));
  for (std::size_t k = 0; any != 0 && k < pieceCount(node); ++k) {
    hidden_.push_back(node.hiddenSides(k));
  }
  facets_.insert(facets_.end(), node.facets.begin(), node.facets.begin() + node.facet_count);
  slopes_.insert(slopes_.end(), node.slopes.begin(), node.slopes.begin() + pieceCount(node));
}

void FacetColumns::put(PayloadWriter& writer, const PageForm& form) const {
  putBytes8(writer, counts_);
  Codes codes(facets_.size(), form);
  for (std::size_t i = 0; i < facets_.size(); ++i) codes.set(i, facets_[i]);
  putSmallIntegers(writer, codes.wide);
  putBytes8(writer, codes.bytes);
  if (!hidden_.empty()) putBytes8(writer, hidden_);
}

void FacetColumns::putLight(PayloadWriter& writer, const PageForm& form) const {
  const MutableAxes columns = colorColumns(facets_.size());
  for (std::size_t i = 0; i < facets_.size(); ++i) {
    for (std::size_t c = 0; c < 3; ++c) columns[c][i] = facets_[i].radiosity[static_cast<int>(c)];
  }
  putColors(writer, constAxes(columns), form.full_precision);
  if (!form.has_slopes) return;
  std::vector<std::uint8_t>& bytes = slopeBytes(slopes_.size());
  for (std::size_t i = 0; i < slopes_.size(); ++i) {
    for (std::size_t k = 0; k < RadiositySlope::kCodes; ++k) {
      bytes[k * slopes_.size() + i] = static_cast<std::uint8_t>(slopes_[i].codes[k]);
    }
  }
  putBytes8(writer, bytes);
}

bool FacetColumns::pass(PayloadReader& reader, const PageForm& form) const {
  return getBytes8(reader, counts_) && Codes(facets_.size(), form).get(reader) &&
         (hidden_.empty() || getBytes8(reader, hidden_));
}

bool FacetColumns::get(PayloadReader& reader, std::span<Node> nodes, const PageForm& form) {
  std::vector<std::uint8_t>& counts = threadScratch<std::vector<std::uint8_t>>([] {});
  counts.resize(nodes.size());
  std::size_t hidden_count = 0;
  if (!getBytes8(reader, counts)) return false;
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    nodes[i].facet_count = counts[i] & ~kHasHidden;
    if (nodes[i].facet_count > (nodes[i].isFlat() ? 0 : kMostFacets)) return false;
    if ((counts[i] & kHasHidden) != 0) hidden_count += pieceCount(nodes[i]);
  }
  Codes codes(countFacets(nodes), form);
  if (!codes.get(reader)) return false;
  std::size_t next = 0;
  for (Node& node : nodes) {
    if (!node.hasFacets()) continue;
    node.facets = {};
    for (std::size_t k = 0; k < node.facet_count; ++k) {
      node.facets[k] = codes.at(next++);
      const NodeFacet& facet = node.facets[k];
      if (facet.transparency > kMostTransparency) return false;
      if (!areTransparencies(facet.transparency, facet.tint)) return false;
    }
  }
  return hidden_count == 0 || getHidden(reader, counts, hidden_count, nodes);
}

bool FacetColumns::getLight(PayloadReader& reader, std::span<Node> nodes, const PageForm& form) {
  const MutableAxes columns = colorColumns(countFacets(nodes));
  if (!getRadiosity(reader, columns)) return false;
  std::size_t next = 0;
  for (Node& node : nodes) {
    for (std::size_t k = 0; k < node.facet_count; ++k, ++next) {
      node.facets[k].radiosity = {columns[0][next], columns[1][next], columns[2][next]};
    }
  }
  return !form.has_slopes || getSlopes(reader, nodes);
}

}  // namespace surfeit
