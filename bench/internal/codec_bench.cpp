// What it costs to turn sorted surfels into finished pages and back, and to pack the indexer's
// blocks: one thread, processor time.
//
//   codec_bench [CLOUD.ply ...]
//
// Without clouds two synthetic ones of 262,144 surfels: a bumpy terrain with spheres above it, lit
// and colored smoothly, and the same with noise in every channel. Prints nanoseconds per surfel or
// node, and bytes before and after zstd; each time is the least of several runs. For blocks zstd is
// what the indexer does not do.
#include <fmt/format.h>
#include <time.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <glm/geometric.hpp>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "core/curve_key.h"
#include "octree/build/surfel_block.h"
#include "octree/node/node_sums.h"
#include "octree/page/node_group.h"
#include "octree/page/surfel_group.h"
#include "storage/page_codec.h"
#include "surfels/open_surfel_source.h"

namespace surfeit {
namespace {

constexpr std::size_t kSyntheticSurfels = 1 << 18;
constexpr std::size_t kLargestCloud = 1 << 20;  // surfels taken of a file
constexpr std::size_t kSurfelGroup = 512;
constexpr std::size_t kNodeGroup = 128;
constexpr std::size_t kBlock = 2048;
constexpr std::size_t kBucket = 16 * kBlock;
constexpr std::size_t kLeafCapacity = 16;
constexpr float kFlatnessLimit = 0.97f;
constexpr int kRuns = 7;

double threadSeconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return double(now.tv_sec) + 1e-9 * double(now.tv_nsec);
}

// Nanoseconds per item of the fastest of several runs.
double timeOf(std::size_t items, const std::function<void()>& run) {
  double best = std::numeric_limits<double>::infinity();
  for (int i = 0; i < kRuns; ++i) {
    const double begin = threadSeconds();
    run();
    best = std::min(best, threadSeconds() - begin);
  }
  return best * 1e9 / double(items);
}

// A number in [0, 1), the same everywhere.
float uniform(std::mt19937& random) { return float(random() >> 8) * 0x1p-24f; }

// Height of the terrain over the unit square.
float heightAt(float x, float y) {
  return 0.08f * std::sin(9 * x) * std::cos(7 * y) + 0.02f * std::sin(41 * x + 3 * y) +
         0.006f * std::cos(160 * y - 90 * x);
}

// Light and color of a surface point: both vary over some tenths of the scene.
void shade(Surfel& surfel) {
  const glm::vec3 sun = glm::normalize(glm::vec3(0.4f, 0.3f, 0.85f));
  const glm::vec3& p = surfel.position;
  surfel.albedo = {0.45f + 0.3f * std::sin(11 * p.x), 0.4f + 0.2f * std::cos(7 * p.y),
                   0.3f + 0.1f * std::sin(5 * p.x + 6 * p.y)};
  const float light = 0.3f + 2 * std::max(0.f, glm::dot(surfel.normal, sun));
  surfel.radiosity = surfel.albedo * light * glm::vec3(1, 0.95f, 0.85f);
}

// Three quarters of the surfels on the terrain, the others on 24 spheres.
std::vector<Surfel> terrainWithSpheres(std::size_t count) {
  std::mt19937 random(1);
  std::vector<Surfel> cloud(count);
  const float spacing = std::sqrt(1.3f / float(count));
  for (std::size_t i = 0; i < count; ++i) {
    Surfel& surfel = cloud[i];
    if (i % 4 != 3) {
      const float x = uniform(random), y = uniform(random), step = 1e-3f;
      surfel.position = {x, y, heightAt(x, y)};
      surfel.normal = glm::normalize(glm::vec3(heightAt(x, y) - heightAt(x + step, y),
                                               heightAt(x, y) - heightAt(x, y + step), step));
    } else {
      const auto sphere = static_cast<float>(i / 4 % 24);
      const glm::vec3 centre(0.1f + 0.8f * std::fmod(sphere * 0.618f, 1.f), sphere / 24, 0.25f);
      const float z = 2 * uniform(random) - 1, angle = 6.2831853f * uniform(random);
      const float ring = std::sqrt(1 - z * z);
      surfel.normal = {ring * std::cos(angle), ring * std::sin(angle), z};
      surfel.position = centre + (0.03f + 0.001f * sphere) * surfel.normal;
    }
    surfel.area = spacing * spacing * (0.8f + 0.4f * uniform(random));
    surfel.radius = 0.8f * std::sqrt(surfel.area);
    shade(surfel);
  }
  return cloud;
}

// What a scanner or a noisy light estimate adds.
std::vector<Surfel> withNoise(std::vector<Surfel> cloud) {
  std::mt19937 random(2);
  const auto factor = [&](float width) { return 1 + width * (2 * uniform(random) - 1); };
  for (Surfel& surfel : cloud) {
    surfel.normal = glm::normalize(surfel.normal +
                                   0.2f * glm::vec3(factor(1) - 1, factor(1) - 1, factor(1) - 1));
    surfel.radius *= factor(0.3f);
    surfel.area *= factor(0.3f);
    for (int c = 0; c < 3; ++c) {
      surfel.radiosity[c] *= factor(0.4f);
      surfel.albedo[c] *= factor(0.3f);
    }
  }
  return cloud;
}

Result<std::vector<Surfel>> readCloud(const std::string& path) {
  SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<SurfelSource> source,
                           openSurfelSource(path, false));
  std::vector<Surfel> cloud(kLargestCloud);
  std::size_t count = 0;
  while (count < cloud.size()) {
    SURFEIT_ASSIGN_OR_RETURN(const std::size_t got, source->read(std::span(cloud).subspan(count)));
    if (got == 0) break;
    count += got;
  }
  cloud.resize(count);
  for (Surfel& surfel : cloud) {
    if (!(surfel.radius > 0)) surfel.radius = 1e-3f;
    if (!(surfel.area > 0)) surfel.area = 1e-6f;
  }
  if (cloud.empty()) return Status::corruption(path + ": no surfels");
  return cloud;
}

