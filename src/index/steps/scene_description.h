// What a scene file says of itself beside its pages: header, identity and provenance.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <optional>
#include <string>

#include "index/steps/cloud_reader.h"
#include "index/steps/group_plan.h"
#include "octree/neighbours/normal_rule.h"
#include "octree/read/scene_file.h"
#include "surfeit/index.h"
#include "surfeit/up_axis.h"

namespace surfeit {

// What it follows from.
struct SceneDescription {
  const IndexOptions& options;
  const GroupNames& groups;
  const CloudTotals& totals;  // about the origin
  glm::dvec3 origin{0};
  UpAxis up = kDefaultUpAxis;
  const NormalRule* normals = nullptr;  // by which normals are found, if they are
  std::string crs{};                    // coordinate reference system; empty: not known

  // Without counts and levels.
  SceneHeader header(bool full_precision) const;
  // Two files of one identity hold the same surfels built the same way.
  std::uint64_t identity(bool full_precision) const;
  // Only what the surfels themselves do not say, and nothing that differs between equal runs: no
  // time, no paths, no order.
  std::string provenance() const;
};

}  // namespace surfeit
