// Surfel clouds as streams: properties by name become Surfels, invalid records are counted and
// skipped or refused. docs/format.md, "Surfel clouds in PLY", lists the names and the rules.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "io/ply_format.h"
#include "surfeit/status.h"
#include "surfeit/surfel.h"

namespace surfeit {

// Largest values of a surfel: their squares and the sums over a cloud must be floats
// (docs/format.md, "Limits").
inline constexpr float kLargestLength = 1e12f;  // coordinates and radii
inline constexpr float kLargestArea = 1e24f;
inline constexpr float kLargestColor = 1e12f;  // radiosity and albedo

// Records that hold no valid surfel, by kind, each with the number of the first (from 0).
struct SurfelDefects {
  struct Kind {
    std::uint64_t count = 0;
    std::uint64_t first_record = 0;
  };
  Kind non_finite;      // a NaN or infinity in any property that is used
  Kind bad_radius;      // radius zero or negative, where the cloud has radii
  Kind bad_area;        // area zero or negative, where the cloud has areas
  Kind short_normal;    // a normal that is not zero (a sphere) but too short (< 1e-6) to point
  Kind negative_color;  // negative radiosity or albedo
  Kind out_of_range;    // beyond kLargestLength, kLargestArea or kLargestColor

  std::uint64_t total() const;
  // "3 records with a non-finite value (first: record 17), ..."; empty when total() is 0.
  std::string describe() const;
};

// Index of the element that holds surfels or receivers: the first of vertex, point, points, surfel.
// kCorruption when there is none.
Result<std::size_t> findSurfelElement(const PlyHeader& header, const std::string& path);

// Turns rows of an element into surfels by property name:
//   x y z                      position (required)
//   nx ny nz                   normal, normalised here; zero means sphere; absent: sphere
//   radius | pscale            radius; width: twice the radius
//   area
//   radiosity_r _g _b          radiant exitance, scene-linear
//   albedo_r _g _b             reflectance, scene-linear
//   red green blue             sRGB of 8 bits (uchar) or 16 bits (ushort), turned scene-linear
//                              here, or already linear (float, double): used for whichever of
//                              radiosity and albedo is absent, whose channel then counts as there
//   two_sided                  not zero: both sides send and block light
// What is absent stays 0: radius and area for the indexer's rules, which need the neighbourhood.
// A record has one defect, the first in the order of SurfelDefects. Immutable; safe from any
// thread.
class SurfelMapping {
 public:
  // kCorruption when x, y or z is missing, a triple is incomplete, a property is a list, or a color
  // is of another type. `path` only names the file in messages.
  static Result<SurfelMapping> create(const PlyElement& element, const std::string& path);

  CloudChannels channels() const { return channels_; }

  // Decodes one packed row. Returns false, and counts the defect under `record`, when the record
  // holds no valid surfel.
  bool decode(const std::byte* row, std::uint64_t record, Surfel& surfel,
              SurfelDefects& defects) const;

  // What is wrong with a row that decode refused, found and expected: "radius is -1, expected more
  // than 0".
  std::string describeDefect(const std::byte* row) const;

 private:
  struct Field {  // where a value of the surfel comes from; absent when offset is -1
    std::ptrdiff_t offset = -1;
    PlyType type = PlyType::kFloat32;
    const char* name = "";  // of the property
    bool is_srgb = false;   // an integer that codes 0..1 by the curve of sRGB

    bool isPresent() const { return offset >= 0; }
    double read(const std::byte* row) const;
  };
  // The first defect of a row, and the property and value that show it: found, expected.
  struct Defect {
    SurfelDefects::Kind SurfelDefects::*kind = nullptr;  // nullptr: there is none
    const char* property = "";
    double value = 0;
    const char* expected = "";
  };

  static Result<Field> findField(const PlyElement& element, const char* name,
                                 const std::string& path);
  static Result<bool> findTriple(const PlyElement& element, const char* const (&names)[3],
                                 const std::string& path, Field (&fields)[3]);
  Defect decodeRow(const std::byte* row, Surfel& surfel) const;

  CloudChannels channels_;
  Field position_[3], normal_[3], radius_, area_, radiosity_[3], albedo_[3], two_sided_;
  double radius_scale_ = 1;
};

// A cloud that can be read several times, front to back, in batches. One thread at a time.
class SurfelSource {
 public:
  virtual ~SurfelSource() = default;

  virtual const std::string& path() const = 0;
  // Records in the file, valid or not.
  virtual std::uint64_t recordCount() const = 0;
  virtual CloudChannels channels() const = 0;

  // Fills the front of `surfels` and returns how many; 0 at the end. Invalid records are skipped
  // and counted, or with `strict` refused as kCorruption naming the record and the defect.
  virtual Result<std::size_t> read(std::span<Surfel> surfels) = 0;
  // Back to the first record; defects start again from zero.
  virtual Status rewind() = 0;
  virtual const SurfelDefects& defects() const = 0;
};

// Opens any cloud format that we read, recognised by content (PLY so far: the element "vertex",
// "point", "points" or "surfel"). A file with an unknown magic is kCorruption, naming what is read.
// A source takes at most 1.5 MiB of memory, and half a MiB as a rule.
Result<std::unique_ptr<SurfelSource>> openSurfelSource(const std::string& path, bool strict);

// Writes surfels as PLY with the properties above, as floats (two_sided: uchar). One thread at a
// time. The file appears when finish() succeeds.
class SurfelWriter {
 public:
  // `channels` says which optional properties the file gets.
  static Result<SurfelWriter> create(const std::string& path, const CloudChannels& channels,
                                     PlyEncoding encoding, std::vector<std::string> comments = {});
  SurfelWriter(SurfelWriter&&) noexcept;
  SurfelWriter& operator=(SurfelWriter&&) noexcept;
  ~SurfelWriter();
  Status write(std::span<const Surfel> surfels);
  Status finish();

 private:
  struct State;
  explicit SurfelWriter(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace surfeit
