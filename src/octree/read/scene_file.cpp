#include "octree/read/scene_file.h"

#include <fmt/format.h>

#include "octree/page/node_group.h"
#include "octree/page/scene_header.h"
#include "octree/page/surfel_group.h"

namespace surfeit {

Result<SceneFile> SceneFile::open(const std::string& path, Access access) {
  SURFEIT_ASSIGN_OR_RETURN(PageFile pages, PageFile::open(path, access));
  return open(std::move(pages));
}

Result<SceneFile> SceneFile::open(PageFile pages) {
  SceneFile scene;
  scene.pages_ = std::move(pages);
  Result<SceneHeader> header =
      decodeSceneHeader(scene.pages_.sceneFields(), scene.nodePageCount(), scene.surfelPageCount());
  if (!header.ok()) {
    return Status(header.status().code(),
                  fmt::format("{}: {}", scene.path(), header.status().message()));
  }
  scene.header_ = *header;
  scene.header_.format_version = scene.pages_.formatVersion();
  const bool is_of_2 = scene.header_.origin != glm::dvec3(0) || scene.header_.up != kDefaultUpAxis;
  if (scene.header_.format_version < 2 && is_of_2) {
    return Status::corruption(
        fmt::format("{}: header: reserved space is not zero, expected zero", scene.path()));
  }
  if (scene.header_.format_version < 3 && scene.header_.channels.opacity) {
    return Status::corruption(fmt::format("{}: header: opacity in version {}, expected 3 or more",
                                          scene.path(), scene.header_.format_version));
  }
  if (scene.header_.format_version < kLobesFormatVersion && scene.header_.has_lobes) {
    return Status::corruption(fmt::format("{}: header: lobes in version {}, expected {} or more",
                                          scene.path(), scene.header_.format_version,
                                          kLobesFormatVersion));
  }
  return scene;
}

const std::string& SceneFile::path() const { return pages_.path(); }
std::uint64_t SceneFile::fileBytes() const { return pages_.fileBytes(); }
const SceneHeader& SceneFile::header() const { return header_; }
const std::string& SceneFile::provenance() const { return pages_.provenance(); }
const PageFile& SceneFile::pages() const { return pages_; }
void SceneFile::stage(const PageStage::Options& options) {
  if (options.directory.empty()) return;
  pages_.setStage(std::make_shared<PageStage>(
      options,
      PageStage::Scene{pages_.identity(), pages_.directoryChecksum(), pages_.fileBytes()}));
}
std::uint32_t SceneFile::nodePageCount() const { return pages_.nodePageCount(); }
std::uint32_t SceneFile::surfelPageCount() const {
  return pages_.pageCount() - pages_.nodePageCount();
}
std::uint32_t SceneFile::nodePageBytes(std::uint32_t page) const {
  return pages_.entry(page).stored_bytes;
}
std::uint32_t SceneFile::surfelPageBytes(std::uint32_t page) const {
  return pages_.entry(nodePageCount() + page).stored_bytes;
}

Result<std::uint32_t> SceneFile::decodeNodes(std::uint32_t page, Scratch& scratch,
                                             std::span<Node> nodes,
                                             std::span<NodeLobes> lobes) const {
  SURFEIT_RETURN_IF_ERROR(pages_.readPage(page, scratch.stored, scratch.payload));
  const NodeLimits limits{header_.level_first_page, surfelPageCount(), header_.node_group_capacity,
                          header_.surfel_group_capacity};
  Result<std::uint32_t> count = decodeNodeGroup(scratch.payload, header_.pageForm(), page, limits,
                                                nodes.first(header_.node_group_capacity), lobes);
  if (!count.ok()) return pages_.pageError(page, count.status().message());
  return count;
}

Result<std::uint32_t> SceneFile::decodeSurfels(std::uint32_t page, Scratch& scratch,
                                               std::span<Surfel> surfels,
                                               std::span<Lobe> lobes) const {
  const std::uint32_t file_page = nodePageCount() + page;
  SURFEIT_RETURN_IF_ERROR(pages_.readPage(file_page, scratch.stored, scratch.payload));
  Result<std::uint32_t> count = decodeSurfelGroup(
      scratch.payload, header_.pageForm(), surfels.first(header_.surfel_group_capacity), lobes);
  if (!count.ok()) return pages_.pageError(file_page, count.status().message());
  return count;
}

Result<std::uint64_t> SceneFile::readGroups() const {
  if (!header_.channels.group) return groupBit(0);
  Scratch scratch;
  std::vector<Node> nodes(header_.node_group_capacity);
  SURFEIT_RETURN_IF_ERROR(decodeNodes(kRootRange.page, scratch, nodes).status());
  return nodes[kRootRange.first].groups;
}

}  // namespace surfeit
