// Why node pages are in level order: misses of the node look-ups of a gather, by the size of an LRU
// cache, had the same nodes been put on pages in other orders. Receivers are walked along the
// curve, as a gather does it, but nothing is drawn. Sibling groups stay together and pages hold as
// many nodes in every layout.
//
//   layout_bench SCENE.sft RECEIVERS.ply [--max-solid-angle S] [--trace FILE]
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <deque>
#include <fstream>
#include <memory>
#include <numeric>
#include <string>
#include <vector>

#include "batch/gather_input.h"
#include "batch/receiver_queue.h"
#include "batch/sorted_receiver.h"
#include "cache/reuse_distances.h"
#include "gather/cut/cut.h"
#include "octree/read/paged_octree.h"
#include "octree/read/scene_file.h"

namespace {

using namespace surfeit;

constexpr std::array kShares = {0.005, 0.01, 0.025, 0.05, 0.1, 0.2};

// Siblings, and where their children are among all groups.
struct Group {
  NodeRange range;
  std::uint32_t first_child = 0, child_count = 0;  // in Tree::children
};

// All sibling groups, breadth first.
struct Tree {
  std::vector<Group> groups;
  std::vector<std::uint32_t> children;
  std::vector<std::uint32_t> by_place;       // groups by page and place on it
  std::vector<std::uint32_t> first_of_page;  // in by_place

  std::uint32_t find(const NodeRange& range) const {
    std::uint32_t place = first_of_page[range.page];
    while (groups[by_place[place]].range.first != range.first) ++place;
    return by_place[place];
  }
};

Result<Tree> readTree(PagedOctree& octree) {
  PagedOctree::Reader reader(octree);
  Tree tree;
  tree.groups.push_back({kRootRange});
  for (std::uint32_t group = 0; group < tree.groups.size(); ++group) {
    SURFEIT_ASSIGN_OR_RETURN(const std::span<const Node> nodes,
                             reader.nodes(tree.groups[group].range));
    tree.groups[group].first_child = static_cast<std::uint32_t>(tree.children.size());
    for (const Node& node : nodes) {
      if (node.isLeaf()) continue;
      tree.children.push_back(static_cast<std::uint32_t>(tree.groups.size()));
      tree.groups.push_back({childrenOf(node)});
      ++tree.groups[group].child_count;
    }
  }
  tree.by_place.resize(tree.groups.size());
  std::iota(tree.by_place.begin(), tree.by_place.end(), 0);
  const auto place = [&tree](std::uint32_t group) {
    return std::uint64_t{tree.groups[group].range.page} << 16 | tree.groups[group].range.first;
  };
  std::sort(tree.by_place.begin(), tree.by_place.end(),
            [&](std::uint32_t a, std::uint32_t b) { return place(a) < place(b); });
  tree.first_of_page.resize(octree.file().nodePageCount());
  for (std::uint32_t i = static_cast<std::uint32_t>(tree.by_place.size()); i-- > 0;) {
    tree.first_of_page[tree.groups[tree.by_place[i]].range.page] = i;
  }
  return tree;
}

// Puts groups on pages one after the other.
class Pager {
 public:
  Pager(const Tree& tree, std::uint32_t capacity)
      : tree_(tree), capacity_(capacity), page_of_group_(tree.groups.size()) {}

  bool fits(std::uint32_t group) const {
    return nodes_ + tree_.groups[group].range.count <= capacity_;
  }
  void put(std::uint32_t group) {
    if (!fits(group)) closePage();
    nodes_ += tree_.groups[group].range.count;
    page_of_group_[group] = page_;
  }
  void closePage() {
    ++page_;
    nodes_ = 0;
  }
  std::uint32_t pageCount() const { return page_ + 1; }
  std::vector<std::uint32_t> take() { return std::move(page_of_group_); }

