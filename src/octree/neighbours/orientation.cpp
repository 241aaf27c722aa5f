#include "octree/neighbours/orientation.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <limits>
#include <numeric>
#include <unordered_map>
#include <utility>

#include "core/worker_threads.h"
#include "octree/build/scene_writer.h"
#include "octree/neighbours/local_density.h"
#include "octree/neighbours/place_index.h"
#include "octree/neighbours/side_forest.h"
#include "storage/external_sorter.h"

namespace surfeit {
namespace {

// Neighbours of a place that say which way it faces.
constexpr std::size_t kNeighbours = 10;
// Pages of a chunk: about as many surfels as a PlaceIndex serves at once.
constexpr std::uint32_t kChunkPages = 8;
// Edges that agree at least so well join places of a chunk at once; others vote.
constexpr float kSure = 0.5f;
// Pieces of fewer surfels are joined to others of their chunk by whatever edges there are.
constexpr std::uint32_t kSmallPiece = 64;
constexpr std::uint32_t kNoLabel = std::numeric_limits<std::uint32_t>::max();

// How surely two normals face the same way (positive) or opposite ones, -1 to 1: on a round surface
// each is the mirror image of the other in the plane between their places. Places above each other
// say little: they may be of two sheets, or of one with noise.
float agreement(const glm::vec3& a, const glm::vec3& b, const glm::vec3& from_a_to_b) {
  const glm::vec3 e = glm::normalize(from_a_to_b);
  const float ea = glm::dot(a, e), eb = glm::dot(b, e);
  const float above = std::max(ea * ea, eb * eb);
  return (glm::dot(a, b) - 2 * ea * eb) * (1 - above);
}

struct Edge {
  float agreement = 0;
  std::uint32_t from = 0;  // in the chunk
  std::uint64_t to = 0;    // the same, or the id of a surfel elsewhere
};

// Sorts edges by how sure they are, in steps of a two thousandth: the surest first, and of a step
// in their order. Agreements say no more about surfaces than that, and one pass does it.
class EdgeSorter {
 public:
  void sort(std::vector<Edge>& edges) {
    std::array<std::uint32_t, kSteps + 1> ends{};
    for (const Edge& edge : edges) ++ends[stepOf(edge) + 1];
    std::partial_sum(ends.begin(), ends.end(), ends.begin());
    sorted_.resize(edges.size());
    for (const Edge& edge : edges) sorted_[ends[stepOf(edge)]++] = edge;
    edges.swap(sorted_);
  }

 private:
  static constexpr std::size_t kSteps = 2048;
  static std::size_t stepOf(const Edge& edge) {
    const float doubt = 1 - std::abs(edge.agreement);
    return doubt < 1 ? std::size_t(std::max(doubt, 0.f) * float(kSteps)) : kSteps - 1;
  }

  std::vector<Edge> sorted_;
};

// Sums over a piece: A, A n, A x, A (n x).
struct PieceSums {
  double area = 0;
  glm::dvec3 normal{0}, place{0};
  double volume = 0;

  void add(const Surfel& surfel, double side) {
    const double a = double(surfel.area);
    const glm::dvec3 x(surfel.position), n = side * glm::dvec3(surfel.normal);
    area += a, normal += a * n, place += a * x, volume += a * glm::dot(n, x);
  }
  void add(const PieceSums& other, double side) {
    area += other.area, place += other.place;
    normal += side * other.normal, volume += side * other.volume;
  }
};

// An edge to a surfel of another chunk, sorted by that.
struct OuterEdge {
  std::uint64_t to = 0;
  std::uint32_t piece = 0, is_opposite = 0;  // of the near end
  float agreement = 0;
  std::uint32_t reserved = 0;
};
static_assert(sizeof(OuterEdge) == 24);

// A run of pages and what is found in it. Pieces are numbered from 0.
class Chunk {
 public:
  explicit Chunk(PagedOctree& octree) : octree_(octree), reader_(octree) {}

  Status find(std::uint32_t begin_page, std::uint32_t end_page) {
    SURFEIT_RETURN_IF_ERROR(readPages(begin_page, end_page));
    SURFEIT_RETURN_IF_ERROR(findEdges());
    joinSurfels();
    numberPieces();
    return {};
  }

  std::span<const std::uint32_t> labels() const { return labels_; }  // by id from the first page's
  std::span<const PieceSums> pieces() const { return pieces_; }
  // Of edges between pieces of this chunk: visit(a, b, agreement); and to others: visit(edge).
  template <typename Inner, typename Outer>
  Status visitVotes(const Inner& inner, const Outer& outer) const {
    for (const Edge& edge : inner_) {
      const std::uint32_t a = labels_[edge.from], b = labels_[std::size_t(edge.to)];
      if (a >> 1 == b >> 1) continue;
      inner(a >> 1, b >> 1, ((a ^ b) & 1) != 0 ? -edge.agreement : edge.agreement);
    }
    for (const Edge& edge : outer_) {
      const std::uint32_t a = labels_[edge.from];
      SURFEIT_RETURN_IF_ERROR(outer(OuterEdge{edge.to, a >> 1, a & 1, edge.agreement, 0}));
    }
    return {};
  }

