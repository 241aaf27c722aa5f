// Where the rows of receivers are looked up: at their position or a reference position, in the
// space of the map.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>
#include <string>
#include <vector>

#include "cloud/rows/row_layout.h"
#include "surfeit/lookup.h"
#include "surfeit/status.h"
#include "surfels/rows/surfel_mapping.h"

namespace surfeit {

// An affine map of places.
struct SpaceMap {
  glm::dmat3 linear{1};
  glm::dvec3 translation{0};

  static SpaceMap of(const LookupMatrix& matrix);
  glm::dvec3 at(const glm::dvec3& place) const { return linear * place + translation; }
  // The map that does `first`, then this one.
  SpaceMap after(const SpaceMap& first) const;
  SpaceMap inverse() const;
  LookupMatrix matrix() const;
};

// kInvalidArgument for a matrix with a number that is not finite, or without an inverse; `name` is
// the option's.
Status checkSpace(const LookupMatrix& matrix, const char* name);

// Immutable; safe from any thread.
class LookupReceivers {
 public:
  // kCorruption where rows have no positions, kInvalidArgument where they lack reference ones.
  static Result<LookupReceivers> create(const RowLayout& element, const std::string& path,
                                        const LookupOptions& options);

  struct Place {
    glm::dvec3 position{0};
    glm::vec3 normal{0};  // unit; zero: none
  };
  // In the space of the map. False, and the defect counted under `record`, for an invalid receiver.
  bool decode(const std::byte* row, std::uint64_t record, Place& place,
              SurfelDefects& defects) const;
  bool hasNormals() const { return surfels_.channels().normal; }
  std::string describeDefect(const std::byte* row) const { return surfels_.describeDefect(row); }

  // From the space of the receivers to that of the map.
  const SpaceMap& toMap() const { return to_map_; }

 private:
  LookupReceivers(SurfelMapping surfels, const SpaceMap& to_map);

  SurfelMapping surfels_;  // made from an element that has nothing but position and normal
  SpaceMap to_map_;
  glm::dmat3 normal_to_map_{1};
};

}  // namespace surfeit
