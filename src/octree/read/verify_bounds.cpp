#include "octree/read/verify_bounds.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <deque>
#include <glm/geometric.hpp>
#include <mutex>
#include <vector>

#include "core/first_failure.h"
#include "core/long_side.h"
#include "core/worker_threads.h"
#include "octree/read/verify_sums.h"

namespace surfeit {
namespace {

// Writers round outwards by more (docs/format.md, "Node-group page"): a part of the radius, and of
// a cosine.
constexpr double kTolerance = 1e-6;

// Subtrees of so many surfels at most, or of a part of the scene that leaves some for each thread,
// are walked at a time.
constexpr std::uint64_t kSubtreeSurfels = 1 << 16, kSubtreesOfThread = 16;

glm::dvec3 directionOf(const glm::vec3& normal) {
  const glm::dvec3 n(normal);
  const double length = glm::length(n);
  return length > 0 ? n / length : n;
}

// A surfel as bounds see it.
struct Shape {
  glm::dvec3 position, normal;
  double radius;
  bool has_one_normal;

  explicit Shape(const Surfel& surfel)
      : position(surfel.position),
        normal(directionOf(surfel.normal)),
        radius(surfel.radius),
        has_one_normal(!surfel.isSphere() && !surfel.isTwoSided() &&
                       surfel.normal != glm::vec3(0)) {}
};

// A node above the surfels at hand: what it claims, and what the surfels met so far need.
struct Claim {
  Node node;
  std::uint32_t page = 0, index = 0;
  std::size_t parent = 0;  // of nodes shared by subtrees: among those
  SumsBelow sums;          // of the children and the surfels met so far
  glm::dvec3 position, normal;
  double radius = 0, thickness = 0, cosine = -1;
  double radius_needed = 0, thickness_needed = 0, cosine_needed = 1;

  Claim(const Node& claiming, std::uint32_t page_of_node, std::uint32_t index_on_page,
        std::size_t parent_of_node)
      : node(claiming),
        page(page_of_node),
        index(index_on_page),
        parent(parent_of_node),
        position(claiming.position),
        normal(directionOf(claiming.normal)),
        radius(claiming.radius),
        thickness(claiming.thickness),
        cosine(claiming.normal_cosine) {}

  void meet(const Shape& surfel) {
    const glm::dvec3 d = surfel.position - position;
    radius_needed = std::max(radius_needed, glm::length(d) + surfel.radius);
    const double facing = glm::dot(surfel.normal, normal);
    // Of a sphere, and where the node has no normal, 1 and 0
    const double tilt = std::sqrt(std::max(1 - facing * facing, 0.0));
    thickness_needed =
        std::max(thickness_needed, std::abs(glm::dot(d, normal)) + surfel.radius * tilt);
    cosine_needed = std::min(cosine_needed, surfel.has_one_normal ? facing : -1);
  }
  void merge(const Claim& other) {
    radius_needed = std::max(radius_needed, other.radius_needed);
    thickness_needed = std::max(thickness_needed, other.thickness_needed);
    cosine_needed = std::min(cosine_needed, other.cosine_needed);
  }

  // What it claims too little of, or nothing.
  std::string excess() const {
    const auto message = [this](const char* claim, double found, const char* bound, double needed) {
      return fmt::format("node {}: {} {}, expected at {} {} for the surfels below", index, claim,
                         found, bound, needed);
    };
    const double slack = radius * kTolerance;
    if (radius_needed > radius + slack) {
      return message("bounding radius", radius, "least", radius_needed);
    }
    // All of the sphere, and all directions
    if (thickness < radius && thickness_needed > thickness + slack) {
      return message("thickness", thickness, "least", thickness_needed);
    }
    if (cosine > -1 && cosine_needed < cosine - kTolerance) {
      return message("normal cosine", cosine, "most", cosine_needed);
    }
    return {};
  }
};

// Walks the top of the tree, then the subtrees below it on all threads.
class BoundsWalk {
 public:
  BoundsWalk(PagedOctree& octree, float brightest, Progress& progress,
             const std::function<void(const std::string&)>& report)
      : octree_(octree),
        has_bounds_(octree.file().header().pageForm().has_bounds),
        has_rectangles_(octree.file().header().has_rectangles),
        tolerance_{octree.file().header().full_precision, octree.file().header().has_variances,
                   octree.file().header().has_slopes, octree.file().header().flatness_limit,
                   brightest},
        progress_(progress),
        report_(report) {}

