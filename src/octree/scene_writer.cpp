#include "octree/scene_writer.h"

#include "core/assert.h"
#include "io/page_codec.h"
#include "octree/scene_header.h"

namespace surfeit {

Result<std::unique_ptr<SceneWriter>> SceneWriter::create(const std::string& path,
                                                         const SceneHeader& header,
                                                         std::uint64_t identity,
                                                         const std::string& temporary_directory) {
  SURFEIT_ASSIGN_OR_RETURN(PageFileWriter file, PageFileWriter::create(path, identity));
  SURFEIT_ASSIGN_OR_RETURN(TemporaryFile node_file, TemporaryFile::create(temporary_directory));
  return std::unique_ptr<SceneWriter>(
      new SceneWriter(std::move(file), std::move(node_file), header));
}

Result<GroupPlace> SceneWriter::beginLeaf(std::uint64_t count_at_least) {
  if (open_surfels_.size() + count_at_least > header_.surfel_group_capacity) {
    SURFEIT_RETURN_IF_ERROR(flushSurfels());
  }
  return GroupPlace{surfel_pages_, static_cast<std::uint16_t>(open_surfels_.size())};
}

Status SceneWriter::addSurfel(const Surfel& surfel) {
  if (open_surfels_.size() == header_.surfel_group_capacity) {
    SURFEIT_RETURN_IF_ERROR(flushSurfels());
  }
  open_surfels_.push_back(surfel);
  ++header_.surfel_count;
  return {};
}

Status SceneWriter::flushSurfels() {
  if (open_surfels_.empty()) return {};
  encodeSurfelGroup(open_surfels_, {header_.full_precision, header_.channels.albedo}, payload_);
  SURFEIT_RETURN_IF_ERROR(compressPage(payload_, stored_));
  SURFEIT_RETURN_IF_ERROR(
      file_.addSurfelPage(stored_, static_cast<std::uint32_t>(payload_.size())));
  open_surfels_.clear();
  ++surfel_pages_;
  return {};
}

Result<GroupPlace> SceneWriter::addSiblings(int level, std::span<const LevelNode> siblings) {
  SURFEIT_ASSERT(siblings.size() <= 8);
  Level& at = levels_[static_cast<std::size_t>(level)];
  if (at.open.size() + siblings.size() > header_.node_group_capacity) {
    SURFEIT_RETURN_IF_ERROR(flushNodes(at));
  }
  const GroupPlace place{static_cast<std::uint32_t>(at.pages.size()),
                         static_cast<std::uint16_t>(at.open.size())};
  at.open.insert(at.open.end(), siblings.begin(), siblings.end());
  header_.node_count += siblings.size();
  return place;
}

Status SceneWriter::flushNodes(Level& level) {
  if (level.open.empty()) return {};
  encodeNodeGroup(level.open, header_.full_precision, payload_);
  SURFEIT_RETURN_IF_ERROR(compressPage(payload_, stored_));
  level.pages.push_back({node_file_.size(), static_cast<std::uint32_t>(stored_.size()),
                         static_cast<std::uint32_t>(payload_.size())});
  level.open.clear();
  return node_file_.append(stored_);
}

std::uint32_t SceneWriter::nodePages() const { return header_.level_first_page[kCurveLevels + 1]; }

Status SceneWriter::finish(const std::string& provenance) {
  SURFEIT_RETURN_IF_ERROR(flushSurfels());
  // Node section: level by level
  std::uint32_t next_page = 0;
  for (std::size_t i = 0; i < levels_.size(); ++i) {
    header_.level_first_page[i] = next_page;
    SURFEIT_RETURN_IF_ERROR(flushNodes(levels_[i]));
    for (const SpilledPage& page : levels_[i].pages) {
      stored_.resize(page.stored_bytes);
      SURFEIT_RETURN_IF_ERROR(node_file_.readAt(page.offset, stored_));
      SURFEIT_RETURN_IF_ERROR(file_.addNodePage(stored_, page.payload_bytes));
    }
    next_page += static_cast<std::uint32_t>(levels_[i].pages.size());
  }
  header_.level_first_page[kCurveLevels + 1] = next_page;
  return file_.finish(encodeSceneHeader(header_), provenance);
}

}  // namespace surfeit