 private:
  const Tree& tree_;
  const std::uint32_t capacity_;
  std::vector<std::uint32_t> page_of_group_;
  std::uint32_t page_ = 0, nodes_ = 0;
};

struct Layout {
  std::string name;
  std::vector<std::uint32_t> page_of_group;
  std::uint32_t pages = 0;
};

Layout levelOrder(const Tree& tree, std::uint32_t pages) {
  Layout layout{"level order", {}, pages};
  for (const Group& group : tree.groups) layout.page_of_group.push_back(group.range.page);
  return layout;
}

Layout depthFirst(const Tree& tree, std::uint32_t capacity) {
  Pager pager(tree, capacity);
  std::vector<std::uint32_t> stack = {0};
  while (!stack.empty()) {
    const std::uint32_t group = stack.back();
    stack.pop_back();
    pager.put(group);
    for (std::uint32_t i = tree.groups[group].child_count; i-- > 0;) {
      stack.push_back(tree.children[tree.groups[group].first_child + i]);
    }
  }
  const std::uint32_t pages = pager.pageCount();
  return {"depth first", pager.take(), pages};
}

// Clusters: from a root breadth first until the page is full; what is left are roots of others.
Layout treelets(const Tree& tree, std::uint32_t capacity) {
  Pager pager(tree, capacity);
  std::vector<std::uint32_t> roots = {0};
  std::deque<std::uint32_t> queue;
  while (!roots.empty()) {
    queue.assign(1, roots.back());
    roots.pop_back();
    if (!pager.fits(queue.front())) pager.closePage();
    while (!queue.empty() && pager.fits(queue.front())) {
      const std::uint32_t group = queue.front();
      queue.pop_front();
      pager.put(group);
      for (std::uint32_t i = 0; i < tree.groups[group].child_count; ++i) {
        queue.push_back(tree.children[tree.groups[group].first_child + i]);
      }
    }
    roots.insert(roots.end(), queue.rbegin(), queue.rend());
  }
  const std::uint32_t pages = pager.pageCount();
  return {"treelets", pager.take(), pages};
}

// A layout and what its caches would have missed.
struct Replay {
  explicit Replay(Layout replayed)
      : layout(std::move(replayed)), distances(layout.pages, layout.pages) {}
  void lookUp(std::uint32_t group) {
    const std::uint32_t page = layout.page_of_group[group];
    if (page != last_page) distances.touch(page);  // else a hit of any cache
    last_page = page;
  }
  Layout layout;
  ReuseDistances distances;
  std::uint32_t last_page = 0xffffffffu;
};

// Reads for a walk and replays its look-ups in all layouts.
struct TracingReader {
  PagedOctree::Reader& reader;
  const Tree& tree;
  std::vector<std::unique_ptr<Replay>>& replays;
  std::ofstream& trace;
  std::uint64_t& lookups;

  Result<std::span<const Node>> nodes(const NodeRange& range) {
    const std::uint32_t group = tree.find(range);
    for (const auto& replay : replays) replay->lookUp(group);
    if (trace.is_open()) {
      trace.write(reinterpret_cast<const char*>(&range.page), sizeof range.page);
    }
    ++lookups;
    return reader.nodes(range);
  }
  Status checkVisits(std::uint64_t nodes, std::uint64_t surfels) const {
    return reader.checkVisits(nodes, surfels);
  }
  template <typename Visit>
  Status visitLeaf(const Node&, Visit&&) {
    return {};  // surfel pages are no matter here
  }
};

void printTable(const std::vector<std::unique_ptr<Replay>>& replays, std::uint64_t lookups) {
  fmt::print("misses, % of {} node look-ups, by cache size\n  {:<12}{:>8}", lookups, "layout",
             "pages");
  for (const double share : kShares) fmt::print("{:>9}", fmt::format("{:.1f} %", 100 * share));
  fmt::print("{:>9}\n", "touched");
  for (const auto& replay : replays) {
    const MissRatioCurve curve = replay->distances.curve(lookups);
    fmt::print("  {:<12}{:>8}", replay->layout.name, replay->layout.pages);
    for (const double share : kShares) {
      const auto frames = static_cast<std::uint64_t>(share * replay->layout.pages);
      fmt::print("{:>9.3f}",
                 100 * curve.misses(std::max<std::uint64_t>(frames, 1)) / double(lookups));
    }
    fmt::print("{:>9.0f}\n", curve.unavoidableMisses());
  }
}

Status runBench(const std::string& scene_path, const std::string& receivers_path,
                const GatherQuality& quality, const std::string& trace_path) {
  SURFEIT_ASSIGN_OR_RETURN(SceneFile scene, SceneFile::open(scene_path));
  SURFEIT_ASSIGN_OR_RETURN(
      const PagedOctree::Memory memory,
      PagedOctree::planMemory(scene, PagedOctree::unlimitedCacheBytes(scene), 1));
  SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<PagedOctree> octree,
                           PagedOctree::create(std::move(scene), memory));
  const SceneHeader& header = octree->file().header();
  SURFEIT_ASSIGN_OR_RETURN(const Tree tree, readTree(*octree));