  Status run(int threads);

 private:
  static constexpr std::size_t kNoParent = ~std::size_t{0};
  struct Subtree {
    NodeRange root;  // one node
    std::size_t parent = kNoParent;
    SumsBelow sums;  // once it has been walked
  };
  // A child of a node of the top, in their order: another one, or a subtree.
  struct TopChild {
    std::size_t parent, index;
    bool is_subtree;
  };

  Status divide(std::uint64_t most_surfels);
  Status walkSubtrees();
  Status walk(PagedOctree::Reader& reader, const NodeRange& range, std::vector<Claim>& path,
              SumsBelow& sums);
  Status meetLeaf(PagedOctree::Reader& reader, std::vector<Claim>& path);
  Surfel asSummed(Surfel surfel) const;
  void sumUpTop();
  void report(const Claim& claim);

  PagedOctree& octree_;
  const bool has_bounds_, has_rectangles_;
  const SumsTolerance tolerance_;
  Progress& progress_;
  const std::function<void(const std::string&)>& report_;
  std::deque<Claim> top_;  // parents first
  std::vector<TopChild> top_children_;
  std::vector<Subtree> subtrees_;  // each is one thread's at a time
  std::atomic<std::size_t> next_{0};
  FirstFailure failure_;
  std::mutex mutex_;  // guards top_ while subtrees are walked, and report_
};

void BoundsWalk::report(const Claim& claim) {
  std::string finding = has_bounds_ ? claim.excess() : std::string();
  if (finding.empty()) {
    finding = wrongSum(claim.node, claim.sums, tolerance_);
    if (finding.empty()) return;
    finding = fmt::format("node {}: {}", claim.index, finding);
  }
  const std::lock_guard lock(mutex_);
  report_(octree_.file().pages().pageError(claim.page, finding).message());
}

// Nodes with more surfels than that become the top, what is below them subtrees.
Status BoundsWalk::divide(std::uint64_t most_surfels) {
  PagedOctree::Reader reader(octree_);
  std::vector<Subtree> open = {{kRootRange, kNoParent, {}}};
  while (!open.empty()) {
    if (progress_.isCancelled()) return Status::interrupted();
    const Subtree at = open.back();
    open.pop_back();
    SURFEIT_ASSIGN_OR_RETURN(const std::span<const Node> nodes, reader.nodes(at.root));
    const Node& node = nodes.front();
    const bool is_subtree = node.isLeaf() || node.surfel_count <= most_surfels;
    const std::size_t index = is_subtree ? subtrees_.size() : top_.size();
    if (at.parent != kNoParent) top_children_.push_back({at.parent, index, is_subtree});
    if (is_subtree) {
      subtrees_.push_back(at);
      continue;
    }
    top_.emplace_back(node, at.root.page, at.root.first, at.parent);
    for (std::uint16_t i = node.child_count; i > 0; --i) {
      const auto child = static_cast<std::uint16_t>(node.first + i - 1);
      open.push_back({{node.page, child, 1}, top_.size() - 1, {}});
    }
  }
  return {};
}

// `path` holds the nodes above the range. Adds up in the order of the surfels, as the indexer does.
Status BoundsWalk::walk(PagedOctree::Reader& reader, const NodeRange& range,
                        std::vector<Claim>& path, SumsBelow& sums) {
  if (progress_.isCancelled()) return Status::interrupted();
  SURFEIT_ASSIGN_OR_RETURN(const std::span<const Node> page, reader.nodes(range));
  // Going deeper gives up the page
  const std::vector<Node> siblings(page.begin(), page.end());
  for (std::uint32_t i = 0; i < siblings.size(); ++i) {
    path.emplace_back(siblings[i], range.page, range.first + i, kNoParent);
    if (siblings[i].isLeaf()) {
      SURFEIT_RETURN_IF_ERROR(meetLeaf(reader, path));
    } else {
      SumsBelow below;
      SURFEIT_RETURN_IF_ERROR(walk(reader, childrenOf(siblings[i]), path, below));
      path.back().sums = below;
    }
    report(path.back());
    sums.add(path.back().sums);
    path.pop_back();
  }
  return {};
}

// As the nodes of this scene take it.
Surfel BoundsWalk::asSummed(Surfel surfel) const {
  if (!has_rectangles_) surfel.long_side = kNoLongSide;
  return surfel;
}

// The last of the path.
Status BoundsWalk::meetLeaf(PagedOctree::Reader& reader, std::vector<Claim>& path) {
  const Node leaf = path.back().node;
  SURFEIT_RETURN_IF_ERROR(reader.visitLeaf(leaf, [&](std::span<const Surfel> surfels) {
    for (const Surfel& surfel : surfels) {
      const Shape shape(surfel);
      for (Claim& claim : path) claim.meet(shape);
      path.back().sums.add(asSummed(surfel));
    }
    return progress_.isCancelled() ? Status::interrupted() : Status();
  }));
  progress_.advance(leaf.surfel_count);
  return {};
}

Status BoundsWalk::walkSubtrees() {
  PagedOctree::Reader reader(octree_);
  std::vector<Claim> path;
  while (!failure_.happened()) {
    const std::size_t number = next_++;
    if (number >= subtrees_.size()) break;
    Subtree& subtree = subtrees_[number];
    path.clear();
    {
      const std::lock_guard lock(mutex_);
      for (std::size_t i = subtree.parent; i != kNoParent; i = top_[i].parent) {
        path.push_back(top_[i]);
      }
    }
    const std::size_t above = path.size();
    SURFEIT_RETURN_IF_ERROR(walk(reader, subtree.root, path, subtree.sums));
    const std::lock_guard lock(mutex_);
    std::size_t parent = subtree.parent;
    for (std::size_t i = 0; i < above; ++i, parent = top_[parent].parent) {
      top_[parent].merge(path[i]);
    }
  }
  return {};
}

// Children come after their parents, and those of one parent in their order: whatever the threads,
// sums are the same.
void BoundsWalk::sumUpTop() {
  for (std::size_t i = top_.size(); i-- > 0;) {
    for (const TopChild& child : top_children_) {
      if (child.parent != i) continue;
      top_[i].sums.add(child.is_subtree ? subtrees_[child.index].sums : top_[child.index].sums);
    }
  }
}

Status BoundsWalk::run(int threads) {
  const std::uint64_t surfels = octree_.file().header().surfel_count;
  progress_.beginPhase("verify sums", surfels, "surfels");
  const std::uint64_t parts = static_cast<std::uint64_t>(threads) * kSubtreesOfThread;
  SURFEIT_RETURN_IF_ERROR(divide(std::max(kSubtreeSurfels, surfels / parts)));
  SURFEIT_RETURN_IF_ERROR(
      runOnThreads(threads, failure_, "verify", [this] { return walkSubtrees(); }));
  sumUpTop();
  for (const Claim& claim : top_) report(claim);
  return {};
}

}  // namespace

Status verifyBounds(PagedOctree& octree, int threads, float brightest, Progress& progress,
                    const std::function<void(const std::string&)>& report) {
  return BoundsWalk(octree, brightest, progress, report).run(threads);
}

}  // namespace surfeit
