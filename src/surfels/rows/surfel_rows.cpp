#include "surfels/rows/surfel_rows.h"

#include <cstdint>
#include <cstring>
#include <utility>

#include "cloud/rows/surfel_names.h"
#include "core/long_side.h"

namespace surfeit {

SurfelRows::SurfelRows(const CloudChannels& channels, const glm::dvec3& origin)
    : channels_(channels), origin_(origin) {
  // The order here is the order in which pack() packs the values
  const auto addTriple = [&](const char* const(&names)[3], ValueType type) {
    for (const char* name : names) add(name, type);
  };
  addTriple(kPositionNames, origin == glm::dvec3(0) ? ValueType::kFloat32 : ValueType::kFloat64);
  if (channels.normal) addTriple(kNormalNames, ValueType::kFloat32);
  if (channels.radius) add("radius", ValueType::kFloat32);
  if (channels.area) add("area", ValueType::kFloat32);
  if (channels.radiosity) addTriple(kRadiosityNames, ValueType::kFloat32);
  if (channels.albedo) addTriple(kAlbedoNames, ValueType::kFloat32);
  if (channels.two_sided) add("two_sided", ValueType::kUint8);
  if (channels.group) add(kGroupNames[0], ValueType::kUint8);
  if (channels.long_side) addTriple(kLongSideNames, ValueType::kFloat32);
  if (channels.tint) {
    addTriple(kOpacityNames, ValueType::kFloat32);
  } else if (channels.opacity) {
    add("opacity", ValueType::kFloat32);
  }
}

void SurfelRows::add(const char* name, ValueType type) {
  RowProperty property;
  property.name = name;
  property.type = type;
  property.offset = row_bytes_;
  row_bytes_ += valueTypeBytes(type);
  properties_.push_back(std::move(property));
}

void SurfelRows::pack(std::span<const Surfel> surfels, std::byte* rows) const {
  std::byte* next = rows;
  const auto put = [&](const auto& value) {
    std::memcpy(next, &value, sizeof value);
    next += sizeof value;
  };
  const bool is_at_zero = origin_ == glm::dvec3(0);
  for (const Surfel& surfel : surfels) {
    if (is_at_zero) {
      put(surfel.position);
    } else {
      put(glm::dvec3(surfel.position) + origin_);
    }
    if (channels_.normal) put(surfel.normal);
    if (channels_.radius) put(surfel.radius);
    if (channels_.area) put(surfel.area);
    if (channels_.radiosity) put(surfel.radiosity);
    if (channels_.albedo) put(surfel.albedo);
    if (channels_.two_sided) put(static_cast<std::uint8_t>(surfel.isTwoSided()));
    if (channels_.group) put(surfel.group);
    if (channels_.long_side) put(longSideOf(surfel));
    for (int c = 0; channels_.opacity && c < (channels_.tint ? 3 : 1); ++c) put(surfel.opacity(c));
  }
}

}  // namespace surfeit
