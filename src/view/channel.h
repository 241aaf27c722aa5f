// Channels: what a picture shows of each surfel. A channel is a scalar property, a triple of
// properties with one prefix, or light derived from several triples.
//
//   lit         radiosity + albedo * (irradiance + environment): the surface with what was gathered
//   indirect    albedo * (irradiance + environment): what was gathered alone
//   ao          1 - occlusion: the ambient-occlusion picture
//   color       red green blue; 8- and 16-bit values are sRGB and become scene-linear
//   normal      nx ny nz
//   position    x y z
//   NAME        NAME_r NAME_g NAME_b (radiosity, irradiance, albedo, ...) or NAME_x NAME_y NAME_z
//   NAME        any other scalar property: a grey value
//
// lit and indirect need one of irradiance and environment, and take both where both are there.
// Where radiosity or albedo is absent, they use color in its place, as the indexer does; without
// color, radiosity is 0 and albedo 1.
#pragma once

#include <array>
#include <cstddef>
#include <glm/vec3.hpp>
#include <optional>
#include <string>
#include <vector>

#include "cloud/rows/row_layout.h"
#include "surfeit/status.h"
#include "surfeit/surfel.h"
#include "view/row_field.h"

namespace surfeit {

// How values of a channel become a picture.
enum class ValueKind : std::uint8_t {
  kLight,     // scene-linear light or reflectance: exposure and the sRGB curve apply
  kScalar,    // any number: stretched over the range of its values, no curve
  kNormal,    // -1..1: shown as 0.5 n + 0.5, no curve
  kPosition,  // shown relative to the bounds, no curve
};

// Immutable; safe from any thread.
class Channel {
 public:
  // The channel of that name. kInvalidArgument lists the channels of the cloud when it has none.
  static Result<Channel> find(const RowLayout& element, const std::string& name,
                              const std::string& path);
  // The names that find() knows for this cloud, derived ones first. Members of a triple are
  // channels as well, but not listed.
  static std::vector<std::string> list(const RowLayout& element);
  // The most telling one: lit, ao, radiosity, color, albedo, normal, position.
  static std::string choose(const RowLayout& element);

  const std::string& name() const { return name_; }
  ValueKind kind() const { return kind_; }

  // The value of a row; a grey value three times. Not finite when the row's value is not.
  glm::vec3 value(const std::byte* row) const;

 private:
  // Three properties, one property three times, or a constant.
  struct Triple {
    std::array<RowField, 3> fields;
    float constant = 0;       // where the properties are absent
    float display_scale = 0;  // > 0: the values times this are sRGB display values

    bool exists() const { return fields[0].exists(); }
    glm::vec3 read(const std::byte* row) const;
  };
  static Triple findTriple(const RowLayout& element, const std::string& name);

  std::string name_;
  ValueKind kind_ = ValueKind::kLight;
  // value = base + sign * factor * (value + added)
  Triple base_, factor_, value_, added_;
  float sign_ = 1;
};

}  // namespace surfeit
