// The scene fields of a .sft header: what is written and what is believed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include "core/bounds.h"
#include "core/curve_key.h"
#include "octree/page/page_form.h"
#include "storage/file.h"
#include "surfeit/status.h"
#include "surfeit/surfel.h"
#include "surfeit/up_axis.h"
#include "surfeit/version.h"

namespace surfeit {

// The version that a scene of these channels is written in: the oldest that has them.
constexpr std::uint32_t formatVersionFor(const CloudChannels& channels) {
  return channels.opacity ? 3 : 2;
}

// That of a scene with lobes.
inline constexpr std::uint32_t kLobesFormatVersion = 4;

// What the header says about the scene.
struct SceneHeader {
  std::uint32_t format_version = formatVersionFor({});  // in the header of the container
  std::uint64_t surfel_count = 0;
  std::uint64_t node_count = 0;
  std::uint32_t leaf_capacity = 0;          // surfels per leaf, unless more share one curve cell
  std::uint32_t node_group_capacity = 0;    // most nodes on a page
  std::uint32_t surfel_group_capacity = 0;  // most surfels on a page
  float flatness_limit = 0;                 // nodes flatter than this carry kNodeFlat
  // In the cloud's own coordinates: what positions in this file are counted from, bounds and cube
  // among them. Finite.
  glm::dvec3 origin{0};
  Bounds3 bounds;  // of the surfel positions
  RootCube cube;   // the root cell of octree and curve
  UpAxis up = kDefaultUpAxis;
  CloudChannels channels;       // what the input had, as opposed to filled in by rules
  bool full_precision = false;  // pages hold floats instead of quantized values
  bool has_lobes = false;       // surfels and nodes have lobes (octree/node/lobe.h)
  bool has_layers = false;      // some have hidden sides (octree/node/hidden_layers.h)
  bool has_loose = false;       // some are kSurfelLoose
  // Covariances take surfels with a long side for rectangles, not for disks. Set by SceneWriter.
  bool has_rectangles = false;
  bool has_sharers = false;  // some surfels share their piece of surface (core/long_side.h)
  bool has_tiles = false;    // of some disks neighbours tell how much they hide (the same)
  // Nodes have radiosity_variance: those of programs that know of it, where there are radiosities.
  bool has_variances = false;
  bool has_slopes = false;  // the same of slopes
  // First node page of each level 0..21, and the number of node pages at index 22.
  std::uint32_t level_first_page[kCurveLevels + 2] = {};

  PageForm pageForm() const {
    return {full_precision,     channels.albedo,     channels.group,
            channels.long_side, format_version >= 2, channels.opacity,
            has_lobes,          channels.tint,       has_variances,
            has_slopes};
  }
};

// The fields as docs/format.md, "Scene fields", lays them out.
std::vector<std::byte> encodeSceneHeader(const SceneHeader& header);

// Checks every field against what is possible and against the file's page counts. kCorruption
// names the field, but not the file.
Result<SceneHeader> decodeSceneHeader(Bytes fields, std::uint32_t node_page_count,
                                      std::uint32_t surfel_page_count);

}  // namespace surfeit