 private:
  // Surfels at the index of their id, behind the pages' own numbers; gaps have no normal.
  Status readPages(std::uint32_t begin_page, std::uint32_t end_page) {
    const SceneFile& file = octree_.file();
    const std::size_t capacity = file.header().surfel_group_capacity;
    first_id_ = surfelId(file, begin_page, 0);
    surfels_.assign((end_page - begin_page) * capacity, Surfel());
    places_.clear();
    for (std::uint32_t page = begin_page; page < end_page; ++page) {
      const std::size_t at = (page - begin_page) * capacity;
      SURFEIT_ASSIGN_OR_RETURN(
          const std::uint32_t count,
          file.decodeSurfels(page, scratch_, std::span(surfels_).subspan(at, capacity)));
      for (std::size_t i = at; i < at + count; ++i) places_.push_back(std::uint32_t(i));
    }
    sides_.clear();
    for (const std::uint32_t i : places_) sides_.push_back(surfels_[i]);
    return {};
  }

  bool needsSide(std::size_t i) const { return (surfels_[i].flags & kSurfelNeedsSide) != 0; }

  Status findEdges() {
    inner_.clear(), outer_.clear();
    const auto wants = [&](std::size_t i) { return needsSide(places_[i]); };
    return index_.serve(
        sides_, wants, kNeighbours, reader_,
        [&](std::span<const std::size_t> group, std::span<NearestPlaces> found) -> Status {
          for (std::size_t i = 0; i < group.size(); ++i) {
            const std::uint32_t from = places_[group[i]];
            for (const Neighbour& neighbour : found[i].neighbours) {
              addEdge(from, surfels_[from], neighbour);
            }
          }
          return {};
        });
  }

  void addEdge(std::uint32_t from, const Surfel& surfel, const Neighbour& neighbour) {
    if (neighbour.normal == glm::vec3(0)) return;
    const float agreed = agreement(surfel.normal, neighbour.normal, neighbour.offset);
    const std::uint64_t to = neighbour.id - first_id_;  // large where it is before the first
    if (to >= surfels_.size()) {
      outer_.push_back({agreed, from, neighbour.id});
    } else if (needsSide(std::size_t(to))) {
      inner_.push_back({agreed, from, to});
    }
  }

  void joinSurfels() {
    sorter_.sort(inner_);
    forest_.reset(surfels_.size());
    for (const Edge& edge : inner_) {
      const std::uint32_t to = std::uint32_t(edge.to);
      const bool is_sure = std::abs(edge.agreement) >= kSure;
      const auto isSmall = [&](std::uint32_t i) {
        return forest_.sizeOf(forest_.rootOf(i).index) < kSmallPiece;
      };
      if (is_sure || isSmall(edge.from) || isSmall(to)) {
        forest_.join(edge.from, to, edge.agreement < 0);
      }
    }
  }

  void numberPieces() {
    labels_.assign(surfels_.size(), kNoLabel);
    numbers_.assign(surfels_.size(), kNoLabel);
    pieces_.clear();
    for (std::size_t i = 0; i < surfels_.size(); ++i) {
      if (!needsSide(i)) continue;
      const SideForest::Root root = forest_.rootOf(std::uint32_t(i));
      std::uint32_t& number = numbers_[root.index];
      if (number == kNoLabel) {
        number = std::uint32_t(pieces_.size());
        pieces_.emplace_back();
      }
      labels_[i] = number << 1 | (root.is_opposite ? 1u : 0u);
      pieces_[number].add(surfels_[i], root.is_opposite ? -1 : 1);
    }
  }

  PagedOctree& octree_;
  PagedOctree::Reader reader_;
  PlaceIndex index_;
  SceneFile::Scratch scratch_;
  std::uint64_t first_id_ = 0;
  std::vector<Surfel> surfels_, sides_;
  std::vector<std::uint32_t> places_;  // where in surfels_ those of sides_ are
  std::vector<Edge> inner_, outer_;
  EdgeSorter sorter_;
  SideForest forest_;
  std::vector<std::uint32_t> labels_, numbers_;
  std::vector<PieceSums> pieces_;
};

class SideSearch {
 public:
  SideSearch(PagedOctree& octree, const OrientationOptions& options, TemporaryBytes labels,
             Progress& progress)
      : octree_(octree),
        options_(options),
        progress_(progress),
        labels_(std::move(labels)),
        edges_({.record_bytes = sizeof(OuterEdge),
                .memory_bytes = options.memory_bytes,
                .temporary_directory = options.temporary_directory}) {}

