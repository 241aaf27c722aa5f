// One row of a cloud as the renderer sees it: a disk or a sphere with a place and a size.
#pragma once

#include <array>
#include <cstddef>
#include <glm/vec3.hpp>
#include <string>

#include "cloud/rows/row_layout.h"
#include "surfeit/status.h"
#include "view/row_field.h"

namespace surfeit {

struct CloudRecord {
  glm::dvec3 position{0};
  glm::vec3 normal{0};  // unit; zero: a sphere
  float radius = 0;     // 0: the cloud has none
  float area = 0;       // of its piece of the surface; 0: the cloud has none
};

// Reads the geometry of a row: x y z, nx ny nz, area, and radius, pscale or width (twice the
// radius). Immutable; safe from any thread.
class RecordDecoder {
 public:
  // kCorruption when x, y or z is missing.
  static Result<RecordDecoder> create(const RowLayout& element, const std::string& path);

  bool hasNormal() const { return normal_[0].exists(); }
  bool hasRadius() const { return radius_.exists(); }

  // False when the row cannot be drawn: a value that is not finite (or a length above 1e18), a
  // radius that is not positive.
  bool decode(const std::byte* row, CloudRecord& record) const;

 private:
  std::array<RowField, 3> position_, normal_;
  RowField radius_, area_;
  double radius_scale_ = 1;
};

}  // namespace surfeit
