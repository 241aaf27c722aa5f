// Photons as they come, from clouds of any format by name, and as the indexer takes them: surfels
// whose radiosity is the photon's power.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <string>
#include <vector>

#include "cloud/cloud_formats.h"
#include "cloud/rows/row_layout.h"
#include "storage/positional_file.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"
#include "surfeit/surfel.h"
#include "surfeit/up_axis.h"
#include "surfels/rows/surfel_mapping.h"

namespace surfeit {

// Records that hold no valid photon, by kind.
struct PhotonDefects {
  SurfelDefects surfel;               // in position, normal or albedo
  SurfelDefects::Kind no_normal;      // a zero normal: there is no surface to light
  SurfelDefects::Kind invalid_power;  // negative, not finite, or larger than kLargestColor

  std::uint64_t total() const;
  // As SurfelDefects::describe.
  std::string describe() const;
};

// Turns rows of an element into photons by property name: position, normal, albedo and colors as
// SurfelMapping, and
//   power_r _g _b              power before reflection
//   incident_x _y _z           direction in which the photon came, any length; optional: with it
//                              normals are turned to the side that the photon came from
// Immutable; safe from any thread.
class PhotonMapping {
 public:
  // kCorruption as SurfelMapping::create, and when normals or powers are missing.
  static Result<PhotonMapping> create(const RowLayout& element, const std::string& path);

  bool hasAlbedo() const { return surfels_.channels().albedo; }

  // Decodes one packed row: position, normal, albedo, and the power as radiosity. Returns false,
  // and counts the defect under `record`, when the row holds no valid photon.
  bool decode(const std::byte* row, std::uint64_t record, Surfel& photon,
              PhotonDefects& defects) const;

  // The position of a valid row, about no origin.
  glm::dvec3 positionOf(const std::byte* row) const { return surfels_.positionOf(row); }

  // What is wrong with a row that decode refused, found and expected.
  std::string describeDefect(const std::byte* row) const;

 private:
  explicit PhotonMapping(SurfelMapping surfels) : surfels_(std::move(surfels)) {}
  glm::dvec3 read(const std::byte* row, const RowProperty (&properties)[3]) const;

  SurfelMapping surfels_;  // made from an element that has nothing but what it is to see
  RowProperty power_[3], incident_[3];
  bool has_incident_ = false;
};

// What of RadianceOptions concerns the reading.
struct PhotonReading {
  glm::vec3 default_albedo{0.5f};
  bool strict = false;
};

// The valid photons of all inputs as a surfel cloud, in a temporary file without a name. Areas are
// 1 and radii next to nothing, so that a node's area is its number of photons and its sphere holds
// their positions. One thread at a time.
class PhotonCloud {
 public:
  // Opens every input to see that it holds photons. `channels`, `part` and
  // `color_range` as in RadianceOptions.
  static Result<PhotonCloud> open(const std::vector<std::string>& inputs,
                                  const std::string& channels = {}, const std::string& part = {},
                                  const std::string& filter = {},
                                  ColorRange color_range = ColorRange::kAuto);

  std::uint64_t recordCount() const { return record_count_; }
  // What the first input says is up.
  UpAxis up() const { return up_; }

  // Reads all inputs. `result_path` and `directory` name the temporary file as long as it needs a
  // name. Notes tell of albedo that is made up and records that are skipped, or the first of those
  // is refused. kCorruption when no photon is valid.
  Status write(const std::string& directory, const std::string& result_path,
               const PhotonReading& reading, Progress& progress);

  // After write(). The path opens the file for this process, as long as this object lives.
  std::string path() const;
  std::uint64_t fileBytes() const { return file_bytes_; }
  std::uint64_t photonCount() const { return photon_count_; }
  std::uint64_t skippedCount() const { return record_count_ - photon_count_; }
  glm::dvec3 power() const { return power_; }  // sum over the photons

 private:
  PhotonCloud() = default;
  Status append(const std::string& input, const PhotonReading& reading, Progress& progress);
  template <typename T>
  void put(const T& value);
  Status flush();

  std::vector<std::string> inputs_;
  RowReaderOptions opening_;
  UpAxis up_ = kDefaultUpAxis;
  std::uint64_t record_count_ = 0;
  PositionalFile file_;
  std::vector<std::byte> buffer_;  // rows to be written at the end of the file
  std::uint64_t file_bytes_ = 0;
  std::uint64_t photon_count_ = 0;
  glm::dvec3 power_{0};
};

}  // namespace surfeit
