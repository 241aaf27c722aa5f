#include "octree/read/scene_light.h"

#include <fmt/format.h>

#include <glm/common.hpp>
#include <vector>

namespace surfeit {

Status noteDarkness(const SceneFile& scene, Progress& progress) {
  SceneFile::Scratch scratch;
  std::vector<Node> nodes(scene.header().node_group_capacity);
  SURFEIT_RETURN_IF_ERROR(scene.decodeNodes(kRootRange.page, scratch, nodes).status());
  const glm::vec3 radiosity = nodes[kRootRange.first].radiosity;
  if (radiosity.x > 0 || radiosity.y > 0 || radiosity.z > 0) return {};
  const CloudChannels& has = scene.header().channels;
  progress.note(fmt::format(
      "{}: no surfel sends light ({}), so what is gathered is black: index a cloud with "
      "radiosity_r "
      "radiosity_g radiosity_b or red green blue (--channels FROM=radiosity reads another "
      "channel), "
      "light it with `surfeit sample --light-...`, or add an environment",
      scene.path(),
      has.radiosity ? "their radiosity is 0" : "the cloud has neither radiosity nor colors"));
  return {};
}

}  // namespace surfeit
