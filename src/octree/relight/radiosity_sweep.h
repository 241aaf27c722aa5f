// Walks the tree of a scene bottom-up, beside its surfels with new radiosities, and gives every
// node the sums of what lies below it (memo 7.4). It rests on the order of a scene file: surfels,
// leaves and the siblings of every level lie along one curve, so that a page of each level is open
// at a time, and no page is read twice.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/curve_key.h"
#include "octree/node/lobe.h"
#include "octree/node/node.h"
#include "octree/node/node_sums.h"
#include "octree/read/scene_file.h"
#include "surfeit/status.h"

namespace surfeit {

// A node page of which every node has its new radiosity and power.
struct SweptNodePage {
  int level = 0;
  std::uint32_t page = 0;  // of the file
  std::vector<Node> nodes;
  std::vector<NodeLobes> lobes;    // of each node; empty without lobes
  std::vector<std::byte> payload;  // as it was
};

// One thread at a time. Takes a node page for each of up to 22 levels.
class RadiositySweep {
 public:
  // `scene` must outlive it.
  explicit RadiositySweep(const SceneFile& scene) : scene_(scene) {}

  // The surfels of the next surfel page, and their lobes; without lobes none on any page. Node
  // pages that are complete now are appended, those of a level in their order. Errors: those of
  // reading pages, and kCorruption where the pages are not in the order of the tree.
  Status add(std::span<const Surfel> surfels, std::span<const Lobe> lobes,
             std::vector<SweptNodePage>& complete);
  // After the last surfel page: the pages left. kCorruption unless every node was met.
  Status finish(std::vector<SweptNodePage>& complete);

  // Of all surfels; after finish().
  const NodeSums& sums() const { return root_sums_; }

 private:
  // The page of a level that the walk is on.
  struct OpenPage {
    bool is_open = false;
    std::uint32_t page = 0;
    std::size_t met = 0;  // nodes of it that a parent referred to
    std::vector<Node> nodes;
    std::vector<NodeLobes> lobes;
    SceneFile::Scratch scratch;
  };
  // Siblings on the way from the root to the leaf at hand.
  struct Siblings {
    int level = 0;
    std::uint16_t at = 0, end = 0;  // in the open page of the level
    NodeSums sums;                  // of those before `at`
    PieceSums lobes;                // of those before `at`, by the pieces of their parent
  };

  Node& current();
  const Node& parentOfCurrent() const;  // of a node that is not the root
  Status descend(std::vector<SweptNodePage>& complete);
  Status enter(const NodeRange& range, std::vector<SweptNodePage>& complete);
  Status openPage(int level, std::uint32_t page, std::vector<SweptNodePage>& complete);
  void closePage(int level, std::vector<SweptNodePage>& complete);
  Status beginLeaf(std::size_t first);
  void addToLeaf(std::span<const Surfel> surfels, std::span<const Lobe> lobes);
  void leave(NodeSums sums, PieceSums lobes);

  const SceneFile& scene_;
  std::array<OpenPage, kCurveLevels + 1> open_;
  std::vector<Siblings> path_;  // levels rise
  std::uint32_t surfel_page_ = 0;
  std::uint64_t leaf_left_ = 0;  // surfels of the leaf at hand; 0: none is at hand
  NodeSums leaf_sums_, root_sums_;
  PieceSums leaf_lobes_;
  bool has_lobes_ = false;
  bool has_begun_ = false;
};

}  // namespace surfeit
