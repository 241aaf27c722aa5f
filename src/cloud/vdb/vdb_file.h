// The parts of an OpenVDB file: its metadata, and a directory of its grids with what they say of
// themselves. Written from the layout of file version 222 and later (OpenVDB 2.0, 2013), not with
// OpenVDB's library: that trusts what a file says of its sizes, and holds what it reads.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "cloud/vdb/vdb_cursor.h"
#include "storage/file.h"
#include "surfeit/status.h"

namespace surfeit {

using VdbCoord = std::array<std::int32_t, 3>;

// Text and numbers of a metadata map, in the order of the file.
struct VdbMetadata {
  std::string name, type;
  std::vector<std::byte> value;
  // The value as text; nothing for types that are not text or number.
  std::string text() const;
};

// From the space of voxel indices to the world: world = index * linear + translation, index a row.
struct VdbTransform {
  std::array<std::array<double, 3>, 3> linear = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  std::array<double, 3> translation = {};

  std::array<double, 3> world(double i, double j, double k) const {
    return {i * linear[0][0] + j * linear[1][0] + k * linear[2][0] + translation[0],
            i * linear[0][1] + j * linear[1][1] + k * linear[2][1] + translation[1],
            i * linear[0][2] + j * linear[1][2] + k * linear[2][2] + translation[2]};
  }
  // Of a voxel, in world units.
  double volume() const;
  bool operator==(const VdbTransform&) const = default;
};

// What a file says of a grid.
struct VdbGrid {
  std::string name;
  std::string type;  // "Tree_float_5_4_3"
  bool is_half = false;
  std::uint32_t compression = 0;  // of kVdbZip, ...
  std::vector<VdbMetadata> metadata;
  VdbTransform transform;
  std::vector<std::byte> transform_record;                   // as it stands in the file
  std::uint64_t tree_begin = 0, buffers_begin = 0, end = 0;  // places in the file

  bool isPoints() const { return type == "Tree_ptdataidx32_5_4_3"; }
  // The value of text of that name, or "".
  std::string text(std::string_view metadata_name) const;
};

// An open file. Immutable, so threads may share it; readers keep it alive with a shared_ptr.
struct VdbFile {
  // kCorruption for what is no OpenVDB file, is older than version 222, was written as a stream
  // without offsets, or has a grid whose transform is a frustum. Grids that share the tree of
  // another one (instances) are listed like it.
  static Result<std::shared_ptr<const VdbFile>> open(const std::string& path, Access access);

  InputFile input;
  std::uint32_t version = 0;
  std::vector<VdbMetadata> metadata;
  std::vector<VdbGrid> grids;
  std::uint64_t bytes_behind = 0;  // the last grid
};

// The first bytes of every file.
inline constexpr std::array<unsigned char, 8> kVdbMagic = {0x20, 0x42, 0x44, 0x56, 0, 0, 0, 0};

}  // namespace surfeit
