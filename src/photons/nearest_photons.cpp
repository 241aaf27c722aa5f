#include "photons/nearest_photons.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>

#include "core/assert.h"

namespace surfeit {
namespace {

// An estimate's photons are most likely among so many times as many in one cell.
constexpr std::uint64_t kCellPhotons = 4;

// A node to visit, by how deep the middle of the centres lies in its sphere, or how far outside.
struct Candidate {
  float distance;
  Node node;
};

float signedDistance(const glm::vec3& position, const Node& node) {
  return glm::length(node.position - position) - node.radius;
}

}  // namespace

NearestPhotons::NearestPhotons(const NearestPhotonSearch& search)
    : search_(search), photons_(kMostCentres * roomFor(search)) {
  SURFEIT_ASSERT(search.count > 0);
  centres_.reserve(kMostCentres);
}

std::size_t NearestPhotons::memoryBytes(const NearestPhotonSearch& search) {
  return kMostCentres * (roomFor(search) * sizeof(NearestPhoton) + sizeof(Centre));
}

Status NearestPhotons::find(std::span<const Surfel> centres, PagedOctree::Reader& reader) {
  SURFEIT_ASSERT(!centres.empty() && centres.size() <= kMostCentres);
  centres_.clear();
  middle_ = glm::vec3(0);
  const std::size_t room = roomFor(search_);
  for (std::size_t i = 0; i < centres.size(); ++i) {
    const Surfel& centre = centres[i];
    centres_.push_back({centre.position, centre.normal, TangentFrame(centre.normal),
                        std::span(photons_).subspan(i * room, room)});
    centres_.back().limitTo(search_.max_distance * search_.max_distance);
    middle_ += centre.position;
  }
  middle_ /= float(centres.size());
  SURFEIT_RETURN_IF_ERROR(limitToNeighbourhood(reader));
  SURFEIT_RETURN_IF_ERROR(visit(kRootRange, reader));

  // Those that lie among photons of other surfaces look farther
  bool look_again = false;
  for (Centre& centre : centres_) {
    const bool is_done = centre.found > search_.count;
    if (!is_done) centre.found = 0;
    centre.limitTo(is_done ? 0 : search_.max_distance * search_.max_distance);
    look_again = look_again || !is_done;
  }
  if (look_again) SURFEIT_RETURN_IF_ERROR(visit(kRootRange, reader));
  for (Centre& centre : centres_) {
    if (centre.found > search_.count) keepNearest(centre);
  }
  return {};
}

std::span<NearestPhoton> NearestPhotons::nearest(std::size_t i) {
  return centres_[i].photons.first(centres_[i].found);
}

// Limits the centres to what surely holds enough photons, whatever their normals: the smallest cell
// around the middle with several times as many. Else the walk would collect far ones first.
Status NearestPhotons::limitToNeighbourhood(PagedOctree::Reader& reader) {
  NodeRange range = kRootRange;
  for (;;) {
    SURFEIT_ASSIGN_OR_RETURN(const std::span<const Node> nodes, reader.nodes(range));
    const Node* const nearest =
        &*std::min_element(nodes.begin(), nodes.end(), [&](const Node& a, const Node& b) {
          return signedDistance(middle_, a) < signedDistance(middle_, b);
        });
    if (nearest->surfel_count < kCellPhotons * search_.count) return {};
    for (Centre& centre : centres_) {
      const float reach = glm::length(nearest->position - centre.position) + nearest->radius;
      centre.limitTo(std::min(centre.limit_sq, reach * reach * 1.000001f));
    }
    if (nearest->isLeaf()) return {};
    range = childrenOf(*nearest);
  }
}

// Depth first, what is nearest to the middle first, so that limits shrink early. A visited range is
// copied because the reader may drop its page.
Status NearestPhotons::visit(const NodeRange& range, PagedOctree::Reader& reader) {
  SURFEIT_ASSIGN_OR_RETURN(const std::span<const Node> nodes, reader.nodes(range));
  std::array<Candidate, 8> candidates;
  std::size_t count = 0;
  for (const Node& node : nodes) {
    if (!mayHoldNearer(node)) continue;
    const float distance = signedDistance(middle_, node);
    std::size_t place = count++;
    for (; place > 0 && candidates[place - 1].distance > distance; --place) {
      candidates[place] = candidates[place - 1];
    }
    candidates[place] = {distance, node};
  }
  for (std::size_t i = 0; i < count; ++i) {
    const Node& node = candidates[i].node;
    if (!mayHoldNearer(node)) continue;  // any more
    SURFEIT_RETURN_IF_ERROR(node.isLeaf() ? visitLeaf(node, reader)
                                          : visit(childrenOf(node), reader));
  }
  return {};
}

Status NearestPhotons::visitLeaf(const Node& leaf, PagedOctree::Reader& reader) {
  return reader.visitLeaf(leaf, [&](std::span<const Surfel> photons) {
    for (std::size_t begin = 0; begin < photons.size(); begin += kBlockPhotons) {
      const Block block(photons.subspan(begin, std::min(kBlockPhotons, photons.size() - begin)));
      for (Centre& centre : centres_) {
        if (centre.mayFindIn(leaf)) test(block, centre);
      }
    }
  });
}

bool NearestPhotons::mayHoldNearer(const Node& node) const {
  return std::any_of(centres_.begin(), centres_.end(),
                     [&](const Centre& centre) { return centre.mayFindIn(node); });
}

void NearestPhotons::Centre::limitTo(float distance_sq) {
  limit_sq = distance_sq;
  limit = std::sqrt(distance_sq);
}

// Distances as measured are no shorter than straight ones. A slack of one part in a million covers
// rounding.
bool NearestPhotons::Centre::mayFindIn(const Node& node) const {
  const glm::vec3 d = node.position - position;
  const float reach = (node.radius + limit) * 1.000001f;
  return limit_sq > 0 && glm::dot(d, d) < reach * reach;
}

NearestPhotons::Block::Block(std::span<const Surfel> block_photons) : photons(block_photons) {
  x.fill(std::numeric_limits<float>::infinity());
  y = z = x;
  for (std::size_t i = 0; i < photons.size(); ++i) {
    x[i] = photons[i].position.x, y[i] = photons[i].position.y, z[i] = photons[i].position.z;
  }
}

// Takes the photons that are near enough and on the same surface.
void NearestPhotons::test(const Block& block, Centre& centre) const {
  const glm::vec3 c = centre.position, n = centre.normal;
  const float stretch_sq = search_.stretch * search_.stretch - 1;
  std::array<float, kBlockPhotons> distance_sq;
  for (std::size_t i = 0; i < kBlockPhotons; ++i) {
    const float x = block.x[i] - c.x, y = block.y[i] - c.y, z = block.z[i] - c.z;
    const float height = x * n.x + y * n.y + z * n.z;
    distance_sq[i] = x * x + y * y + z * z + stretch_sq * height * height;
  }
  for (std::size_t i = 0; i < block.photons.size(); ++i) {
    if (!(distance_sq[i] < centre.limit_sq)) continue;
    const Surfel& photon = block.photons[i];
    if ((glm::dot(photon.normal, n) < search_.min_cosine) != search_.takes_others) continue;
    const glm::vec3 d = photon.position - c;
    centre.photons[centre.found++] = {
        distance_sq[i],
        {glm::dot(d, centre.frame.tangent), glm::dot(d, centre.frame.bitangent)},
        photon.radiosity};
    if (centre.found == centre.photons.size()) {
      keepNearest(centre);
      centre.limitTo(centre.photons[search_.count].distance_sq);
    }
  }
}

// Lets go of all but the nearest and the next one. Twice as many fit, so that each photon costs a
// few steps rather than a place in a sorted list.
void NearestPhotons::keepNearest(Centre& centre) const {
  const auto begin = centre.photons.begin();
  std::nth_element(
      begin, begin + static_cast<std::ptrdiff_t>(search_.count),
      begin + static_cast<std::ptrdiff_t>(centre.found),
      [](const NearestPhoton& a, const NearestPhoton& b) { return a.distance_sq < b.distance_sq; });
  centre.found = search_.count + 1;
}

}  // namespace surfeit
