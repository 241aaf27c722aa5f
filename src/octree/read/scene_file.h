// An open .sft file: header, directory, provenance, and pages decoded on request. docs/format.md
// specifies every byte.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/bounds.h"
#include "core/curve_key.h"
#include "octree/node/lobe.h"
#include "octree/node/node.h"
#include "octree/page/page_form.h"
#include "octree/page/scene_header.h"
#include "storage/page_file.h"
#include "surfeit/status.h"
#include "surfeit/surfel.h"
#include "surfeit/up_axis.h"
#include "surfeit/version.h"

namespace surfeit {

// Immutable once open; decode calls are safe from any thread.
class SceneFile {
 public:
  // Checks header, footer, directory and provenance, but reads no page. `access` is how pages are
  // read.
  static Result<SceneFile> open(const std::string& path, Access access = Access::kCached);
  static Result<SceneFile> open(PageFile pages);

  const std::string& path() const;
  std::uint64_t fileBytes() const;
  const SceneHeader& header() const;
  const std::string& provenance() const;  // JSON
  std::uint32_t nodePageCount() const;
  std::uint32_t surfelPageCount() const;
  const PageFile& pages() const;
  // Pages are kept in a directory of this node, too (storage/page_stage.h), unless it is empty.
  // Before any is read.
  void stage(const PageStage::Options& options);
  // In the same way as those of the same scene, opened before.
  void stageAs(const SceneFile& other) { pages_.setStage(other.pages_.stage()); }

  // Scratch for one decoding thread.
  struct Scratch {
    AlignedBuffer stored;
    std::vector<std::byte> payload;
  };
  // Reads, checks and decodes a page into `nodes` or `surfels` (capacity of the header) and returns
  // how many it holds. Of a scene with lobes they go to `lobes`, of the same capacity, or empty: to
  // nobody. kCorruption names file, page, and what was wrong.
  Result<std::uint32_t> decodeNodes(std::uint32_t page, Scratch& scratch, std::span<Node> nodes,
                                    std::span<NodeLobes> lobes = {}) const;
  Result<std::uint32_t> decodeSurfels(std::uint32_t page, Scratch& scratch,
                                      std::span<Surfel> surfels, std::span<Lobe> lobes = {}) const;
  // The groups of all surfels, as a set: those of the root, whose page is read. Group 0 alone in a
  // scene without groups, without reading. Errors as of decodeNodes.
  Result<std::uint64_t> readGroups() const;
  // Bytes that a decoded record takes in a cache, its lobes included.
  std::size_t nodeRecordBytes() const {
    return sizeof(Node) + (header_.has_lobes ? sizeof(NodeLobes) : 0);
  }
  std::size_t surfelRecordBytes() const {
    return sizeof(Surfel) + (header_.has_lobes ? sizeof(Lobe) : 0);
  }
  // Of the largest page of either kind, decoded.
  std::size_t nodePageCapacityBytes() const {
    return header_.node_group_capacity * nodeRecordBytes();
  }
  std::size_t surfelPageCapacityBytes() const {
    return header_.surfel_group_capacity * surfelRecordBytes();
  }
  // Stored bytes of a page.
  std::uint32_t nodePageBytes(std::uint32_t page) const;
  std::uint32_t surfelPageBytes(std::uint32_t page) const;

 private:
  PageFile pages_;
  SceneHeader header_;
};

}  // namespace surfeit
