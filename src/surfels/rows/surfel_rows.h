// Surfels as rows of a cloud, under the names that surfels/rows/surfel_mapping.h reads.
#pragma once

#include <cstddef>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "cloud/rows/row_layout.h"
#include "surfeit/surfel.h"

namespace surfeit {

// Immutable; safe from any thread.
class SurfelRows {
 public:
  // `channels` says which optional properties a row has: floats, but for two_sided and group, which
  // are uchar. Surfels are counted from `origin`, rows from 0: positions are doubles unless it is
  // 0.
  explicit SurfelRows(const CloudChannels& channels, const glm::dvec3& origin = glm::dvec3(0));

  const std::vector<RowProperty>& properties() const { return properties_; }
  std::size_t rowBytes() const { return row_bytes_; }

  // Packs surfels.size() rows at `rows`.
  void pack(std::span<const Surfel> surfels, std::byte* rows) const;

 private:
  void add(const char* name, ValueType type);

  CloudChannels channels_;
  glm::dvec3 origin_;
  std::vector<RowProperty> properties_;
  std::size_t row_bytes_ = 0;
};

}  // namespace surfeit
