#include "photons/radiance_photons.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <glm/geometric.hpp>
#include <span>
#include <string_view>
#include <utility>

#include "cloud/cloud_formats.h"
#include "cloud/ply/ply_format.h"
#include "cloud/rows/photon_names.h"
#include "cloud/rows/surfel_names.h"
#include "core/up_comment.h"
#include "octree/neighbours/local_density.h"
#include "storage/temporary_name.h"

namespace surfeit {
namespace {

// What SurfelMapping may see of a photon: a radius of zero, say, makes no photon invalid.
constexpr std::array<std::string_view, 12> kSurfaceNames = {
    "x", "y", "z", "nx", "ny", "nz", "albedo_r", "albedo_g", "albedo_b", "red", "green", "blue"};

// Rows read between two looks at Progress::isCancelled.
constexpr std::size_t kSliceRows = 4096;
constexpr std::size_t kWriteBytes = 1 << 20;
// Of the header of the temporary file, the same for any count.
constexpr std::size_t kHeaderBytes = 1024;

// All three properties or none, and whether they are there.
Result<bool> findTriple(const RowLayout& element, const char* const (&names)[3],
                        const std::string& path, RowProperty (&properties)[3]) {
  int found = 0;
  for (int i = 0; i < 3; ++i) {
    const RowProperty* property = element.find(names[i]);
    if (property == nullptr) continue;
    if (property->is_list) {
      return Status::corruption(
          fmt::format("{}: element {}: property {} is a list, expected a scalar", path,
                      element.name, names[i]));
    }
    properties[i] = *property;
    ++found;
  }
  if (found == 1 || found == 2) {
    return Status::corruption(fmt::format("{}: element {}: found {} of the properties {}, {}, {}",
                                          path, element.name, found, names[0], names[1], names[2]));
  }
  return found == 3;
}

void count(SurfelDefects::Kind& kind, std::uint64_t record) {
  if (kind.count++ == 0) kind.first_record = record;
}

bool isValidPower(double value) { return value >= 0 && value <= double(kLargestColor); }

// Normal, radius, area, radiosity, albedo: what the temporary file holds of a photon behind its
// position, which is of doubles.
constexpr std::size_t kRowFloats = 11;

std::array<float, kRowFloats> rowOf(const Surfel& photon) {
  const glm::vec3 &n = photon.normal, &power = photon.radiosity, &albedo = photon.albedo;
  return {n.x,     n.y,     n.z,      kPlaceholderSize, 1,       power.x,
          power.y, power.z, albedo.x, albedo.y,         albedo.z};
}

// The header of the temporary file, filled up to kHeaderBytes.
std::string headerText(std::uint64_t row_count) {
  RowLayout element;
  element.name = "vertex";
  element.count = row_count;
  const auto add = [&element](const char* name, ValueType type = ValueType::kFloat32) {
    RowProperty property;
    property.name = name;
    property.type = type;
    element.properties.push_back(property);
  };
  for (const char* name : kPositionNames) add(name, ValueType::kFloat64);
  for (const char* name : kNormalNames) add(name);
  add("radius");
  add("area");
  for (const char* name : kRadiosityNames) add(name);
  for (const char* name : kAlbedoNames) add(name);
  packRow(element);

  PlyHeader header;
  header.encoding = std::endian::native == std::endian::little ? PlyEncoding::kBinaryLittleEndian
                                                               : PlyEncoding::kBinaryBigEndian;
  header.elements.push_back(std::move(element));
  header.comments.emplace_back(1, '-');
  header.comments[0].append(kHeaderBytes - formatPlyHeader(header).size(), '-');
  return formatPlyHeader(header);
}

// Opens a cloud and finds its photons.
struct PhotonFile {
  std::unique_ptr<RowReader> reader;
  PhotonMapping mapping;