// A cloud in curve order with the keys of its surfels.
struct SortedCloud {
  std::vector<Surfel> surfels;
  std::vector<CurveKey> keys;
};

SortedCloud sortAlongCurve(const std::vector<Surfel>& cloud) {
  Bounds3 bounds;
  for (const Surfel& surfel : cloud) bounds.add(surfel.position);
  const RootCube cube = rootCube(bounds);
  std::vector<std::pair<CurveKey, std::size_t>> order(cloud.size());
  for (std::size_t i = 0; i < cloud.size(); ++i) order[i] = {curveKey(cloud[i].position, cube), i};
  std::sort(order.begin(), order.end());
  SortedCloud sorted;
  for (const auto& [key, i] : order) {
    sorted.keys.push_back(key);
    sorted.surfels.push_back(cloud[i]);
  }
  return sorted;
}

// The octree over a sorted cloud, as runs of surfels and runs of nodes: what NodeSums adds up, and
// the nodes of every level in curve order. Pages and places are plausible, not exact.
class Tree {
 public:
  explicit Tree(const SortedCloud& cloud) : cloud_(cloud), levels_(kCurveLevels + 1) {
    root_ = add(0, cloud.keys.size(), 0);
  }

  struct Run {
    std::size_t begin = 0, end = 0;
  };
  const std::vector<Run>& leaves() const { return leaves_; }
  // Of every interior node its children in `sums()`.
  const std::vector<std::vector<std::size_t>>& parents() const { return parents_; }
  const std::vector<NodeSums>& sums() const { return sums_; }
  const std::vector<std::vector<LevelNode>>& levels() const { return levels_; }
  std::size_t nodeCount() const { return sums_.size(); }

 private:
  // Adds the cell of `level` that holds surfels begin to end; returns its index in sums_.
  std::size_t add(std::size_t begin, std::size_t end, int level) {
    if (end - begin <= kLeafCapacity || level == kCurveLevels) {
      NodeSums sums;
      for (std::size_t i = begin; i < end; ++i) sums.add(cloud_.surfels[i]);
      leaves_.push_back({begin, end});
      return addNode(sums, level, 0, begin);
    }
    std::vector<std::size_t> children;
    const std::size_t first = levels_[static_cast<std::size_t>(level) + 1].size();
    for (std::size_t i = begin; i < end;) {
      std::size_t next = i + 1;
      while (next < end && firstDifferentLevel(cloud_.keys[i], cloud_.keys[next]) > level + 1) {
        ++next;
      }
      if (i == begin && next == end) return add(begin, end, level + 1);  // a single child
      children.push_back(add(i, next, level + 1));
      i = next;
    }
    NodeSums sums;
    for (const std::size_t child : children) sums.add(sums_[child]);
    const std::size_t count = children.size();
    parents_.push_back(std::move(children));
    return addNode(sums, level, count, first);
  }

  std::size_t addNode(const NodeSums& sums, int level, std::size_t child_count, std::size_t first) {
    const float radius = radiusOfBox(sums.centre(), sums.disk_bounds);
    LevelNode node{sums.toNode(kFlatnessLimit, radius), 0};
    node.node.child_count = static_cast<std::uint8_t>(child_count);
    if (child_count > 0) node.child_level = static_cast<std::uint8_t>(level + 1);
    const std::size_t capacity = child_count > 0 ? kNodeGroup : kSurfelGroup;
    node.node.page = static_cast<std::uint32_t>(first / capacity);
    node.node.first = static_cast<std::uint16_t>(
        std::min(first % capacity, capacity - (child_count > 0 ? child_count : kLeafCapacity)));
    levels_[static_cast<std::size_t>(level)].push_back(node);
    sums_.push_back(sums);
    return sums_.size() - 1;
  }

