// Writes a .sft file from the groups that the builder finishes: surfel groups in curve order at
// once, node groups by level through a temporary file, because the node section follows the levels.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/curve_key.h"
#include "io/file.h"
#include "io/page_file.h"
#include "octree/node_group.h"
#include "octree/scene_file.h"
#include "octree/surfel_group.h"
#include "surfeit/status.h"

namespace surfeit {

// Groups by default. Node frames of 26 KiB and surfel frames of 32 KiB are what one device read
// costs anyway.
inline constexpr std::uint32_t kDefaultNodeGroup = 128;
inline constexpr std::uint32_t kDefaultSurfelGroup = 512;
// Nodes flatter than this are drawn as one disk: at .97 both kinds of error are equally small.
inline constexpr float kDefaultFlatnessLimit = 0.97f;

// Where a record went: a page, counted within its section (surfels) or level (nodes), and the
// place on it.
struct GroupPlace {
  std::uint32_t page = 0;
  std::uint16_t first = 0;
};

// One thread at a time.
class SceneWriter {
 public:
  // `header` says how to write; its counts and level table are filled in on the way.
  static Result<std::unique_ptr<SceneWriter>> create(const std::string& path,
                                                     const SceneHeader& header,
                                                     std::uint64_t identity,
                                                     const std::string& temporary_directory);

  const SceneHeader& header() const { return header_; }

  // Room for a leaf of `count` surfels: it begins a new page unless it fits the open one whole.
  Result<GroupPlace> beginLeaf(std::uint64_t count_at_least);
  // The next surfels of the leaf; a leaf larger than a page fills as many as it needs.
  Status addSurfel(const Surfel& surfel);

  // Siblings of a level, side by side on one page.
  Result<GroupPlace> addSiblings(int level, std::span<const LevelNode> siblings);

  // Writes node section, directory and header; the file appears.
  Status finish(const std::string& provenance);

  std::uint32_t nodePages() const;
  std::uint32_t surfelPages() const { return surfel_pages_; }
  std::uint64_t fileBytes() const { return file_.fileBytes(); }
  std::uint64_t temporaryBytes() const { return node_file_.size(); }

 private:
  // An encoded node page in the temporary file.
  struct SpilledPage {
    std::uint64_t offset = 0;
    std::uint32_t stored_bytes = 0, payload_bytes = 0;
  };
  struct Level {
    std::vector<LevelNode> open;  // the group being filled
    std::vector<SpilledPage> pages;
  };

  SceneWriter(PageFileWriter file, TemporaryFile node_file, const SceneHeader& header)
      : file_(std::move(file)), node_file_(std::move(node_file)), header_(header) {}
  Status flushSurfels();
  Status flushNodes(Level& level);

  PageFileWriter file_;
  TemporaryFile node_file_;
  SceneHeader header_;
  std::vector<Surfel> open_surfels_;
  std::uint32_t surfel_pages_ = 0;
  std::array<Level, kCurveLevels + 1> levels_;
  std::vector<std::byte> payload_, stored_;
};

}  // namespace surfeit
