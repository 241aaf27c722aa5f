#include "octree/relight/radiosity_sweep.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <limits>
#include <optional>
#include <utility>

#include "octree/node/facet_match.h"
#include "octree/node/radiosity_variance.h"

namespace surfeit {
namespace {

int levelOf(const SceneHeader& header, std::uint32_t node_page) {
  const auto& first = header.level_first_page;
  return static_cast<int>(std::upper_bound(std::begin(first), std::end(first), node_page) - first) -
         1;
}

// The facet of a node that faces and hides most as a group of surfels does, of those of its kind,
// hidden alike and as opaque if there are some.
std::size_t nearestFacet(const Node& node, const FacetGroup& group) {
  std::size_t nearest = 0;
  double most = -std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < node.facet_count; ++k) {
    if (node.isTwoSided(k) != group.is_two_sided) continue;
    double dot = 0, length_sq = 1;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double n = double(node.facets[k].normal[axis]);
      dot += n * group.normal[axis];
      length_sq += n * n;
    }
    if (group.is_two_sided) dot = std::abs(dot);
    double alike = dot / std::sqrt(length_sq);
    alike -= group.area * double(hidingDifference(node.facets[k].opacity(), group.opacity()));
    if (node.facets[k].hidden != group.hidden) alike -= 2 * group.area;
    if (node.facets[k].isTranslucent() != group.is_translucent) alike -= 4 * group.area;
    if (alike > most) {
      most = alike;
      nearest = k;
    }
  }
  return nearest;
}

// Each group gives its light to the facet that it is. Surfels as they are stored may group a little
// otherwise than the indexer found them: then to the facet that faces most as it does.
void setFacetRadiosity(const NodeSums& node_sums, float flatness_limit, Node& node) {
  const FacetSums& sums = node_sums.facets;
  std::array<AreaSums, kMostFacets> lights;
  const std::span<NodeFacet> facets = std::span(node.facets).first(node.facet_count);
  const FacetSums fewest = sums.fewest(flatness_limit);
  const std::optional<FacetMatch> match = matchFacets(fewest, node_sums.origin, node);
  const std::span<const FacetGroup> groups =
      fewest.groups().empty() ? sums.groups() : fewest.groups();
  for (std::size_t i = 0; i < groups.size(); ++i) {
    lights[match ? (*match)[i] : nearestFacet(node, groups[i])].add(groups[i]);
  }
  RadiosityVariance variance;
  for (std::size_t k = 0; k < facets.size(); ++k) {
    const AreaSums& light = lights[k];
    variance.add(light);
    node.slopes[k] =
        light.area > 0 ? RadiositySlope::towards(facets[k].meanNormal(), light) : RadiositySlope();
    for (int c = 0; c < 3; ++c) {
      facets[k].radiosity[c] =
          light.covered[c] > 0 ? float(light.radiosity[c] / light.covered[c]) : node.radiosity[c];
    }
  }
  node.radiosity_variance = float(variance.value());
}

// What the indexer's NodeSums::toNode gives from the same sums; the rest of the node stays.
void setRadiosity(const NodeSums& sums, float flatness_limit, Node& node) {
  for (int c = 0; c < 3; ++c) node.radiosity[c] = float(sums.radiosity[c] / sums.covered[c]);
  node.radiosity_variance = RadiosityVariance::of(sums);
  node.slopes = {};
  if (node.isFlat()) {
    node.slopes[0] =
        RadiositySlope::towards(node.normal, sums.flatPiece(node.isTwoSided(), flatness_limit));
  }
  if (node.hasFacets()) setFacetRadiosity(sums, flatness_limit, node);
  if (!node.isRough()) return;
  for (int i = 0; i < kShCount; ++i) {
    for (int c = 0; c < 3; ++c) node.rough.sh[i][powerKind(c)] = float(sums.sh[i][powerKind(c)]);
  }
}

}  // namespace

Node& RadiositySweep::current() {
  const Siblings& siblings = path_.back();
  return open_[static_cast<std::size_t>(siblings.level)].nodes[siblings.at];
}

const Node& RadiositySweep::parentOfCurrent() const {
  const Siblings& siblings = path_[path_.size() - 2];
  return open_[static_cast<std::size_t>(siblings.level)].nodes[siblings.at];
}

Status RadiositySweep::add(std::span<const Surfel> surfels, std::span<const Lobe> lobes,
                           std::vector<SweptNodePage>& complete) {
  if (!has_begun_) {
    has_begun_ = true;
    has_lobes_ = !lobes.empty();
    SURFEIT_RETURN_IF_ERROR(enter(kRootRange, complete));
    SURFEIT_RETURN_IF_ERROR(descend(complete));
  }
  for (std::size_t at = 0; at < surfels.size();) {
    if (leaf_left_ == 0) SURFEIT_RETURN_IF_ERROR(beginLeaf(at));
    const std::size_t count = std::min<std::uint64_t>(leaf_left_, surfels.size() - at);
    addToLeaf(surfels.subspan(at, count), has_lobes_ ? lobes.subspan(at, count) : lobes);
    at += count;
    leaf_left_ -= count;
    if (leaf_left_ > 0) break;
    leave(leaf_sums_, leaf_lobes_);
    SURFEIT_RETURN_IF_ERROR(descend(complete));
  }
  ++surfel_page_;
  return {};
}

