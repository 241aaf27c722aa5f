#include "cloud/vdb/vdb_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "cloud/vdb/vdb_coding.h"

namespace surfeit {
namespace {

constexpr std::uint32_t kOldestVersion = 222;
constexpr std::uint32_t kMaxGrids = 1 << 12, kMaxMetadata = 1 << 16;
// Longer ones (thumbnails, tables for OpenVDB's delayed loading) are passed over.
constexpr std::uint32_t kMaxMetadataBytes = 1 << 16;

struct Descriptor {
  std::string instance_of;
  std::uint64_t begin = 0;
  std::uint64_t next = 0;  // the next descriptor
};

Status readMetadata(VdbCursor& cursor, std::vector<VdbMetadata>& metadata) {
  std::uint32_t count = 0;
  SURFEIT_RETURN_IF_ERROR(cursor.read(count));
  if (count > kMaxMetadata) {
    return cursor.corrupt(fmt::format("{} metadata, expected at most {}", count, kMaxMetadata));
  }
  for (std::uint32_t i = 0; i < count; ++i) {
    VdbMetadata entry;
    std::uint32_t bytes = 0;
    SURFEIT_RETURN_IF_ERROR(cursor.readText(entry.name));
    SURFEIT_RETURN_IF_ERROR(cursor.readText(entry.type));
    SURFEIT_RETURN_IF_ERROR(cursor.read(bytes));
    if (bytes > kMaxMetadataBytes) {
      SURFEIT_RETURN_IF_ERROR(cursor.skip(bytes));
      continue;
    }
    SURFEIT_ASSIGN_OR_RETURN(const Bytes value, cursor.take(bytes));
    entry.value.assign(value.begin(), value.end());
    metadata.push_back(std::move(entry));
  }
  return {};
}

// A map as OpenVDB stores it: an affine matrix, or scales and translation with values derived from
// them, which are passed over.
Status readTransform(VdbCursor& cursor, VdbTransform& transform) {
  std::string type;
  SURFEIT_RETURN_IF_ERROR(cursor.readText(type));
  if (type == "AffineMap" || type == "UnitaryMap") {
    std::array<std::array<double, 4>, 4> matrix = {};
    SURFEIT_RETURN_IF_ERROR(cursor.read(matrix));
    for (std::size_t row = 0; row < 3; ++row) {
      std::copy_n(matrix[row].begin(), 3, transform.linear[row].begin());
    }
    std::copy_n(matrix[3].begin(), 3, transform.translation.begin());
    return {};
  }
  const bool translates = type.find("Translat") != std::string::npos;
  const bool scales = type.find("Scale") != std::string::npos;
  constexpr std::string_view kTypes[] = {"ScaleMap", "UniformScaleMap", "TranslationMap",
                                         "ScaleTranslateMap", "UniformScaleTranslateMap"};
  if (std::find(std::begin(kTypes), std::end(kTypes), type) == std::end(kTypes)) {
    return cursor.corrupt(
        fmt::format("a transform of type {}, expected an affine one", quoteText(type)));
  }
  if (translates) SURFEIT_RETURN_IF_ERROR(cursor.read(transform.translation));
  if (scales) {
    std::array<double, 3> scale = {};
    SURFEIT_RETURN_IF_ERROR(cursor.read(scale));
    for (std::size_t axis = 0; axis < 3; ++axis) transform.linear[axis][axis] = scale[axis];
    SURFEIT_RETURN_IF_ERROR(cursor.skip(4 * sizeof(scale)));
  }
  return {};
}

// The values of a transform that a cloud can stand on.
Status checkTransform(const VdbCursor& cursor, const VdbTransform& transform) {
  bool is_finite = std::isfinite(transform.volume()) && transform.volume() > 0;
  for (const double value : transform.translation) is_finite &= std::isfinite(value);
  return is_finite ? Status() : cursor.corrupt("a transform that is not finite and invertible");
}

Status readDescriptor(VdbCursor& cursor, std::uint64_t file_bytes, VdbGrid& grid,
                      Descriptor& descriptor) {
  SURFEIT_RETURN_IF_ERROR(cursor.readText(grid.name));
  SURFEIT_RETURN_IF_ERROR(cursor.readText(grid.type));
  SURFEIT_RETURN_IF_ERROR(cursor.readText(descriptor.instance_of));
  std::array<std::int64_t, 3> places = {};
  SURFEIT_RETURN_IF_ERROR(cursor.read(places));

  // Names that occur twice are told apart by a number after a separator
  grid.name = grid.name.substr(0, grid.name.find('\x1e'));
  constexpr std::string_view kHalf = "_HalfFloat";
  if (grid.type.ends_with(kHalf)) {
    grid.is_half = true;
    grid.type.resize(grid.type.size() - kHalf.size());
  }

  // An instance has no tree of its own, and the places of its tree are 0
  const std::int64_t here = static_cast<std::int64_t>(cursor.offset());
  const bool has_tree = descriptor.instance_of.empty();
  if (places[0] < here || (has_tree && (places[1] < places[0] || places[2] < places[1])) ||
      places[2] < places[0] || static_cast<std::uint64_t>(places[2]) > file_bytes) {
    return cursor.corrupt(fmt::format(
        "grid {} lies at {}, {} and {}, expected {} or more, in rising order, within {} bytes",
        quoteText(grid.name), places[0], places[1], places[2], here, file_bytes));
  }
  descriptor.begin = static_cast<std::uint64_t>(places[0]);
  grid.buffers_begin = static_cast<std::uint64_t>(places[1]);
  grid.end = static_cast<std::uint64_t>(places[2]);
  descriptor.next = grid.end;
  return {};
}

Status readGrid(const InputFile& input, VdbGrid& grid, const Descriptor& descriptor) {
  VdbCursor cursor(input, descriptor.begin, grid.end);
  SURFEIT_RETURN_IF_ERROR(cursor.read(grid.compression));
  if (grid.compression > (kVdbZip | kVdbActiveMask | kVdbBlosc)) {
    return cursor.corrupt(fmt::format("compression {}, expected 0 to 7", grid.compression));
  }
  SURFEIT_RETURN_IF_ERROR(readMetadata(cursor, grid.metadata));
  const std::uint64_t transform_begin = cursor.offset();
  SURFEIT_RETURN_IF_ERROR(readTransform(cursor, grid.transform));
  VdbCursor record(input, transform_begin, cursor.offset());
  SURFEIT_ASSIGN_OR_RETURN(const Bytes bytes, record.take(record.left()));
  grid.transform_record.assign(bytes.begin(), bytes.end());
  SURFEIT_RETURN_IF_ERROR(checkTransform(cursor, grid.transform));
  grid.tree_begin = cursor.offset();
  return {};
}

// Gives an instance the tree of the grid that it shares.
Status shareTree(const VdbCursor& cursor, const std::vector<VdbGrid>& grids,
                 const std::vector<Descriptor>& descriptors, std::size_t index, VdbGrid& grid) {
  std::string parent = descriptors[index].instance_of;
  parent = parent.substr(0, parent.find('\x1e'));
  for (std::size_t i = 0; i < grids.size(); ++i) {
    if (grids[i].name != parent || !descriptors[i].instance_of.empty()) continue;
    grid.tree_begin = grids[i].tree_begin;
    grid.buffers_begin = grids[i].buffers_begin;
    grid.end = grids[i].end;
    grid.compression = grids[i].compression;
    grid.is_half = grids[i].is_half;
    grid.type = grids[i].type;
    return {};
  }
  return cursor.corrupt(fmt::format("grid {} shares the tree of {}, which is not there",
                                    quoteText(grid.name), quoteText(parent)));
}

Status readHeader(VdbCursor& cursor, std::uint32_t& version) {
  SURFEIT_ASSIGN_OR_RETURN(const Bytes magic, cursor.take(kVdbMagic.size()));
  if (std::memcmp(magic.data(), kVdbMagic.data(), kVdbMagic.size()) != 0) {
    return cursor.corrupt("not an OpenVDB file; a compressed one must be decompressed first");
  }
  SURFEIT_RETURN_IF_ERROR(cursor.read(version));
  if (version < kOldestVersion || version > 1000) {
    return cursor.corrupt(
        fmt::format("OpenVDB file version {}, expected {} or later", version, kOldestVersion));
  }
  std::array<std::uint32_t, 2> library_version = {};
  SURFEIT_RETURN_IF_ERROR(cursor.read(library_version));
  char has_offsets = 0;
  SURFEIT_RETURN_IF_ERROR(cursor.read(has_offsets));
  if (has_offsets == 0) {
    return cursor.corrupt("written as a stream, without places of grids: save it as a file");
  }
  return cursor.skip(kVdbUuidBytes);
}

}  // namespace

std::string VdbMetadata::text() const {
  const auto as = [&]<typename T>(T number) {
    if (value.size() != sizeof(T)) return std::string();
    std::memcpy(&number, value.data(), sizeof(T));
    return fmt::format("{}", number);
  };
  if (type == "string") return {reinterpret_cast<const char*>(value.data()), value.size()};
  if (type == "int32") return as(std::int32_t());
  if (type == "int64") return as(std::int64_t());
  if (type == "float") return as(float());
  if (type == "double") return as(double());
  if (type == "bool") return as(std::uint8_t());
  return {};
}

double VdbTransform::volume() const {
  const auto& m = linear;
  return std::abs(m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) -
                  m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
                  m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]));
}

