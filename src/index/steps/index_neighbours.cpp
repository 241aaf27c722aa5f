#include "index/steps/index_neighbours.h"

#include <algorithm>
#include <memory>
#include <utility>

#include "octree/neighbours/local_density.h"
#include "octree/neighbours/orientation.h"
#include "octree/read/paged_octree.h"
#include "storage/external_sorter.h"

namespace surfeit {
namespace {

// The scene with normals that point to either side, where these are asked for; else the real one is
// built, and there is none.
Result<std::optional<SceneFile>> buildFound(SceneFile places, const NeighbourBuild& how,
                                            IndexStats& stats, const Progress& progress) {
  SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<PagedOctree> octree,
                           openNeighbours(std::move(places), how.memory_bytes, how.threads,
                                          SizedSurfelStream::searcherBytes(how.threads)));
  SizedSurfelStream found(*octree, how.disk_overlap, how.normals, how.threads, progress);
  if (how.keeps_places) found.keepPlaces();
  SURFEIT_RETURN_IF_ERROR(found.prepare());
  std::optional<SceneFile> unoriented;
  if (how.normals && how.normals->needsSides()) {
    SURFEIT_ASSIGN_OR_RETURN(unoriented, how.build_unnamed(found, "normals"));
  } else {
    SURFEIT_RETURN_IF_ERROR(how.build(found));
  }
  stats.normals_found = found.normalsFound();
  stats.thin_surfels = found.thinSurfels();
  stats.scattered_surfels = found.scatteredSurfels();
  return unoriented;
}

}  // namespace

std::uint64_t leastNeighbourBytes(const std::optional<NormalEstimation>& normals, int threads) {
  constexpr std::uint64_t kCacheBytes = std::uint64_t{1} << 20;  // of a thread, for a few pages
  const std::uint64_t caches = std::uint64_t(threads) * kCacheBytes;
  const std::uint64_t sides = ExternalSorter::kLeastMemory + Sides::searcherBytes(threads);
  const bool needs_sides =
      normals && normals->orientation.toward == NormalOrientation::Toward::kConsistent;
  return caches + (needs_sides ? sides : SizedSurfelStream::searcherBytes(threads));
}

Result<std::unique_ptr<PagedOctree>> openNeighbours(SceneFile scene, std::uint64_t memory_bytes,
                                                    int threads, std::uint64_t beside) {
  // The directory of what is written is another one of the same size
  beside += scene.pages().memoryBytes() + PagedOctree::leafRunBytes(scene);
  const std::uint64_t cache_bytes = std::min<std::uint64_t>(
      memory_bytes - std::min(memory_bytes, beside), PagedOctree::unlimitedCacheBytes(scene));
  SURFEIT_ASSIGN_OR_RETURN(const PagedOctree::Memory memory,
                           PagedOctree::planMemory(scene, cache_bytes, threads));
  return PagedOctree::create(std::move(scene), memory);
}

Status buildOriented(SceneFile scene, const NeighbourBuild& how, IndexStats& stats,
                     PhaseClock& clock, Progress& progress) {
  const std::uint64_t sorter_bytes =
      std::max<std::uint64_t>(how.memory_bytes / 4, ExternalSorter::kLeastMemory);
  const std::uint64_t scene_bytes = scene.fileBytes();
  SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<PagedOctree> octree,
                           openNeighbours(std::move(scene), how.memory_bytes, how.threads,
                                          sorter_bytes + Sides::searcherBytes(how.threads)));
  SURFEIT_ASSIGN_OR_RETURN(
      Sides sides,
      Sides::find(*octree, {how.threads, sorter_bytes, how.temporary_directory, how.up}, progress));
  clock.finish("orient");
  stats.temporary_bytes = std::max(stats.temporary_bytes, scene_bytes + sides.temporaryBytes());
  OrientedSurfelStream oriented(octree->file(), sides);
  return how.build(oriented);
}

Status buildFromNeighbours(SceneFile places, const NeighbourBuild& how, IndexStats& stats,
                           PhaseClock& clock, Progress& progress) {
  SURFEIT_ASSIGN_OR_RETURN(std::optional<SceneFile> unoriented,
                           buildFound(std::move(places), how, stats, progress));
  if (!unoriented) return {};
  return buildOriented(std::move(*unoriented), how, stats, clock, progress);
}

}  // namespace surfeit