  SURFEIT_ASSIGN_OR_RETURN(GatherInput input, GatherInput::open(receivers_path));
  ExternalSorter sorter({.record_bytes = sizeof(SortedReceiver),
                         .count = input.receiverCount(),
                         .memory_bytes = input.receiverCount() * sizeof(SortedReceiver),
                         .temporary_directory = "."});
  Progress progress;
  SURFEIT_RETURN_IF_ERROR(input.sort(ReceiverOrder::kHilbert, header, false, sorter, progress));

  std::vector<std::unique_ptr<Replay>> replays;
  replays.push_back(std::make_unique<Replay>(depthFirst(tree, header.node_group_capacity)));
  replays.push_back(std::make_unique<Replay>(treelets(tree, header.node_group_capacity)));
  replays.push_back(std::make_unique<Replay>(levelOrder(tree, octree->file().nodePageCount())));
  std::ofstream trace;
  if (!trace_path.empty()) trace.open(trace_path, std::ios::binary);
  std::uint64_t lookups = 0;
  PagedOctree::Reader reader(*octree);
  TracingReader tracing{reader, tree, replays, trace, lookups};
  const auto cut = std::make_unique<CutWalk>(GatherRules(GatherMode::kBleeding, quality));
  std::vector<SortedReceiver> run(kPacketReceivers);
  for (;;) {
    SURFEIT_ASSIGN_OR_RETURN(const std::size_t count, sorter.next(run));
    if (count == 0) break;
    for (std::size_t i = 0; i < count; ++i) {
      SURFEIT_RETURN_IF_ERROR(
          cut->walk(viewPacket({&run[i].receiver, 1}), {}, tracing, IgnoreCut{}));
    }
  }
  fmt::print("{} surfels, {} nodes, {} to a page; {} receivers, {:.0f} node look-ups each\n",
             header.surfel_count, header.node_count, header.node_group_capacity,
             input.receiverCount(), double(lookups) / double(input.receiverCount()));
  printTable(replays, lookups);
  return {};
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Misses of node look-ups by page layout and cache size.");
  std::string scene, receivers, trace;
  surfeit::GatherQuality quality;
  app.add_option("SCENE", scene, "Scene file (.sft)")->required();
  app.add_option("RECEIVERS", receivers, "Cloud (PLY)")->required();
  app.add_option("--max-solid-angle", quality.max_solid_angle, "Steradians")->capture_default_str();
  app.add_option("--trace", trace,
                 "Write the pages looked up, as 32-bit numbers, for cache_bench --trace");
  app.footer(
      "Example:\n"
      "  surfeit generate -o city.recipe --recipe --surfels 10M\n"
      "  surfeit index city.recipe -o city.sft\n"
      "  surfeit generate -o receivers.ply --surfels 100k\n"
      "  layout_bench city.sft receivers.ply");
  CLI11_PARSE(app, argc, argv);
  const surfeit::Status status = runBench(scene, receivers, quality, trace);
  if (status.ok()) return 0;
  fmt::print(stderr, "layout_bench: {}\n", status.message());
  return 1;
}
