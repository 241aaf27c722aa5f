// Rows of a PLY element become surfels: properties by name, invalid records told apart by kind.
// docs/format.md, "Surfel clouds in PLY", lists the names and the rules.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "cloud/rows/row_layout.h"
#include "cloud/rows/surfel_names.h"
#include "core/surfel_limits.h"
#include "surfeit/status.h"
#include "surfeit/surfel.h"
#include "surfels/rows/float_row_decoder.h"
#include "surfels/rows/surfel_defects.h"

namespace surfeit {

// Turns rows of an element into surfels by property name:
//   x y z                      position (required)
//   nx ny nz                   normal, normalised here; zero means sphere; absent: sphere
//   radius | pscale            radius; width: twice the radius
//   area
//   coverage                   part of the disk's area that it covers, above 0 and at most 1; where
//                              there is a radius and no area: area is minus that, and the indexer
//                              finds the area by the neighbourhood
//   radiosity_r _g _b          radiant exitance, scene-linear
//   albedo_r _g _b             reflectance, scene-linear
//   red green blue             sRGB of 8 bits (uchar) or 16 bits (ushort), turned scene-linear
//                              here, or already linear (float, double): used for whichever of
//                              radiosity and albedo is absent, whose channel then counts as there
//   two_sided                  not zero: both sides send and block light
//   long_side_x _y _z          the longer side of the piece, as a vector; zero: not known
//   opacity_r _g _b            0 to 1, not all 0, or of 255 (uchar) or 65535 (ushort); else
//   opacity                    of all colors, above 0 and at most 1, or of 255 (uchar) or 65535
//   (ushort); where
//                              there is a coverage, that counts alone
//   group | light_group        group, a whole number from 0 to 63 of any type
// What is absent stays 0: radius and area for the indexer's rules, which need the neighbourhood.
// A record has one defect, the first in the order of SurfelDefects. Immutable; safe from any
// thread.
class SurfelMapping {
 public:
  // kCorruption when x, y or z is missing, a triple is incomplete, a property is a list, or a color
  // is of another type. `path` only names the file in messages.
  static Result<SurfelMapping> create(const RowLayout& element, const std::string& path);

  CloudChannels channels() const { return channels_; }
  bool hasCoverage() const { return coverage_.isPresent(); }
  // Positions are counted from here, in double precision until they are floats; finite. Before rows
  // are decoded.
  void setOrigin(const glm::dvec3& origin);
  // Bytes of one packed row.
  std::size_t rowBytes() const { return row_bytes_; }

  // Decodes one packed row. Returns false, and counts the defect under `record`, when the record
  // holds no valid surfel.
  bool decode(const std::byte* row, std::uint64_t record, Surfel& surfel,
              SurfelDefects& defects) const;

  // Decodes whole packed rows, the first of which is record `first_record`, and returns how many
  // surfels came to stand at the front of `surfels`, which has room for all rows. Surfels and
  // defects are those of decode, row after row, to the last bit; where the properties are floats
  // and 8-bit colors, it takes 8 ns a row instead of 25.
  std::size_t decodeRows(std::span<const std::byte> rows, std::uint64_t first_record,
                         std::span<Surfel> surfels, SurfelDefects& defects) const;

  // Whether rows hold positions as floats, which have few digits far from 0.
  bool hasFloatPositions() const { return position_[0].type == ValueType::kFloat32; }
  // The position of a valid row, about no origin.
  glm::dvec3 positionOf(const std::byte* row) const;

  // What is wrong with a row that decode refused, found and expected: "radius is -1, expected more
  // than 0".
  std::string describeDefect(const std::byte* row) const;

 private:
  struct Field {  // where a value of the surfel comes from; absent when offset is -1
    std::ptrdiff_t offset = -1;
    ValueType type = ValueType::kFloat32;
    const char* name = "";  // of the property
    bool is_srgb = false;   // an integer that codes 0..1 by the curve of sRGB

    bool isPresent() const { return offset >= 0; }
    double read(const std::byte* row) const;
    // What integers are counted in where they are parts of a whole.
    double whole() const;
  };
  // The first defect of a row, and the property and value that show it: found, expected.
  struct Defect {
    SurfelDefects::Kind SurfelDefects::*kind = nullptr;  // nullptr: there is none
    const char* property = "";
    double value = 0;
    const char* expected = "";
  };

  static Result<Field> findField(const RowLayout& element, const char* name,
                                 const std::string& path);
  static Result<bool> findTriple(const RowLayout& element, const char* const (&names)[3],
                                 const std::string& path, Field (&fields)[3]);
  Defect decodeRow(const std::byte* row, Surfel& surfel) const;
  std::optional<FloatRowDecoder> makeFastDecoder() const;
  void findDrops(const RowLayout& element);

  CloudChannels channels_;
  std::size_t row_bytes_ = 0;
  Field position_[3], normal_[3], radius_, area_, radiosity_[3], albedo_[3], two_sided_, group_;
  Field long_side_[3], coverage_, opacity_[3];  // of one opacity the first
  double radius_scale_ = 1;
  std::map<std::string, std::string, std::less<>> drops_;  // of --channels, by channel
  glm::dvec3 origin_{0};
  std::optional<FloatRowDecoder> fast_decoder_;  // when the types of the properties allow it
};

}  // namespace surfeit