  const SortedCloud& cloud_;
  std::size_t root_ = 0;
  std::vector<Run> leaves_;
  std::vector<std::vector<std::size_t>> parents_;
  std::vector<NodeSums> sums_;
  std::vector<std::vector<LevelNode>> levels_;
};

// Cuts every run of records into groups of `capacity`.
template <typename Record>
void addGroups(std::span<const Record> records, std::size_t capacity,
               std::vector<std::span<const Record>>& groups) {
  for (std::size_t i = 0; i < records.size(); i += capacity) {
    groups.push_back(records.subspan(i, std::min(capacity, records.size() - i)));
  }
}

// Times and sizes of pages with `records` records in all.
void measurePages(const char* what, std::size_t records, std::size_t page_count,
                  const std::function<std::size_t(std::size_t, std::vector<std::byte>&)>& encode,
                  const std::function<bool(std::size_t, Bytes)>& decode) {
  std::vector<std::vector<std::byte>> payloads(page_count), stored(page_count);
  std::vector<std::byte> payload;
  const double encode_ns = timeOf(records, [&] {
    for (std::size_t i = 0; i < page_count; ++i) encode(i, payload);
  });
  std::vector<std::size_t> packed(page_count);
  for (std::size_t i = 0; i < page_count; ++i) packed[i] = encode(i, payloads[i]);
  const double compress_ns = timeOf(records, [&] {
    for (std::size_t i = 0; i < page_count; ++i) {
      if (!compressPage(payloads[i], packed[i], stored[i]).ok())
        fmt::print("  compressPage failed\n");
    }
  });
  const double decompress_ns = timeOf(records, [&] {
    for (std::size_t i = 0; i < page_count; ++i) {
      payload.resize(payloads[i].size());
      if (!decompressPage(stored[i], payload).ok()) fmt::print("  decompressPage failed\n");
    }
  });
  const double decode_ns = timeOf(records, [&] {
    for (std::size_t i = 0; i < page_count; ++i) {
      if (!decode(i, payloads[i])) fmt::print("  decode failed\n");
    }
  });
  std::size_t payload_bytes = 0, packed_bytes = 0, stored_bytes = 0;
  for (std::size_t i = 0; i < page_count; ++i) {
    payload_bytes += payloads[i].size();
    packed_bytes += packed[i];
    stored_bytes += stored[i].size();
  }
  fmt::print("  {:8} encode {:6.1f}  compress {:6.1f}  decompress {:6.1f}  decode {:6.1f} ns, ",
             what, encode_ns, compress_ns, decompress_ns, decode_ns);
  fmt::print("payload {:6.2f}  packed {:6.2f}  stored {:6.2f} bytes\n",
             double(payload_bytes) / double(records), double(packed_bytes) / double(records),
             double(stored_bytes) / double(records));
}

void measureSurfels(std::span<const Surfel> surfels) {
  const PageForm form{false, true};
  std::vector<std::span<const Surfel>> groups;
  addGroups(surfels, kSurfelGroup, groups);
  std::vector<Surfel> decoded(kSurfelGroup);
  measurePages(
      "surfels", surfels.size(), groups.size(),
      [&](std::size_t i, std::vector<std::byte>& payload) {
        return encodeSurfelGroup(groups[i], form, payload);
      },
      [&](std::size_t, Bytes payload) { return decodeSurfelGroup(payload, form, decoded).ok(); });
}

void measureNodes(const Tree& tree) {
  std::vector<std::span<const LevelNode>> groups;
  std::vector<std::uint32_t> level_first_page, level_of_group;
  for (std::size_t level = 0; level < tree.levels().size(); ++level) {
    level_first_page.push_back(static_cast<std::uint32_t>(groups.size()));
    addGroups(std::span(tree.levels()[level]), kNodeGroup, groups);
  }
  level_first_page.push_back(static_cast<std::uint32_t>(groups.size()));
  const NodeLimits limits{level_first_page, ~0u, kNodeGroup, kSurfelGroup};
  std::vector<Node> decoded(kNodeGroup);
  measurePages(
      "nodes", tree.nodeCount(), groups.size(),
      [&](std::size_t i, std::vector<std::byte>& payload) {
        return encodeNodeGroup(groups[i], {}, payload);
      },
      [&](std::size_t i, Bytes payload) {
        return decodeNodeGroup(payload, {}, static_cast<std::uint32_t>(i), limits, decoded).ok();
      });
}

