// The second half of indexing a cloud that lacks sizes or normals: they are found by neighbour
// searches in an octree over the bare positions, and its curve order is the input of the real
// build.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "index/steps/phase_clock.h"
#include "octree/build/sorted_surfels.h"
#include "octree/neighbours/normal_rule.h"
#include "octree/read/paged_octree.h"
#include "octree/read/scene_file.h"
#include "surfeit/index.h"
#include "surfeit/progress.h"

namespace surfeit {

struct NeighbourBuild {
  float disk_overlap = 2;
  int threads = 1;
  std::uint64_t memory_bytes = 0;  // beside what building takes
  std::string temporary_directory;
  UpAxis up = kDefaultUpAxis;
  std::optional<NormalRule> normals;  // absent: none are asked for
  bool keeps_places = false;          // SizedSurfelStream::keepPlaces

  // Builds a scene without a name at full precision, or the real one, from a stream.
  std::function<Result<SceneFile>(SortedSurfelStream&, const char* phase)> build_unnamed;
  std::function<Status(SortedSurfelStream&)> build;
};

// The least memory_bytes for so many threads, but for what grows with the scene.
std::uint64_t leastNeighbourBytes(const std::optional<NormalEstimation>& normals, int threads);

// Reads what searches look up, with the caches that memory_bytes leave room for `beside` them.
Result<std::unique_ptr<PagedOctree>> openNeighbours(SceneFile scene, std::uint64_t memory_bytes,
                                                    int threads, std::uint64_t beside);

Status buildFromNeighbours(SceneFile places, const NeighbourBuild& how, IndexStats& stats,
                           PhaseClock& clock, Progress& progress);

// The last part of it: `scene` has normals that point to either side.
Status buildOriented(SceneFile scene, const NeighbourBuild& how, IndexStats& stats,
                     PhaseClock& clock, Progress& progress);

}  // namespace surfeit
