#include "octree/read/scene_info.h"

namespace surfeit {

Result<SceneInfo> sceneInfo(const SceneFile& file) {
  const SceneHeader& header = file.header();
  SceneInfo info;
  info.file_bytes = file.fileBytes();
  info.surfels = header.surfel_count;
  info.nodes = header.node_count;
  info.leaf_capacity = header.leaf_capacity;
  info.node_pages = file.nodePageCount();
  info.surfel_pages = file.surfelPageCount();
  for (std::uint32_t i = 0; i < info.node_pages; ++i) info.node_page_bytes += file.nodePageBytes(i);
  for (std::uint32_t i = 0; i < info.surfel_pages; ++i) {
    info.surfel_page_bytes += file.surfelPageBytes(i);
  }
  info.node_cache_bytes = std::uint64_t{info.node_pages} * file.nodePageCapacityBytes();
  info.surfel_cache_bytes = std::uint64_t{info.surfel_pages} * file.surfelPageCapacityBytes();
  const Bounds3d bounds = movedBounds(header.bounds, header.origin);
  info.min = bounds.min;
  info.max = bounds.max;
  info.origin = header.origin;
  const double* const corner = header.cube.origin;
  info.cube = {header.origin + glm::dvec3(corner[0], corner[1], corner[2]), header.cube.size};
  info.up = header.up;
  info.channels = header.channels;
  // Of surfels without an area, it is found with that
  info.channels.long_side = header.channels.long_side && header.channels.area;
  info.full_precision = header.full_precision;
  info.has_lobes = header.has_lobes;
  for (int level = 0; level <= kCurveLevels; ++level) {
    info.level_pages.push_back(header.level_first_page[level + 1] - header.level_first_page[level]);
  }
  info.provenance = file.provenance();
  SURFEIT_ASSIGN_OR_RETURN(info.groups, file.readGroups());
  return info;
}

Result<SceneInfo> readSceneInfo(const std::string& path) {
  SURFEIT_ASSIGN_OR_RETURN(const SceneFile file, SceneFile::open(path));
  return sceneInfo(file);
}

}  // namespace surfeit