void measureSums(const SortedCloud& cloud, const Tree& tree) {
  double checksum = 0;
  const double surfel_ns = timeOf(cloud.surfels.size(), [&] {
    for (const Tree::Run& leaf : tree.leaves()) {
      NodeSums sums;
      for (std::size_t i = leaf.begin; i < leaf.end; ++i) sums.add(cloud.surfels[i]);
      checksum += sums.area;
    }
  });
  const double child_ns = timeOf(tree.nodeCount(), [&] {
    for (const std::vector<std::size_t>& children : tree.parents()) {
      NodeSums sums;
      for (const std::size_t child : children) sums.add(tree.sums()[child]);
      checksum += sums.area;
    }
  });
  const double node_ns = timeOf(tree.nodeCount(), [&] {
    for (const NodeSums& sums : tree.sums()) {
      const float radius = radiusOfBox(sums.centre(), sums.disk_bounds);
      checksum += double(sums.toNode(kFlatnessLimit, radius).area);
    }
  });
  fmt::print("  sums     add surfel {:.1f}  add child {:.1f}  to node {:.1f} ns  (area {:g})\n",
             surfel_ns, child_ns, node_ns, checksum);
}

// Blocks of buckets of the curve, within which surfels have no order.
void measureBlocks(std::vector<Surfel> surfels) {
  std::mt19937 random(3);
  std::vector<std::span<const Surfel>> blocks;
  for (std::size_t i = 0; i < surfels.size(); i += kBucket) {
    const std::size_t size = std::min(kBucket, surfels.size() - i);
    const std::span<Surfel> bucket = std::span(surfels).subspan(i, size);
    std::shuffle(bucket.begin(), bucket.end(), random);
    addGroups(std::span<const Surfel>(bucket), kBlock, blocks);
  }
  std::vector<std::vector<std::byte>> packed(blocks.size()), stored(blocks.size());
  const double pack_ns = timeOf(surfels.size(), [&] {
    for (std::size_t i = 0; i < blocks.size(); ++i) packSurfels(blocks[i], packed[i]);
  });
  std::vector<Surfel> unpacked(kBlock);
  const double unpack_ns = timeOf(surfels.size(), [&] {
    for (std::size_t i = 0; i < blocks.size(); ++i) {
      if (!unpackSurfels(packed[i], std::span(unpacked).first(blocks[i].size())).ok()) {
        fmt::print("  unpackSurfels failed\n");
      }
    }
  });
  const double compress_ns = timeOf(surfels.size(), [&] {
    for (std::size_t i = 0; i < blocks.size(); ++i) {
      if (!compressPage(packed[i], stored[i]).ok()) fmt::print("  compressPage failed\n");
    }
  });
  std::size_t packed_bytes = 0, stored_bytes = 0;
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    packed_bytes += packed[i].size();
    stored_bytes += stored[i].size();
  }
  const auto perSurfel = [&](std::size_t bytes) { return double(bytes) / double(surfels.size()); };
  fmt::print("  {:8} pack {:.1f}  unpack {:.1f}  zstd {:.1f} ns, ", "blocks", pack_ns, unpack_ns,
             compress_ns);
  fmt::print("packed {:.2f}  with zstd {:.2f} bytes\n", perSurfel(packed_bytes),
             perSurfel(stored_bytes));
}

void measureCloud(const std::string& name, const std::vector<Surfel>& unsorted) {
  const SortedCloud cloud = sortAlongCurve(unsorted);
  const Tree tree(cloud);
  std::size_t flat = 0;
  for (const std::vector<LevelNode>& level : tree.levels()) {
    for (const LevelNode& node : level) flat += node.node.isFlat() ? 1 : 0;
  }
  fmt::print("{}: {} surfels, {} nodes, {} of them flat\n", name, cloud.surfels.size(),
             tree.nodeCount(), flat);
  measureSurfels(cloud.surfels);
  measureNodes(tree);
  measureSums(cloud, tree);
  measureBlocks(cloud.surfels);
}

}  // namespace
}  // namespace surfeit

int main(int argc, char** argv) {
  using namespace surfeit;
  for (int i = 1; i < argc; ++i) {
    const Result<std::vector<Surfel>> cloud = readCloud(argv[i]);
    if (!cloud.ok()) {
      fmt::print(stderr, "{}\n", cloud.status().message());
      return 1;
    }
    measureCloud(argv[i], *cloud);
  }
  if (argc > 1) return 0;
  const std::vector<Surfel> smooth = terrainWithSpheres(kSyntheticSurfels);
  measureCloud("smooth terrain and spheres", smooth);
  measureCloud("noisy terrain and spheres", withNoise(smooth));
  return 0;
}
