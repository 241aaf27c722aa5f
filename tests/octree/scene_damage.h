// Scenes whose pages are changed and whose checksums are valid all the same.
#pragma once

#include <cmath>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "octree/page/node_group.h"
#include "octree/page/surfel_group.h"
#include "octree/read/scene_file.h"
#include "storage/page_codec.h"
#include "storage/page_file.h"

namespace surfeit {

using PayloadEdit = std::function<void(std::uint32_t page, std::vector<std::byte>& payload)>;
using HeaderEdit = std::function<void(std::vector<std::byte>& scene_fields)>;

// Copies a page file with `edit` applied to every payload and `edit_header` to the scene fields.
inline Status rewriteScene(const std::string& from, const std::string& to, const PayloadEdit& edit,
                           const HeaderEdit& edit_header = {}) {
  SURFEIT_ASSIGN_OR_RETURN(const PageFile pages, PageFile::open(from));
  SURFEIT_ASSIGN_OR_RETURN(PageFileWriter writer,
                           PageFileWriter::create(to, pages.identity(), pages.formatVersion()));
  AlignedBuffer buffer;
  std::vector<std::byte> stored, payload;
  const auto copy = [&](std::uint32_t page) -> Status {
    SURFEIT_RETURN_IF_ERROR(pages.readPage(page, buffer, payload));
    if (edit) edit(page, payload);
    SURFEIT_RETURN_IF_ERROR(compressPage(payload, stored));
    const auto bytes = static_cast<std::uint32_t>(payload.size());
    return page < pages.nodePageCount() ? writer.addNodePage(stored, bytes)
                                        : writer.addSurfelPage(stored, bytes);
  };
  for (std::uint32_t page = pages.nodePageCount(); page < pages.pageCount(); ++page) {
    SURFEIT_RETURN_IF_ERROR(copy(page));
  }
  for (std::uint32_t page = 0; page < pages.nodePageCount(); ++page) {
    SURFEIT_RETURN_IF_ERROR(copy(page));
  }
  std::vector<std::byte> fields(pages.sceneFields().begin(), pages.sceneFields().end());
  if (edit_header) edit_header(fields);
  return writer.finish(fields, pages.provenance());
}

// A decoded node page as the writer had it, without losses when the scene is of full precision.
inline std::vector<LevelNode> levelNodes(const SceneHeader& header, std::span<const Node> nodes) {
  std::vector<LevelNode> level_nodes;
  for (const Node& node : nodes) {
    LevelNode level_node{.node = node, .normal_angle = std::acos(node.normal_cosine)};
    if (!node.isLeaf()) {
      while (header.level_first_page[level_node.child_level + 1] <= node.page) {
        ++level_node.child_level;
      }
      level_node.node.page -= header.level_first_page[level_node.child_level];
    }
    level_nodes.push_back(level_node);
  }
  return level_nodes;
}

// Copies a scene of full precision with the nodes or the surfels of one page changed. `page` counts
// within its section.
inline Status editNodes(const std::string& from, const std::string& to, std::uint32_t page,
                        const std::function<void(std::vector<LevelNode>&)>& edit) {
  SURFEIT_ASSIGN_OR_RETURN(const SceneFile file, SceneFile::open(from));
  std::vector<Node> nodes(file.header().node_group_capacity);
  SceneFile::Scratch scratch;
  SURFEIT_ASSIGN_OR_RETURN(const std::uint32_t count, file.decodeNodes(page, scratch, nodes));
  std::vector<LevelNode> edited = levelNodes(file.header(), std::span(nodes).first(count));
  edit(edited);
  return rewriteScene(from, to, [&](std::uint32_t at, std::vector<std::byte>& payload) {
    if (at == page) encodeNodeGroup(edited, file.header().pageForm(), payload);
  });
}

inline Status editSurfels(const std::string& from, const std::string& to, std::uint32_t page,
                          const std::function<void(std::vector<Surfel>&)>& edit) {
  SURFEIT_ASSIGN_OR_RETURN(const SceneFile file, SceneFile::open(from));
  std::vector<Surfel> surfels(file.header().surfel_group_capacity);
  SceneFile::Scratch scratch;
  SURFEIT_ASSIGN_OR_RETURN(const std::uint32_t count, file.decodeSurfels(page, scratch, surfels));
  surfels.resize(count);
  edit(surfels);
  return rewriteScene(from, to, [&](std::uint32_t at, std::vector<std::byte>& payload) {
    if (at != page + file.nodePageCount()) return;
    encodeSurfelGroup(surfels, file.header().pageForm(), payload);
  });
}

}  // namespace surfeit
