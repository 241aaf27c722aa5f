// Writes a scene again with other radiosities: the same surfels in the same order, the same pages,
// nodes and references, of which every byte is kept; radiosities of surfels and nodes and the power
// coefficients are new. Lobes are those of the source; those of the scene are left out. Without
// lobes the file is of the format version that the scene is of. Surfel pages are streamed once, in
// order; nothing is sorted.
//
//   decode, replace, encode ----> sweep --------------> encode -------> write
//   surfel pages (any thread)     nodes (in order)      node pages      (in order)
#pragma once

#include <algorithm>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "octree/node/lobe.h"
#include "octree/read/scene_file.h"
#include "storage/page_file.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

// Where new radiosities come from. Safe from any thread.
class RadiositySource {
 public:
  virtual ~RadiositySource() = default;
  // Those of all surfels of a surfel page, in their order; as many as the page has. Finite and >=
  // 0. Every page is asked for once.
  virtual Status read(std::uint32_t surfel_page, std::span<glm::vec3> radiosity) = 0;
  // The same, and as many lobes: asked for instead when hasLobes().
  virtual Status read(std::uint32_t surfel_page, std::span<glm::vec3> radiosity,
                      std::span<Lobe> lobes) {
    std::fill(lobes.begin(), lobes.end(), Lobe());
    return read(surfel_page, radiosity);
  }
  virtual bool hasLobes() const { return false; }
};

// Appends all pages of `scene` to `writer`, which must be of rewrittenVersion, with the
// threads of the current arena; `threads` of them bound what is on its way. Advances progress by
// surfels. Returns the mean radiosity, by area. Errors: those of source and files; kCorruption
// where the pages are not in the order of the tree, as every file of the indexer has them;
// kInterrupted.
Result<glm::dvec3> rewriteRadiosity(const SceneFile& scene, RadiositySource& source,
                                    PageFileWriter& writer, int threads, Progress& progress);

// The scene fields and the format version of the file that `rewriteRadiosity` makes of a scene.
std::vector<std::byte> rewrittenSceneFields(const SceneFile& scene, bool has_lobes = false);
std::uint32_t rewrittenVersion(const SceneFile& scene, bool has_lobes = false);

// Memory that rewriteRadiosity takes at most, beside scene, source and writer.
std::uint64_t rewriteRadiosityBytes(const SceneFile& scene, int threads, bool has_lobes = false);

}  // namespace surfeit
