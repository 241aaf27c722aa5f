#include "view/cloud_record.h"

#include <fmt/format.h>

#include <cmath>
#include <glm/geometric.hpp>

namespace surfeit {
namespace {

// Shorter normals point nowhere: the record is drawn as a sphere.
constexpr double kShortNormal = 1e-6;

// Beyond this, squares of lengths are no floats any more.
constexpr double kMaxLength = 1e18;

// False for infinities and NaN too.
bool isInReach(double value) { return std::abs(value) <= kMaxLength; }

}  // namespace

Result<RecordDecoder> RecordDecoder::create(const RowLayout& element, const std::string& path) {
  constexpr const char* kPosition[3] = {"x", "y", "z"};
  constexpr const char* kNormal[3] = {"nx", "ny", "nz"};
  RecordDecoder decoder;
  for (std::size_t i = 0; i < 3; ++i) {
    decoder.position_[i] = RowField::find(element, kPosition[i]);
    decoder.normal_[i] = RowField::find(element, kNormal[i]);
    if (!decoder.position_[i].exists()) {
      return Status::corruption(fmt::format("{}: element \"{}\" has no property \"{}\"", path,
                                            element.name, kPosition[i]));
    }
  }
  if (!decoder.normal_[1].exists() || !decoder.normal_[2].exists()) decoder.normal_[0] = {};

  for (const char* name : {"radius", "pscale", "width"}) {
    if (decoder.radius_.exists()) break;
    decoder.radius_ = RowField::find(element, name);
    decoder.radius_scale_ = std::string_view(name) == "width" ? 0.5 : 1;
  }
  decoder.area_ = RowField::find(element, "area");
  return decoder;
}

bool RecordDecoder::decode(const std::byte* row, CloudRecord& record) const {
  record.position = {position_[0].read(row), position_[1].read(row), position_[2].read(row)};
  bool can_draw =
      isInReach(record.position.x) && isInReach(record.position.y) && isInReach(record.position.z);

  record.normal = glm::vec3(0);
  if (hasNormal()) {
    const glm::dvec3 normal(normal_[0].read(row), normal_[1].read(row), normal_[2].read(row));
    const double length = glm::length(normal);
    can_draw = can_draw && std::isfinite(length);
    if (length > kShortNormal) record.normal = glm::vec3(normal / length);
  }

  record.radius = 0;
  if (hasRadius()) {
    record.radius = float(radius_scale_ * radius_.read(row));
    can_draw = can_draw && isInReach(double(record.radius)) && record.radius > 0;
  }
  const double area = area_.exists() ? area_.read(row) : 0;
  record.area = area > 0 && isInReach(area) ? float(area) : 0;
  return can_draw;
}

}  // namespace surfeit
