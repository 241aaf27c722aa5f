// Writes a .sft file from encoded pages: surfel pages in curve order, and among them node pages of
// every level as they fill, so that nothing waits and nothing is written twice. The directory
// numbers node pages by level.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/curve_key.h"
#include "octree/build/cell_sweep.h"
#include "octree/page/encoded_pages.h"
#include "octree/page/page_form.h"
#include "octree/page/page_limits.h"
#include "octree/read/scene_file.h"
#include "storage/page_file.h"
#include "surfeit/status.h"

namespace surfeit {

// Nodes flatter than this are drawn as one disk: at .97 both kinds of error are equally small.
inline constexpr float kDefaultFlatnessLimit = 0.97f;

// A node page that is full, to be encoded: number `number` of its level.
struct FullNodePage {
  int level = 0;
  std::uint32_t number = 0;
  std::vector<LevelNode> nodes;
};

// Siblings by one thread and pages by another; otherwise one thread at a time.
class SceneWriter : public SiblingSink {
 public:
  // `header` says how to write; its counts and level table are filled in on the way.
  static Result<std::unique_ptr<SceneWriter>> create(const std::string& path,
                                                     const SceneHeader& header,
                                                     std::uint64_t identity);

  const SceneHeader& header() const { return header_; }

  // Siblings of a level, side by side on one page. Pages that become full wait to be taken.
  GroupPlace addSiblings(int level, std::span<const LevelNode> siblings) override;
  std::vector<FullNodePage> takeFullNodePages();
  // All that is left, after the last siblings.
  std::vector<FullNodePage> takeOpenNodePages();

  // Encoded pages, in any order of kinds; node pages of a level in the order of their numbers.
  Status addSurfelPages(const EncodedPages& pages, std::size_t surfel_count);
  Status addNodePage(int level, Bytes stored, std::uint32_t payload_bytes);

  // Writes directory and header; the file appears.
  Status finish(const std::string& provenance);
  // The same without a name: it goes when it is closed.
  Result<SceneFile> finishUnnamed(const std::string& provenance);

  std::uint64_t nodePages() const;
  std::uint64_t surfelPages() const { return file_.surfelPageCount(); }
  std::uint64_t fileBytes() const { return file_.fileBytes(); }

 private:
  struct Level {
    std::vector<LevelNode> open;   // the group being filled
    std::uint32_t full_pages = 0;  // before it
  };

  SceneWriter(PageFileWriter file, const SceneHeader& header)
      : file_(std::move(file)), header_(header) {
    header_.has_rectangles = header.channels.long_side;
  }
  void closePage(int level);
  void completeHeader();

  PageFileWriter file_;
  SceneHeader header_;
  std::array<Level, kCurveLevels + 1> levels_;
  std::vector<FullNodePage> full_;
};

// Encodes a node page with its last references known. Safe from any thread.
Status encodeNodePage(const FullNodePage& page, const PageForm& form, EncodedPages& encoded);

}  // namespace surfeit
