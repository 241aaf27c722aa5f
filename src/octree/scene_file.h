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
#include "io/page_file.h"
#include "octree/node.h"
#include "octree/page_form.h"
#include "surfeit/status.h"
#include "surfeit/surfel.h"
#include "surfeit/up_axis.h"
#include "surfeit/version.h"

namespace surfeit {

// What the header says about the scene.
struct SceneHeader {
  std::uint32_t format_version = kFormatVersion;  // in the header of the container
  std::uint64_t surfel_count = 0;
  std::uint64_t node_count = 0;
  std::uint32_t leaf_capacity = 0;          // surfels per leaf, unless more share one curve cell
  std::uint32_t node_group_capacity = 0;    // most nodes on a page
  std::uint32_t surfel_group_capacity = 0;  // most surfels on a page
  float flatness_limit = 0;                 // nodes flatter than this carry kNodeFlat
  // In the cloud's own coordinates: what positions in this file are counted from, bounds and cube
  // among them. Finite.
  glm::dvec3 origin{0};
  Bounds3 bounds;  // of the surfel positions
  RootCube cube;   // the root cell of octree and curve
  UpAxis up = kDefaultUpAxis;
  CloudChannels channels;       // what the input had, as opposed to filled in by rules
  bool full_precision = false;  // pages hold floats instead of quantized values
  // First node page of each level 0..21, and the number of node pages at index 22.
  std::uint32_t level_first_page[kCurveLevels + 2] = {};

  PageForm pageForm() const {
    return {full_precision, channels.albedo, channels.group, channels.long_side,
            format_version >= 2};
  }
};

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

  // Scratch for one decoding thread.
  struct Scratch {
    AlignedBuffer stored;
    std::vector<std::byte> payload;
  };
  // Reads, checks and decodes a page into `nodes` or `surfels` (capacity of the header) and returns
  // how many it holds. kCorruption names file, page, and what was wrong.
  Result<std::uint32_t> decodeNodes(std::uint32_t page, Scratch& scratch,
                                    std::span<Node> nodes) const;
  Result<std::uint32_t> decodeSurfels(std::uint32_t page, Scratch& scratch,
                                      std::span<Surfel> surfels) const;
  // The groups of all surfels, as a set: those of the root, whose page is read. Group 0 alone in a
  // scene without groups, without reading. Errors as of decodeNodes.
  Result<std::uint64_t> readGroups() const;
  // Stored bytes of a page.
  std::uint32_t nodePageBytes(std::uint32_t page) const;
  std::uint32_t surfelPageBytes(std::uint32_t page) const;

 private:
  PageFile pages_;
  SceneHeader header_;
};

}  // namespace surfeit