  Status run() {
    SURFEIT_RETURN_IF_ERROR(findPieces());
    SURFEIT_RETURN_IF_ERROR(countOuterVotes());
    joinPieces();
    turnComponents();
    return {};
  }

  TemporaryBytes takeLabels() { return std::move(labels_); }
  std::vector<bool> takeTurned() { return std::move(is_turned_); }

 private:
  Status findPieces() {
    const std::uint32_t pages = octree_.file().surfelPageCount();
    progress_.beginPhase("orient", pages, "pages");
    std::vector<std::unique_ptr<Chunk>> chunks;
    for (int t = 0; t < options_.threads; ++t) chunks.push_back(std::make_unique<Chunk>(octree_));
    for (std::uint32_t begin = 0; begin < pages;) {
      if (progress_.isCancelled()) return Status::interrupted();
      std::vector<std::pair<std::uint32_t, std::uint32_t>> runs;
      for (; runs.size() < chunks.size() && begin < pages; begin += kChunkPages) {
        runs.emplace_back(begin, std::min(begin + kChunkPages, pages));
      }
      SURFEIT_RETURN_IF_ERROR(findOnThreads(chunks, runs));
      for (std::size_t t = 0; t < runs.size(); ++t) {
        SURFEIT_RETURN_IF_ERROR(add(*chunks[t]));
        progress_.advance(runs[t].second - runs[t].first);
      }
    }
    return {};
  }

  static Status findOnThreads(const std::vector<std::unique_ptr<Chunk>>& chunks,
                              std::span<const std::pair<std::uint32_t, std::uint32_t>> runs) {
    std::atomic<std::size_t> next{0};
    FirstFailure failure;
    return runOnThreads(int(runs.size()), failure, "orient", [&] {
      const std::size_t t = next++;
      return chunks[t]->find(runs[t].first, runs[t].second);
    });
  }

  Status add(const Chunk& chunk) {
    const auto first = std::uint32_t(pieces_.size());
    pieces_.insert(pieces_.end(), chunk.pieces().begin(), chunk.pieces().end());
    if (pieces_.size() >= kNoLabel >> 1) return Status::failed("orient: too many pieces");
    numbered_.assign(chunk.labels().begin(), chunk.labels().end());
    for (std::uint32_t& label : numbered_) label += label == kNoLabel ? 0 : first << 1;
    SURFEIT_RETURN_IF_ERROR(labels_.append(std::as_bytes(std::span(numbered_))));
    return chunk.visitVotes(
        [&](std::uint32_t a, std::uint32_t b, float agreed) { vote(first + a, first + b, agreed); },
        [&](OuterEdge edge) {
          edge.piece += first;
          return edges_.add(edge);
        });
  }

  void vote(std::uint32_t a, std::uint32_t b, float agreed) {
    votes_[std::uint64_t{std::min(a, b)} << 32 | std::max(a, b)] += double(agreed);
  }

  // Their far ends come in the order of the labels.
  Status countOuterVotes() {
    SURFEIT_RETURN_IF_ERROR(edges_.finish());
    SURFEIT_RETURN_IF_ERROR(labels_.flush());
    constexpr std::uint64_t kBlock = 65536;  // labels read at once
    std::vector<std::uint32_t> block;
    std::uint64_t block_begin = 0;
    const std::uint64_t count = labels_.size() / sizeof(std::uint32_t);
    for (; edges_.current() != nullptr;) {
      OuterEdge edge;
      std::memcpy(&edge, edges_.current(), sizeof edge);
      if (edge.to >= block_begin + block.size()) {
        block_begin = edge.to / kBlock * kBlock;
        block.resize(std::size_t(std::min(kBlock, count - block_begin)));
        SURFEIT_RETURN_IF_ERROR(labels_.readAt(block_begin * sizeof(std::uint32_t),
                                               std::as_writable_bytes(std::span(block))));
      }
      const std::uint32_t label = block[std::size_t(edge.to - block_begin)];
      if (label != kNoLabel && label >> 1 != edge.piece) {
        const bool is_turned = ((label ^ edge.is_opposite) & 1) != 0;
        vote(edge.piece, label >> 1, is_turned ? -edge.agreement : edge.agreement);
      }
      SURFEIT_RETURN_IF_ERROR(edges_.advance());
    }
    return {};
  }