std::string VdbGrid::text(std::string_view metadata_name) const {
  for (const VdbMetadata& entry : metadata) {
    if (entry.name == metadata_name) return entry.text();
  }
  return {};
}

Result<std::shared_ptr<const VdbFile>> VdbFile::open(const std::string& path, Access access) {
  SURFEIT_ASSIGN_OR_RETURN(InputFile opened, InputFile::open(path, access));
  auto file = std::make_shared<VdbFile>(VdbFile{std::move(opened), 0, {}, {}, 0});
  const InputFile& input = file->input;
  VdbCursor cursor(input, 0, input.size());
  SURFEIT_RETURN_IF_ERROR(readHeader(cursor, file->version));
  SURFEIT_RETURN_IF_ERROR(readMetadata(cursor, file->metadata));
  std::uint32_t count = 0;
  SURFEIT_RETURN_IF_ERROR(cursor.read(count));
  if (count > kMaxGrids) {
    return cursor.corrupt(fmt::format("{} grids, expected at most {}", count, kMaxGrids));
  }

  std::vector<Descriptor> descriptors;
  for (std::uint32_t i = 0; i < count; ++i) {
    VdbGrid grid;
    Descriptor descriptor;
    SURFEIT_RETURN_IF_ERROR(readDescriptor(cursor, input.size(), grid, descriptor));
    SURFEIT_RETURN_IF_ERROR(readGrid(input, grid, descriptor));
    SURFEIT_RETURN_IF_ERROR(cursor.skip(descriptor.next - cursor.offset()));
    file->grids.push_back(std::move(grid));
    descriptors.push_back(std::move(descriptor));
  }
  file->bytes_behind = cursor.left();
  for (std::size_t i = 0; i < file->grids.size(); ++i) {
    if (descriptors[i].instance_of.empty()) continue;
    SURFEIT_RETURN_IF_ERROR(shareTree(cursor, file->grids, descriptors, i, file->grids[i]));
  }
  return std::shared_ptr<const VdbFile>(std::move(file));
}

}  // namespace surfeit