void RadiositySweep::addToLeaf(std::span<const Surfel> surfels, std::span<const Lobe> lobes) {
  for (const Surfel& surfel : surfels) leaf_sums_.add(surfel);
  for (std::size_t i = 0; i < lobes.size(); ++i) {
    addToPiece(current(), surfels[i], lobes[i], leaf_lobes_);
  }
}

// The leaf at hand must be what begins at this surfel.
Status RadiositySweep::beginLeaf(std::size_t first) {
  if (path_.empty() || current().page != surfel_page_ || current().first != first) {
    return scene_.pages().pageError(
        scene_.nodePageCount() + surfel_page_,
        fmt::format("surfel group: surfel {} is not where the next leaf in the order of the tree "
                    "begins",
                    first));
  }
  leaf_left_ = current().surfel_count;
  leaf_sums_ = NodeSums();
  leaf_lobes_ = {};
  return {};
}

// Down to the first leaf of what has not been met.
Status RadiositySweep::descend(std::vector<SweptNodePage>& complete) {
  while (!path_.empty() && !current().isLeaf()) {
    SURFEIT_RETURN_IF_ERROR(enter(childrenOf(current()), complete));
  }
  return {};
}

// Every group of siblings begins where the one before of its level ended: so all nodes are met, and
// each once.
Status RadiositySweep::enter(const NodeRange& range, std::vector<SweptNodePage>& complete) {
  const int level = levelOf(scene_.header(), range.page);
  OpenPage& open = open_[static_cast<std::size_t>(level)];
  if (!open.is_open || range.page != open.page) {
    const std::uint32_t expected =
        open.is_open ? open.page + 1
                     : scene_.header().level_first_page[static_cast<std::size_t>(level)];
    if (range.page != expected || open.met != open.nodes.size()) {
      return scene_.pages().pageError(range.page,
                                      "node group: referred to out of the order of the tree");
    }
    SURFEIT_RETURN_IF_ERROR(openPage(level, range.page, complete));
  }
  const std::size_t end = std::size_t{range.first} + range.count;
  if (range.first != open.met || end > open.nodes.size()) {
    return scene_.pages().pageError(
        range.page, fmt::format("node group: nodes {} to {} of {} are referred to, expected those "
                                "from {} on",
                                range.first, end, open.nodes.size(), open.met));
  }
  open.met = end;
  path_.push_back({level, range.first, static_cast<std::uint16_t>(end), NodeSums(), {}});
  return {};
}

Status RadiositySweep::openPage(int level, std::uint32_t page,
                                std::vector<SweptNodePage>& complete) {
  closePage(level, complete);
  OpenPage& open = open_[static_cast<std::size_t>(level)];
  open.nodes.resize(scene_.header().node_group_capacity);
  SURFEIT_ASSIGN_OR_RETURN(const std::uint32_t count,
                           scene_.decodeNodes(page, open.scratch, open.nodes));
  open.nodes.resize(count);
  open.lobes.resize(has_lobes_ ? count : 0);
  open.is_open = true;
  open.page = page;
  open.met = 0;
  return {};
}

void RadiositySweep::closePage(int level, std::vector<SweptNodePage>& complete) {
  OpenPage& open = open_[static_cast<std::size_t>(level)];
  if (!open.is_open) return;
  complete.push_back({level, open.page, std::exchange(open.nodes, {}),
                      std::exchange(open.lobes, {}), std::exchange(open.scratch.payload, {})});
  open.is_open = false;
}

// The node at hand is complete, and with it every parent of which it is the last child.
void RadiositySweep::leave(NodeSums sums, PieceSums lobes) {
  while (!path_.empty()) {
    Node& node = current();
    setRadiosity(sums, scene_.header().flatness_limit, node);
    Siblings& siblings = path_.back();
    siblings.sums.add(sums);
    if (has_lobes_) {
      open_[static_cast<std::size_t>(siblings.level)].lobes[siblings.at] = lobesOf(node, lobes);
      if (path_.size() > 1) addToPieces(parentOfCurrent(), node, lobes, siblings.lobes);
    }
    if (++siblings.at < siblings.end) return;
    sums = siblings.sums;
    lobes = siblings.lobes;
    path_.pop_back();
  }
  root_sums_ = sums;
}

Status RadiositySweep::finish(std::vector<SweptNodePage>& complete) {
  const auto incomplete = [this](const OpenPage& open) {
    return open.is_open && open.met != open.nodes.size();
  };
  if (!has_begun_ || !path_.empty() || std::any_of(open_.begin(), open_.end(), incomplete)) {
    return Status::corruption(
        fmt::format("{}: nodes are left that no surfel lies below", scene_.path()));
  }
  for (int level = 0; level <= kCurveLevels; ++level) {
    const OpenPage& open = open_[static_cast<std::size_t>(level)];
    const std::uint32_t end = scene_.header().level_first_page[static_cast<std::size_t>(level) + 1];
    const std::uint32_t met =
        open.is_open ? open.page + 1
                     : scene_.header().level_first_page[static_cast<std::size_t>(level)];
    if (met != end) {
      return scene_.pages().pageError(met, "node group: no parent refers to it");
    }
    closePage(level, complete);
  }
  return {};
}

}  // namespace surfeit
