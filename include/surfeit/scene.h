// Reads the description of a paged octree file, and verifies the file.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "surfeit/api.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"
#include "surfeit/surfel.h"
#include "surfeit/up_axis.h"

namespace surfeit {

// The root cube: what the octree and the curve of a scene divide. In the cloud's coordinates.
struct SceneCube {
  glm::dvec3 corner{0};  // the least coordinates: finite
  double size = 0;       // of an edge, above 0
};

struct SceneInfo {
  std::uint64_t file_bytes = 0;
  std::uint64_t surfels = 0;
  std::uint64_t nodes = 0;
  std::uint32_t leaf_capacity = 0;
  std::uint32_t node_pages = 0, surfel_pages = 0;
  std::uint64_t node_page_bytes = 0, surfel_page_bytes = 0;    // stored
  std::uint64_t node_cache_bytes = 0, surfel_cache_bytes = 0;  // all pages decoded
  // Bounds of the surfel positions, and the origin of positions in the file; all in the cloud's
  // coordinates.
  glm::dvec3 min{0}, max{0}, origin{0};
  SceneCube cube;
  UpAxis up = kDefaultUpAxis;
  CloudChannels channels;  // channels of the input
  bool full_precision = false;
  bool has_lobes = false;  // surfels send a part of their light in lobes (BounceOptions::glossy)
  std::vector<std::uint32_t> level_pages;  // node pages of levels 0..21
  std::string provenance;                  // JSON
  std::uint64_t groups = 0;  // object groups with surfels, as bits; without the channel group 0
};

// Reads header and directory; for a scene with object groups, the first page as well. Errors:
// kIoError, kCorruption.
SURFEIT_API Result<SceneInfo> readSceneInfo(const std::string& path);

// The groups of a set in rising order, runs of three or more as ranges, "0,2-5"; "none" for the
// empty set. And the set that such a list means: kInvalidArgument tells the part that is neither
// group nor range, or that names one beyond kMaxGroups - 1. Safe from any thread.
SURFEIT_API std::string describeGroups(std::uint64_t groups);
SURFEIT_API Result<std::uint64_t> parseGroups(std::string_view text);

struct VerifyReport {
  std::uint64_t pages_checked = 0;
  std::uint64_t bytes_checked = 0;
  std::vector<std::string> findings;  // one line each; at most 100 are kept
  std::uint64_t finding_count = 0;
};

// Reads every page and checks every checksum and the invariants of docs/format.md: references,
// counts, sums of areas, bounding spheres that contain their surfels. Damage is recorded in
// `findings`, and the check goes on with the next page. `memory_bytes`: the budget; 0: three
// quarters of the memory that the job may hold; more than some 100 MiB are never used. Errors:
// kIoError, kBudgetTooSmall, kInterrupted.
SURFEIT_API Result<VerifyReport> verifyScene(const std::string& path, int threads,
                                             Progress& progress, std::uint64_t memory_bytes = 0);

}  // namespace surfeit
