#include "octree/build/scene_writer.h"

#include <utility>

#include "core/assert.h"
#include "core/thread_scratch.h"
#include "octree/page/scene_header.h"
#include "octree/page/surfel_marks.h"
#include "storage/page_codec.h"

namespace surfeit {

Result<std::unique_ptr<SceneWriter>> SceneWriter::create(const std::string& path,
                                                         const SceneHeader& header,
                                                         std::uint64_t identity) {
  SURFEIT_ASSIGN_OR_RETURN(PageFileWriter file,
                           PageFileWriter::create(path, identity, header.format_version));
  return std::unique_ptr<SceneWriter>(new SceneWriter(std::move(file), header));
}

GroupPlace SceneWriter::addSiblings(int level, std::span<const LevelNode> siblings) {
  SURFEIT_ASSERT(siblings.size() <= 8);
  Level& at = levels_[static_cast<std::size_t>(level)];
  if (at.open.size() + siblings.size() > header_.node_group_capacity) closePage(level);
  const GroupPlace place{at.full_pages, static_cast<std::uint16_t>(at.open.size())};
  at.open.insert(at.open.end(), siblings.begin(), siblings.end());
  header_.node_count += siblings.size();
  for (const LevelNode& node : siblings) {
    header_.has_layers |= (node.marks & kSurfelHiddenSides) != 0;
    header_.has_loose |= (node.marks & kSurfelLoose) != 0;
    header_.has_sharers |= (node.marks & kNodeShares) != 0;
    header_.has_tiles |= (node.marks & kNodeTiles) != 0;
  }
  return place;
}

void SceneWriter::closePage(int level) {
  Level& at = levels_[static_cast<std::size_t>(level)];
  full_.push_back({level, at.full_pages++, std::move(at.open)});
  at.open = {};
  at.open.reserve(header_.node_group_capacity);
}

std::vector<FullNodePage> SceneWriter::takeFullNodePages() { return std::exchange(full_, {}); }

std::vector<FullNodePage> SceneWriter::takeOpenNodePages() {
  for (int level = 0; level <= kCurveLevels; ++level) {
    if (!levels_[static_cast<std::size_t>(level)].open.empty()) closePage(level);
  }
  return takeFullNodePages();
}

Status SceneWriter::addSurfelPages(const EncodedPages& pages, std::size_t surfel_count) {
  Bytes bytes = pages.bytes;
  for (const EncodedPages::Page& page : pages.pages) {
    SURFEIT_RETURN_IF_ERROR(
        file_.addSurfelPage(bytes.first(page.stored_bytes), page.payload_bytes));
    bytes = bytes.subspan(page.stored_bytes);
  }
  header_.surfel_count += surfel_count;
  return {};
}

Status SceneWriter::addNodePage(int level, Bytes stored, std::uint32_t payload_bytes) {
  return file_.addNodePage(stored, payload_bytes, static_cast<std::size_t>(level));
}

std::uint64_t SceneWriter::nodePages() const {
  std::uint64_t pages = 0;
  for (std::size_t level = 0; level <= kCurveLevels; ++level) pages += file_.nodePageCount(level);
  return pages;
}

void SceneWriter::completeHeader() {
  std::uint32_t next_page = 0;
  for (std::size_t level = 0; level <= kCurveLevels; ++level) {
    SURFEIT_CHECK(levels_[level].open.empty());
    header_.level_first_page[level] = next_page;
    next_page += static_cast<std::uint32_t>(file_.nodePageCount(level));
  }
  header_.level_first_page[kCurveLevels + 1] = next_page;
}

Status SceneWriter::finish(const std::string& provenance) {
  completeHeader();
  return file_.finish(encodeSceneHeader(header_), provenance);
}

Result<SceneFile> SceneWriter::finishUnnamed(const std::string& provenance) {
  completeHeader();
  SURFEIT_ASSIGN_OR_RETURN(PageFile pages,
                           file_.finishUnnamed(encodeSceneHeader(header_), provenance));
  return SceneFile::open(std::move(pages));
}

Status encodeNodePage(const FullNodePage& page, const PageForm& form, EncodedPages& encoded) {
  std::vector<std::byte>& payload = threadScratch<std::vector<std::byte>>([] {});
  std::vector<std::byte>& stored = threadScratch<std::vector<std::byte>>([] {});
  const std::size_t packed_bytes = encodeNodeGroup(page.nodes, form, payload);
  SURFEIT_RETURN_IF_ERROR(compressPage(payload, packed_bytes, stored));
  encoded.add(stored, payload.size());
  return {};
}

}  // namespace surfeit
