#include "gather/cut/instance_tree.h"

#include <algorithm>
#include <numeric>

#include "core/assert.h"
#include "core/bounds.h"
#include "core/curve_key.h"
#include "core/long_side.h"
#include "core/split_mix.h"
#include "octree/node/node_sums.h"

namespace surfeit {
namespace {

// Surfels that stand for an instance where it is seen with others: so many in all, and of each
// within these limits. A group of eight of ten thousand has 3,200, and is 2 % of its area off in a
// direction; what a node may cover at most is .03 of a receiver's hemisphere.
constexpr std::size_t kAllSamples = std::size_t{4} << 20;
constexpr std::size_t kLeastSamples = 64, kMostSamples = 1024;

// A sphere that holds all of an instance.
struct Sphere {
  glm::vec3 centre;
  float radius;
};

Sphere sphereOf(const InstancedScene& scene, const InstanceFrame& frame) {
  // Places in the world are rounded by up to so much of what they are added up from
  constexpr float kRounding = 0x1p-21f;
  const glm::vec3 centre = frame.toWorld(scene.root.position);
  const float radius = frame.scale * scene.root.radius;
  const glm::vec3 size = glm::abs(centre) + glm::abs(frame.shift);
  return {centre, radius + kRounding * (radius + size.x + size.y + size.z)};
}

Surfel moved(const Surfel& surfel, const InstanceFrame& frame, float area_factor) {
  Surfel world = surfel;
  world.position = frame.toWorld(surfel.position);
  world.normal = frame.directionToWorld(surfel.normal);
  world.radius = frame.scale * surfel.radius;
  world.area = area_factor * frame.scale * frame.scale * surfel.area;
  world.long_side = kNoLongSide;  // the sums do not know it
  return world;
}

}  // namespace

SymmetricMatrix InstanceFrame::spreadToWorld(const SymmetricMatrix& spread) const {
  const glm::mat3 rows = glm::transpose(rotation);
  SymmetricMatrix world;
  for (std::size_t i = 0; i < SymmetricMatrix::kEntries; ++i) {
    world.entries[i] =
        glm::dot(rows[SymmetricMatrix::kRow[i]], spread * rows[SymmetricMatrix::kColumn[i]]);
  }
  return world;
}

LocalReceiver InstanceFrame::toLocal(const LocalReceiver& receiver) const {
  return {toLocal(receiver.position), directionToLocal(receiver.normal),
          directionToLocal(receiver.view)};
}

PacketView InstanceFrame::toLocal(const PacketView& view) const {
  PacketView local = view;
  local.centre = toLocal(view.centre);
  local.radius = view.radius / scale;
  local.lift = view.lift / scale;
  local.axis = directionToLocal(view.axis);
  local.lobe_axis = directionToLocal(view.lobe_axis);
  return local;
}

// Divides instances along the curve as an octree does, cell by cell, and finishes nodes from the
// leaves up.
class InstanceTree::Builder {
 public:
  Builder(std::span<const InstancedScene> scenes, std::span<const PlacedScene> instances,
          float flatness_limit, std::vector<Node>& nodes)
      : scenes_(scenes),
        instances_(instances),
        flatness_limit_(flatness_limit),
        nodes_(nodes),
        order_(instances.size()),
        keys_(instances.size()) {}

  void build() {
    Bounds3 bounds;
    for (const PlacedScene& each : instances_) bounds.add(sphereAt(each).centre);
    const RootCube cube = rootCube(movedBounds(bounds, glm::dvec3(0)));
    std::vector<CurveKey> keys;
    for (const PlacedScene& each : instances_) {
      keys.push_back(curveKey(sphereAt(each).centre, cube));
    }
    std::iota(order_.begin(), order_.end(), 0u);
    std::stable_sort(order_.begin(), order_.end(),
                     [&](std::uint32_t a, std::uint32_t b) { return keys[a] < keys[b]; });
    for (std::size_t i = 0; i < order_.size(); ++i) keys_[i] = keys[order_[i]];

    nodes_.reserve(2 * order_.size());
    nodes_.resize(1);
    NodeSums all;
    const Node root = makeNode(0, order_.size(), all);
    nodes_.front() = root;
  }

 private:
  Sphere sphereAt(const PlacedScene& instance) const {
    return sphereOf(scenes_[instance.scene], instance.frame);
  }