  void joinPieces() {
    std::vector<std::pair<std::uint64_t, double>> votes(votes_.begin(), votes_.end());
    votes_ = {};
    std::sort(votes.begin(), votes.end(), [](const auto& a, const auto& b) {
      const double sure_a = std::abs(a.second), sure_b = std::abs(b.second);
      return sure_a != sure_b ? sure_a > sure_b : a.first < b.first;
    });
    forest_.reset(pieces_.size());
    for (const auto& [pair, sum] : votes) {
      forest_.join(std::uint32_t(pair >> 32), std::uint32_t(pair), sum < 0);
    }
  }

  // Closed surfaces face outward, open ones up.
  void turnComponents() {
    std::unordered_map<std::uint32_t, PieceSums> components;
    for (std::uint32_t i = 0; i < pieces_.size(); ++i) {
      const SideForest::Root root = forest_.rootOf(i);
      components[root.index].add(pieces_[i], root.is_opposite ? -1 : 1);
    }
    is_turned_.resize(pieces_.size());
    for (std::uint32_t i = 0; i < pieces_.size(); ++i) {
      const SideForest::Root root = forest_.rootOf(i);
      is_turned_[i] = root.is_opposite != isInsideOut(components[root.index]);
    }
  }

  bool isInsideOut(const PieceSums& sums) const {
    // Normals of a closed surface add up to 0. Three times its volume, about its middle
    constexpr double kOpen = 0.3;
    const double up = sums.normal[int(options_.up)];
    const double volume = sums.volume - glm::dot(sums.normal, sums.place) / sums.area;
    return std::abs(up) > kOpen * sums.area ? up < 0 : volume < 0;
  }

  PagedOctree& octree_;
  const OrientationOptions& options_;
  Progress& progress_;
  TemporaryBytes labels_;
  ExternalSorter edges_;
  std::vector<PieceSums> pieces_;
  std::vector<std::uint32_t> numbered_;
  std::unordered_map<std::uint64_t, double> votes_;  // by pair of pieces
  SideForest forest_;
  std::vector<bool> is_turned_;
};

}  // namespace

Result<Sides> Sides::find(PagedOctree& octree, const OrientationOptions& options,
                          Progress& progress) {
  SURFEIT_ASSIGN_OR_RETURN(TemporaryBytes labels,
                           TemporaryBytes::create(options.temporary_directory));
  SideSearch search(octree, options, std::move(labels), progress);
  SURFEIT_RETURN_IF_ERROR(search.run());
  return Sides(search.takeLabels(), search.takeTurned(),
               octree.file().header().surfel_group_capacity);
}

std::uint64_t Sides::searcherBytes(int threads) {
  // Surfels twice, edges in vectors that grow by doubling and sorted, labels
  constexpr std::uint64_t kChunkBytes = kChunkPages * kDefaultSurfelGroup *
                                        (2 * sizeof(Surfel) + 3 * kNeighbours * sizeof(Edge) + 32);
  return std::uint64_t(threads) * (PlaceIndex::memoryBytes() + kChunkBytes);
}

Status Sides::read(std::uint32_t page, std::span<bool> is_turned) {
  buffer_.resize(is_turned.size());
  SURFEIT_RETURN_IF_ERROR(
      labels_.readAt(std::uint64_t{page} * page_capacity_ * sizeof(std::uint32_t),
                     std::as_writable_bytes(std::span(buffer_))));
  for (std::size_t i = 0; i < buffer_.size(); ++i) {
    const std::uint32_t label = buffer_[i];
    is_turned[i] = label != kNoLabel && is_turned_[label >> 1] != ((label & 1) != 0);
  }
  return {};
}

Result<std::shared_ptr<const SortedBatch>> OrientedSurfelStream::next() {
  const std::size_t capacity = scene_.header().surfel_group_capacity;
  if (next_page_ == scene_.surfelPageCount()) return std::shared_ptr<const SortedBatch>();
  if (is_turned_ == nullptr) is_turned_ = std::make_unique<bool[]>(capacity);
  const auto batch = std::make_shared<SortedBatch>();
  batch->resize(capacity);
  SceneFile::Scratch scratch;
  SURFEIT_ASSIGN_OR_RETURN(const std::uint32_t count,
                           scene_.decodeSurfels(next_page_, scratch, batch->surfels));
  const std::span<bool> is_turned(is_turned_.get(), count);
  SURFEIT_RETURN_IF_ERROR(sides_.read(next_page_, is_turned));
  ++next_page_;
  batch->surfels = batch->surfels.first(count);
  batch->tickets.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    Surfel& surfel = batch->surfels[i];
    if (is_turned[i]) surfel.normal = -surfel.normal;
    surfel.flags &= ~(kSurfelNeedsSide | kSurfelMarks);
    batch->tickets[i] = {curveKey(surfel.position, scene_.header().cube), i};
  }
  return std::shared_ptr<const SortedBatch>(batch);
}

}  // namespace surfeit
