#include "octree/node/lobe.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <iterator>

#include "core/luminance.h"
#include "octree/node/hidden_layers.h"
#include "octree/node/moment_codes.h"

namespace surfeit {
namespace {

// What a surfel, or a piece of a child, must have in common with a piece of a node.
struct PieceKind {
  glm::vec3 normal, opacity;
  bool is_two_sided, is_translucent;
  std::uint8_t hidden;
};

// The piece of a node that faces and hides most as this one does, of those of its kind, as opaque
// and hidden alike, if there are some; 0 where there is none.
std::size_t pieceThatFaces(const Node& node, const PieceKind& kind) {
  std::size_t nearest = 0;
  float most = -9;
  for (std::size_t k = 0; k < node.facet_count; ++k) {
    if (node.isTwoSided(k) != kind.is_two_sided) continue;
    const glm::vec3 facing = node.facets[k].meanNormal();
    const float length = glm::length(facing);
    float cosine = length > 0 ? glm::dot(facing, kind.normal) / length : 0;
    if (kind.is_two_sided) cosine = std::abs(cosine);
    cosine -= hidingDifference(node.facets[k].opacity(), kind.opacity);
    if (node.facets[k].hidden != kind.hidden) cosine -= 2;
    if (node.facets[k].isTranslucent() != kind.is_translucent) cosine -= 4;
    if (cosine > most) {
      most = cosine;
      nearest = k;
    }
  }
  return nearest;
}

// By color.
template <typename Record>
glm::vec3 opacityOfAll(const Record& record) {
  return {record.opacity(0), record.opacity(1), record.opacity(2)};
}

PieceKind kindOfPiece(const Node& node, std::size_t piece) {
  const bool has_sides = pieceCount(node) > 0, is_facet = node.hasFacets();
  return {is_facet ? node.facets[piece].meanNormal() : node.normal,
          is_facet ? node.facets[piece].opacity() : opacityOfAll(node),
          has_sides && node.isTwoSided(piece),
          is_facet ? node.facets[piece].isTranslucent() : node.isTranslucent(),
          has_sides ? node.hiddenSides(piece) : std::uint8_t{0}};
}

// Two sides have two mirror directions, and a rough node has many.
bool holdsLobe(const Node& node, std::size_t piece) {
  return piece < pieceCount(node) && !node.isTwoSided(piece);
}

}  // namespace

Lobe Lobe::encode(const glm::vec3& shares, const glm::vec3& mean) {
  Lobe result;
  for (std::size_t c = 0; c < 3; ++c) {
    result.share[c] = fractionCode(shares[static_cast<int>(c)]);
    result.mean[c] = signedCode(mean[static_cast<int>(c)], 1);
  }
  return result.isEven() ? Lobe() : result;
}

void LobeSums::add(const LobeSums& other) {
  for (int c = 0; c < 3; ++c) {
    power[c] += other.power[c];
    lobe[c] += other.lobe[c];
    mean[c] += other.mean[c];
  }
  weight += other.weight;
}

Lobe LobeSums::toLobe() const {
  if (!(weight > 0)) return {};
  glm::vec3 shares(0), direction(0);
  for (int c = 0; c < 3; ++c) {
    if (power[c] > 0) shares[c] = float(lobe[c] / power[c]);
    direction[c] = float(mean[c] / weight);
  }
  return Lobe::encode(shares, direction);
}

void addToPiece(const Node& node, const Surfel& surfel, const Lobe& lobe, PieceSums& sums) {
  const PieceKind kind = {surfel.normal, opacityOfAll(surfel),
                          surfel.isTwoSided() && !surfel.isSphere(), surfel.isTranslucent(),
                          hiddenSidesOf(surfel)};
  const glm::vec3 shares = lobe.shares(), direction = lobe.meanDirection();
  LobeSums one;
  for (int c = 0; c < 3; ++c) {
    one.power[c] = double(surfel.area) * double(surfel.opacity(c)) * double(surfel.radiosity[c]);
    one.lobe[c] = one.power[c] * double(shares[c]);
  }
  // One direction stands for all colors
  one.weight = luminance(glm::dvec3(one.lobe[0], one.lobe[1], one.lobe[2]));
  for (int c = 0; c < 3; ++c) one.mean[c] = one.weight * double(direction[c]);
  sums[pieceThatFaces(node, kind)].add(one);
}

void addToPieces(const Node& node, const Node& child, const PieceSums& of_child, PieceSums& sums) {
  const std::size_t count = std::max<std::size_t>(pieceCount(child), 1);
  for (std::size_t piece = 0; piece < count; ++piece) {
    LobeSums one = of_child[piece];
    if (!holdsLobe(child, piece)) {
      // What it sends evenly as a piece of the child it sends evenly above
      const LobeSums all = one;
      one = {};
      std::copy(std::begin(all.power), std::end(all.power), std::begin(one.power));
    }
    sums[pieceThatFaces(node, kindOfPiece(child, piece))].add(one);
  }
}

NodeLobes lobesOf(const Node& node, const PieceSums& sums) {
  NodeLobes lobes;
  for (std::size_t piece = 0; piece < lobes.size(); ++piece) {
    if (holdsLobe(node, piece)) lobes[piece] = sums[piece].toLobe();
  }
  return lobes;
}

}  // namespace surfeit
