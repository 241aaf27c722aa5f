#include "random/indexed_scene.h"

#include <fmt/format.h>
#include <stdlib.h>

#include <algorithm>
#include <filesystem>
#include <numeric>
#include <system_error>
#include <utility>

#include "core/curve_key.h"
#include "gather/packet/packet_gatherer.h"
#include "octree/read/scene_file.h"
#include "surfeit/index.h"
#include "surfels/rows/surfel_writer.h"

namespace surfeit {
namespace {

// In memory where the system has such a directory: files are synced, which takes time elsewhere.
std::filesystem::path fastDirectory() {
  std::error_code error;
  const std::filesystem::path shared = "/dev/shm";
  if (std::filesystem::is_directory(shared, error)) return shared;
  return std::filesystem::temp_directory_path();
}

class ScratchDirectory {
 public:
  ScratchDirectory() {
    std::string name = (fastDirectory() / "surfeit_random_XXXXXX").string();
    if (mkdtemp(name.data()) != nullptr) path_ = name;
  }
  ScratchDirectory(const ScratchDirectory&) = delete;
  ScratchDirectory& operator=(const ScratchDirectory&) = delete;
  ~ScratchDirectory() {
    std::error_code ignored;
    if (!path_.empty()) std::filesystem::remove_all(path_, ignored);
  }
  bool ok() const { return !path_.empty(); }
  std::string file(const std::string& name) const { return (path_ / name).string(); }

 private:
  std::filesystem::path path_;
};

Result<std::vector<std::string>> writeClouds(std::span<const Surfel> cloud, int files,
                                             const ScratchDirectory& directory) {
  std::vector<std::string> paths;
  const std::size_t count = std::size_t(std::max(files, 1));
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t begin = cloud.size() * i / count, end = cloud.size() * (i + 1) / count;
    if (begin == end) continue;
    paths.push_back(directory.file(fmt::format("cloud{}.ply", i)));
    SURFEIT_ASSIGN_OR_RETURN(SurfelWriter writer,
                             SurfelWriter::create(paths.back(), channelsOf(cloud)));
    SURFEIT_RETURN_IF_ERROR(writer.write(cloud.subspan(begin, end - begin)));
    SURFEIT_RETURN_IF_ERROR(writer.finish());
  }
  return paths;
}

Status indexCloud(std::span<const Surfel> cloud, const IndexedSceneOptions& options,
                  const ScratchDirectory& directory, const std::string& path) {
  if (!directory.ok()) return Status::ioError("no directory for temporary files");
  SURFEIT_ASSIGN_OR_RETURN(const std::vector<std::string> paths,
                           writeClouds(cloud, options.files, directory));
  IndexOptions indexing;
  indexing.threads = options.threads;
  indexing.memory_bytes = options.memory_bytes;
  indexing.full_precision = options.full_precision;
  indexing.origin = glm::dvec3(0);  // receivers are given about it
  Progress progress;
  return indexClouds(paths, path, indexing, progress).status();
}

}  // namespace

CloudChannels channelsOf(std::span<const Surfel> cloud) {
  CloudChannels channels;
  channels.normal = channels.radiosity = channels.albedo = true;
  const auto has = [cloud](auto test) { return std::any_of(cloud.begin(), cloud.end(), test); };
  channels.area = has([](const Surfel& surfel) { return surfel.area > 0; });
  channels.radius = has([](const Surfel& surfel) { return surfel.radius > 0; });
  channels.two_sided = has([](const Surfel& surfel) { return surfel.isTwoSided(); });
  channels.group = has([](const Surfel& surfel) { return surfel.group != 0; });
  channels.long_side = has([](const Surfel& surfel) { return surfel.long_side != 0; });
  channels.tint = has([](const Surfel& surfel) { return surfel.isTinted(); });
  channels.opacity = channels.tint || has([](const auto& one) { return one.transparency != 0; });
  return channels;
}

Status indexTo(const std::string& path, std::span<const Surfel> cloud,
               const IndexedSceneOptions& options) {
  const ScratchDirectory directory;
  return indexCloud(cloud, options, directory, path);
}

Result<std::unique_ptr<IndexedScene>> IndexedScene::open(const std::string& path) {
  SURFEIT_ASSIGN_OR_RETURN(SceneFile file, SceneFile::open(path));
  SURFEIT_ASSIGN_OR_RETURN(
      const PagedOctree::Memory memory,
      PagedOctree::planMemory(file, PagedOctree::unlimitedCacheBytes(file), 1));
  SURFEIT_ASSIGN_OR_RETURN(std::unique_ptr<PagedOctree> octree,
                           PagedOctree::create(std::move(file), memory));
  return std::unique_ptr<IndexedScene>(new IndexedScene(std::move(octree)));
}

Result<std::unique_ptr<IndexedScene>> IndexedScene::make(std::span<const Surfel> cloud,
                                                         const IndexedSceneOptions& options) {
  const ScratchDirectory directory;
  const std::string path = directory.file("scene.sft");
  SURFEIT_RETURN_IF_ERROR(indexCloud(cloud, options, directory, path));
  return open(path);  // what is open stays readable
}

Result<std::unique_ptr<IndexedScene>> IndexedScene::makeBounced(std::span<const Surfel> cloud,
                                                                const IndexedSceneOptions& options,
                                                                const BounceOptions& bounce) {
  const ScratchDirectory directory;
  const std::string path = directory.file("scene.sft"), bounced = directory.file("bounced.sft");
  SURFEIT_RETURN_IF_ERROR(indexCloud(cloud, options, directory, path));
  Progress progress;
  SURFEIT_RETURN_IF_ERROR(bounceScene(path, bounced, bounce, progress).status());
  return open(bounced);
}

Result<std::vector<GatherResult>> IndexedScene::gatherAlone(
    std::span<const LocalReceiver> receivers, const GatherRules& rules) {
  PacketGatherer gatherer(rules);
  std::vector<GatherResult> results(receivers.size());
  for (std::size_t i = 0; i < receivers.size(); ++i) {
    SURFEIT_RETURN_IF_ERROR(
        gatherer.gather(receivers.subspan(i, 1), *reader_, std::span(results).subspan(i, 1)));
  }
  return results;
}

CurveKey IndexedScene::keyOf(const glm::vec3& position) const {
  return curveKey(position, octree_->file().header().cube);
}

Result<std::vector<GatherResult>> IndexedScene::gatherTogether(
    std::span<const LocalReceiver> receivers, const GatherRules& rules) {
  // Along the curve, equal keys in the order of the input
  std::vector<std::pair<CurveKey, std::size_t>> order;
  for (std::size_t i = 0; i < receivers.size(); ++i) {
    order.emplace_back(keyOf(receivers[i].position), i);
  }
  std::sort(order.begin(), order.end());
  std::vector<LocalReceiver> sorted;
  for (const auto& [key, index] : order) sorted.push_back(receivers[index]);

  PacketGatherer gatherer(rules);
  std::vector<GatherResult> found(sorted.size()), results(sorted.size());
  for (std::size_t begin = 0; begin < sorted.size(); begin += kClusterReceivers) {
    const std::size_t count = std::min(kClusterReceivers, sorted.size() - begin);
    SURFEIT_RETURN_IF_ERROR(gatherer.gather(std::span(sorted).subspan(begin, count), *reader_,
                                            std::span(found).subspan(begin, count)));
  }
  for (std::size_t i = 0; i < order.size(); ++i) results[order[i].second] = found[i];
  return results;
}

}  // namespace surfeit
