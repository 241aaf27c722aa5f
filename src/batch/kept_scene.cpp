#include "surfeit/kept_scene.h"

#include <memory>

#include "batch/gather_cloud.h"
#include "batch/gather_scene.h"

namespace surfeit {

KeptScene::KeptScene() : state_(std::make_unique<State>()) {}
KeptScene::KeptScene(KeptScene&&) noexcept = default;
KeptScene& KeptScene::operator=(KeptScene&&) noexcept = default;
KeptScene::~KeptScene() = default;
void KeptScene::close() { state_->octree = nullptr; }
bool KeptScene::isOpen() const { return state_->octree != nullptr; }

Result<GatherStats> gatherCloud(const std::string& scene_path, const std::string& receivers_path,
                                const std::string& result_path, const GatherOptions& options,
                                Progress& progress, KeptScene& kept) {
  return gatherCloudIn(&kept.state(), scene_path, receivers_path, result_path, options, progress);
}

}  // namespace surfeit