  // Of a range of the order; `sums` gets those of its instances.
  Node makeNode(std::size_t begin, std::size_t end, NodeSums& sums) {
    if (end - begin == 1) {
      addInstance(begin, sums);
      Node leaf = nodeOf(begin, end, sums);
      leaf.child_count = 0;
      leaf.page = order_[begin];
      return leaf;
    }
    const std::vector<std::size_t> ends = divide(begin, end);
    const std::size_t first = nodes_.size();
    nodes_.resize(first + ends.size());
    for (std::size_t child = 0; child < ends.size(); ++child) {
      NodeSums below;
      const Node made = makeNode(child == 0 ? begin : ends[child - 1], ends[child], below);
      nodes_[first + child] = made;
      sums.add(below);
    }
    Node node = nodeOf(begin, end, sums);
    node.child_count = static_cast<std::uint8_t>(ends.size());
    node.page = static_cast<std::uint32_t>(first >> 16);
    node.first = static_cast<std::uint16_t>(first);
    return node;
  }

  // Where the children of a range end: two to eight of them.
  std::vector<std::size_t> divide(std::size_t begin, std::size_t end) const {
    std::vector<std::size_t> ends;
    const int level = firstDifferentLevel(keys_[begin], keys_[end - 1]);
    if (level > kCurveLevels) {  // all in one cell
      const std::size_t children = std::min(end - begin, kMostSiblings);
      for (std::size_t i = 1; i <= children; ++i) {
        ends.push_back(begin + (end - begin) * i / children);
      }
      return ends;
    }
    const int shift = 3 * (kCurveLevels - level);
    for (std::size_t i = begin + 1; i < end; ++i) {
      if (keys_[i] >> shift != keys_[i - 1] >> shift) ends.push_back(i);
    }
    ends.push_back(end);
    return ends;
  }

  void addInstance(std::size_t place, NodeSums& sums) const {
    const PlacedScene& instance = instances_[order_[place]];
    const std::vector<Surfel>& sample = scenes_[instance.scene].sample;
    const std::size_t wanted =
        std::clamp(kAllSamples / instances_.size(), kLeastSamples, kMostSamples);
    const std::size_t taken = std::min(wanted, sample.size());
    const float factor = float(sample.size()) / float(taken);
    // Others of the same scene show other parts of it
    const std::size_t offset = splitMix(place) % sample.size();
    for (std::size_t k = 0; k < taken; ++k) {
      const Surfel& surfel = sample[(offset + k * sample.size() / taken) % sample.size()];
      sums.add(moved(surfel, instance.frame, factor));
    }
  }

  // What the instances of a range are together; of one alone only its bounds count.
  Node nodeOf(std::size_t begin, std::size_t end, const NodeSums& sums) const {
    const glm::vec3 centre = sums.centre();
    float radius = 0;
    std::uint64_t groups = 0, surfels = 0;
    for (std::size_t i = begin; i < end; ++i) {
      const PlacedScene& instance = instances_[order_[i]];
      const Sphere sphere = sphereAt(instance);
      radius = std::max(radius, glm::distance(sphere.centre, centre) + sphere.radius);
      groups |= scenes_[instance.scene].root.groups;
      surfels += scenes_[instance.scene].root.surfel_count;
    }
    Node node = sums.toNode(flatness_limit_, radius);
    node.surfel_count = surfels;
    node.groups = groups;
    node.forgetBounds();  // those of a sample are not those of all
    node.findOffPlane();
    return node;
  }

  const std::span<const InstancedScene> scenes_;
  const std::span<const PlacedScene> instances_;
  const float flatness_limit_;
  std::vector<Node>& nodes_;
  std::vector<std::uint32_t> order_;  // numbers of instances, along the curve
  std::vector<CurveKey> keys_;        // theirs
};

InstanceTree::InstanceTree(std::span<const InstancedScene> scenes,
                           std::vector<PlacedScene> instances, float flatness_limit)
    : instances_(std::move(instances)) {
  SURFEIT_CHECK(!instances_.empty());
  Builder(scenes, instances_, flatness_limit, nodes_).build();
}

// A node for each instance, and fewer above them; while it is made, keys and their order.
std::size_t InstanceTree::memoryBytes(std::size_t count) {
  return count *
         (sizeof(PlacedScene) + 2 * sizeof(Node) + 2 * sizeof(CurveKey) + sizeof(std::uint32_t));
}

}  // namespace surfeit