  static Result<PhotonFile> open(const std::string& path, const RowReaderOptions& options) {
    SURFEIT_ASSIGN_OR_RETURN(std::unique_ptr<RowReader> reader, openRowReader(path, options));
    const RowLayout& element = reader->element();
    SURFEIT_ASSIGN_OR_RETURN(PhotonMapping mapping, PhotonMapping::create(element, path));
    if (element.count == 0) {
      return Status::corruption(
          fmt::format("{}: element {} has 0 rows, expected photons", path, element.name));
    }
    return PhotonFile{std::move(reader), std::move(mapping)};
  }
  const RowLayout& photons() const { return reader->element(); }
};

}  // namespace

std::uint64_t PhotonDefects::total() const {
  return surfel.total() + no_normal.count + invalid_power.count;
}

std::string PhotonDefects::describe() const {
  std::string text = surfel.describeKinds();
  const auto add = [&text](const SurfelDefects::Kind& kind, const char* what) {
    if (kind.count == 0) return;
    text += fmt::format("{}{} record{} with {} (first: record {})", text.empty() ? "" : ", ",
                        kind.count, kind.count == 1 ? "" : "s", what, kind.first_record);
  };
  add(no_normal, "a normal of zero");
  add(invalid_power, "a power that is negative, not finite or too large");
  return text + surfel.wayOut();
}

Result<PhotonMapping> PhotonMapping::create(const RowLayout& element, const std::string& path) {
  RowLayout surface = element;
  std::erase_if(surface.properties, [](const RowProperty& property) {
    return std::find(kSurfaceNames.begin(), kSurfaceNames.end(), property.name) ==
           kSurfaceNames.end();
  });
  SURFEIT_ASSIGN_OR_RETURN(SurfelMapping surfels, SurfelMapping::create(surface, path));
  PhotonMapping mapping(std::move(surfels));
  SURFEIT_ASSIGN_OR_RETURN(const bool has_power,
                           findTriple(element, kPowerNames, path, mapping.power_));
  if (!has_power) {
    return Status::corruption(
        fmt::format("{}: element {}: found no properties power_r, power_g, power_b, expected the "
                    "power of every "
                    "photon{}",
                    path, element.name,
                    element.find(kRadiosityNames[0]) == nullptr
                        ? ""
                        : ": this cloud has radiosity already, and can be indexed as it is"));
  }
  if (!mapping.surfels_.channels().normal) {
    return Status::corruption(fmt::format(
        "{}: element {}: found no properties nx, ny, nz, expected the normal of the surface at "
        "every photon",
        path, element.name));
  }
  SURFEIT_ASSIGN_OR_RETURN(mapping.has_incident_,
                           findTriple(element, kIncidentNames, path, mapping.incident_));
  return mapping;
}

glm::dvec3 PhotonMapping::read(const std::byte* row, const RowProperty (&properties)[3]) const {
  glm::dvec3 value;
  for (int i = 0; i < 3; ++i) {
    value[i] = rowValue(row + properties[i].offset, properties[i].type);
  }
  return value;
}

bool PhotonMapping::decode(const std::byte* row, std::uint64_t record, Surfel& photon,
                           PhotonDefects& defects) const {
  if (!surfels_.decode(row, record, photon, defects.surfel)) return false;
  if (photon.isSphere()) {
    count(defects.no_normal, record);
    return false;
  }
  const glm::dvec3 power = read(row, power_);
  if (!isValidPower(power.x) || !isValidPower(power.y) || !isValidPower(power.z)) {
    count(defects.invalid_power, record);
    return false;
  }
  photon.radiosity = glm::vec3(power);
  if (has_incident_ && glm::dot(read(row, incident_), glm::dvec3(photon.normal)) > 0) {
    photon.normal = -photon.normal;
  }
  return true;
}

std::string PhotonMapping::describeDefect(const std::byte* row) const {
  Surfel photon;
  SurfelDefects defects;
  if (!surfels_.decode(row, 0, photon, defects)) return surfels_.describeDefect(row);
  if (photon.isSphere()) return "normal is zero, expected that of the surface";
  const glm::dvec3 power = read(row, power_);
  for (int i = 0; i < 3; ++i) {
    if (isValidPower(power[i])) continue;
    return fmt::format("{} is {}, expected 0 to {}", kPowerNames[i], power[i], kLargestColor);
  }
  return "nothing";
}

Result<PhotonCloud> PhotonCloud::open(const std::vector<std::string>& inputs,
                                      const std::string& channels, const std::string& part,
                                      const std::string& filter, ColorRange color_range) {
  if (inputs.empty()) return Status::invalidArgument("radiance: no photon cloud");
  PhotonCloud cloud;
  cloud.inputs_ = inputs;
  SURFEIT_ASSIGN_OR_RETURN(cloud.opening_.channels, parseChannelRenames(channels));
  cloud.opening_.part = part;
  cloud.opening_.filter = filter;
  cloud.opening_.selections = std::make_shared<RowSelections>();
  cloud.opening_.color_range = color_range;
  for (const std::string& path : inputs) {
    SURFEIT_ASSIGN_OR_RETURN(const PhotonFile file, PhotonFile::open(path, cloud.opening_));
    if (cloud.record_count_ == 0) {
      cloud.up_ = statedUpAxis(file.reader->comments()).value_or(kDefaultUpAxis);
    }
    cloud.record_count_ += file.photons().count;
  }
  return cloud;
}

Status PhotonCloud::write(const std::string& directory, const std::string& result_path,
                          const PhotonReading& reading, Progress& progress) {
  const std::string name = result_path.substr(result_path.rfind('/') + 1);
  SURFEIT_ASSIGN_OR_RETURN(NamedFile named, createTemporary(directory + '/' + name, directory));
  std::error_code ignored;
  std::filesystem::remove(named.path, ignored);  // the descriptor is enough from now on
  file_ = PositionalFile(std::move(named.descriptor), directory + ": temporary file");
  file_bytes_ = kHeaderBytes;
  buffer_.reserve(kWriteBytes + sizeof(glm::dvec3) + kRowFloats * sizeof(float));

  progress.beginPhase("read", record_count_, "photons");
  for (const std::string& input : inputs_) {
    SURFEIT_RETURN_IF_ERROR(append(input, reading, progress));
  }
  SURFEIT_RETURN_IF_ERROR(flush());
  if (photon_count_ == 0) {
    return Status::corruption(
        fmt::format("{}: no valid photon in {} records", inputs_.front(), record_count_));
  }
  std::vector<std::byte>().swap(buffer_);
  const std::string header = headerText(photon_count_);
  return file_.writeAt(0, std::as_bytes(std::span(header)));
}

Status PhotonCloud::append(const std::string& input, const PhotonReading& reading,
                           Progress& progress) {
  SURFEIT_ASSIGN_OR_RETURN(PhotonFile file, PhotonFile::open(input, opening_));
  for (const std::string& note : file.reader->notes()) {
    progress.note(fmt::format("{}: {}", input, note));
  }
  if (!file.mapping.hasAlbedo()) {
    const glm::vec3& albedo = reading.default_albedo;
    progress.note(
        fmt::format("{}: no albedo: {} {} {} is used", input, albedo.x, albedo.y, albedo.z));
  }
  const std::size_t row_bytes = file.photons().row_bytes;
  AlignedBuffer buffer;
  PhotonDefects defects;
  for (std::uint64_t record = 0;;) {
    if (progress.isCancelled()) return Status::interrupted();
    SURFEIT_ASSIGN_OR_RETURN(const Bytes slice, file.reader->readRows(kSliceRows, buffer));
    const std::size_t rows = slice.size() / row_bytes;
    if (rows == 0) break;
    for (std::size_t i = 0; i < rows; ++i, ++record) {
      const std::byte* row = slice.data() + i * row_bytes;
      Surfel photon;
      if (!file.mapping.decode(row, record, photon, defects)) {
        if (!reading.strict) continue;
        return Status::corruption(
            fmt::format("{}: record {}: {}", input, record, file.mapping.describeDefect(row)));
      }
      if (!file.mapping.hasAlbedo()) photon.albedo = reading.default_albedo;
      put(file.mapping.positionOf(row));
      put(rowOf(photon));
      ++photon_count_;
      power_ += glm::dvec3(photon.radiosity);
      if (buffer_.size() >= kWriteBytes) SURFEIT_RETURN_IF_ERROR(flush());
    }
    progress.advance(rows);
  }
  if (defects.total() > 0) progress.note(fmt::format("{}: skipped {}", input, defects.describe()));
  return {};
}

template <typename T>
void PhotonCloud::put(const T& value) {
  const std::size_t at = buffer_.size();
  buffer_.resize(at + sizeof value);
  std::memcpy(&buffer_[at], &value, sizeof value);
}

Status PhotonCloud::flush() {
  SURFEIT_RETURN_IF_ERROR(file_.writeAt(file_bytes_, buffer_));
  file_bytes_ += buffer_.size();
  buffer_.clear();
  return {};
}

// The link that the system keeps for every descriptor opens files without a name, too.
std::string PhotonCloud::path() const {
  return fmt::format("/proc/self/fd/{}", file_.descriptor());
}

}  // namespace surfeit
