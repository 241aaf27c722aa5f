#include "brick/brick_writer.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "cloud/vdb/vdb_tree.h"
#include "cloud/vdb/vdb_writers.h"

namespace surfeit {
namespace {

BrickKey keyOf(const std::byte* record) {
  BrickKey key;
  std::memcpy(&key.first, record, 8);
  std::memcpy(&key.second, record + 8, 8);
  return key;
}

int groupOf(const BrickKey& key) { return static_cast<int>(key.first >> kBrickGroupShift); }

bool isSameNode(const BrickKey& a, const BrickKey& b) {
  return a.first == b.first && a.second >> kBrickChildShift == b.second >> kBrickChildShift;
}
bool isSameLeaf(const BrickKey& a, const BrickKey& b) {
  return a.first == b.first && a.second >> kBrickLeafShift == b.second >> kBrickLeafShift;
}

void setBit(std::span<std::uint64_t> words, std::uint64_t bit) {
  words[bit / 64] |= std::uint64_t{1} << (bit % 64);
}

// The record of a transform that puts voxel (i, j, k) of edge `size` at [i, i + 1) size, ...:
// OpenVDB's indices are the centres of voxels.
std::vector<std::byte> transformRecord(double size) {
  const std::string type = "AffineMap";
  const double centre = size / 2;
  const std::array<double, 16> matrix = {size, 0, 0,    0, 0,      size,   0,      0,
                                         0,    0, size, 0, centre, centre, centre, 1};
  const auto length = static_cast<std::uint32_t>(type.size());
  std::vector<std::byte> record;
  for (const Bytes part :
       {Bytes(std::as_bytes(std::span(&length, 1))), Bytes(std::as_bytes(std::span(type))),
        Bytes(std::as_bytes(std::span(matrix)))}) {
    record.insert(record.end(), part.begin(), part.end());
  }
  return record;
}

// An inner node: its children, no active tiles, an inactive background.
Status writeMasks(VdbOutput& output, std::span<const std::uint64_t> children) {
  SURFEIT_RETURN_IF_ERROR(output.append(std::as_bytes(children)));
  const std::vector<std::uint64_t> none(children.size());
  SURFEIT_RETURN_IF_ERROR(output.append(std::as_bytes(std::span(none))));
  SURFEIT_RETURN_IF_ERROR(output.appendValue(std::int8_t{0}));
  return output.appendValue(std::int64_t{0});
}

}  // namespace

void BrickGroup::add(const VdbCoord& voxel) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    least[axis] = voxels == 0 ? voxel[axis] : std::min(least[axis], voxel[axis]);
    greatest[axis] = voxels == 0 ? voxel[axis] : std::max(greatest[axis], voxel[axis]);
  }
  ++voxels;
}

BrickWriter::BrickWriter(ExternalSorter& voxels, std::span<const BrickGroup> groups,
                         std::span<const BrickChannel> channels, double voxel_size)
    : voxels_(voxels), groups_(groups), voxel_size_(voxel_size) {
  std::size_t offset = 1;
  for (const BrickChannel& channel : channels) {
    grids_.push_back({channel.name, fmt::format("{}", fmt::join(channel.properties, " ")), offset,
                      channel.properties.size()});
    offset += channel.properties.size();
  }
  grids_.push_back({kBrickWeightName, "", 0, 1});
}

Status BrickWriter::write(const std::string& path, double max_error, Progress& progress,
                          std::uint64_t& file_bytes) {
  const auto group_count = std::count_if(groups_.begin(), groups_.end(),
                                         [](const BrickGroup& group) { return group.voxels > 0; });
  const std::string comment = fmt::format(
      "brick map of Surfeit: finest voxels {:.9g}, max error {:.9g}", voxel_size_, max_error);
  SURFEIT_ASSIGN_OR_RETURN(
      VdbOutput output,
      VdbOutput::create(
          path, std::span(&comment, 1),
          static_cast<std::uint32_t>(static_cast<std::size_t>(group_count) * grids_.size())));
  for (std::size_t group = 0; group < groups_.size(); ++group) {
    if (groups_[group].voxels == 0) continue;
    SURFEIT_RETURN_IF_ERROR(writeGroup(output, static_cast<int>(group), progress));
  }
  file_bytes = output.size();
  return output.finish();
}

// The sorter stands at the first voxel of the group, and at the end at that of the next.
Status BrickWriter::writeGroup(VdbOutput& output, int group, Progress& progress) {
  const ExternalSorter::Mark begin = voxels_.mark();
  std::vector<BrickKey> nodes;
  SURFEIT_RETURN_IF_ERROR(findNodes(group, nodes));
  for (const Grid& grid : grids_) {
    if (progress.isCancelled()) return Status::interrupted();
    SURFEIT_RETURN_IF_ERROR(beginGrid(output, group, grid));
    SURFEIT_RETURN_IF_ERROR(voxels_.reset(begin));
    SURFEIT_RETURN_IF_ERROR(writeTree(output, grid, nodes));
    SURFEIT_RETURN_IF_ERROR(output.endTree());
    SURFEIT_RETURN_IF_ERROR(voxels_.reset(begin));
    SURFEIT_RETURN_IF_ERROR(writeBuffers(output, group, grid, progress));
    SURFEIT_RETURN_IF_ERROR(output.endGrid());
  }
  return {};
}

Status BrickWriter::beginGrid(VdbOutput& output, int group, const Grid& grid) {
  const int level = group / kBrickDirections;
  const std::string direction(
      kBrickDirectionNames[static_cast<std::size_t>(group % kBrickDirections)]);
  const BrickGroup& voxels = groups_[static_cast<std::size_t>(group)];
  const std::string name = vdbName(fmt::format("{}:{}:{}", grid.name, level, direction));
  const std::vector<VdbMetadata> metadata = {
      vdbText(kBrickChannelName, grid.name),
      vdbText(kBrickDirectionName, direction),
      vdbInt64(kBrickLevelName, level),
      vdbText(kBrickPropertiesName, grid.properties),
      vdbInt64(kBrickVersionName, kBrickVersion),
      vdbText("class", "unknown"),
      vdbCoord("file_bbox_max", voxels.greatest),
      vdbCoord("file_bbox_min", voxels.least),
      vdbText("file_compression", "blosc + active values"),
      vdbInt64("file_voxel_count", static_cast<std::int64_t>(voxels.voxels)),
      vdbBool("is_saved_as_half_float", false),
      vdbText("name", name),
      vdbText("vector_type", "invariant")};
  return output.beginGrid(name, grid.components == 3 ? "Tree_vec3s_5_4_3" : "Tree_float_5_4_3",
                          metadata, transformRecord(std::ldexp(voxel_size_, level)));
}

// The least key of every node of 128^3 voxels: of a surface, one for some ten thousand voxels.
Status BrickWriter::findNodes(int group, std::vector<BrickKey>& nodes) {
  while (voxels_.current() != nullptr) {
    const BrickKey key = keyOf(voxels_.current());
    if (groupOf(key) != group) break;
    if (nodes.empty() || !isSameNode(nodes.back(), key)) nodes.push_back(key);
    SURFEIT_RETURN_IF_ERROR(voxels_.advance());
  }
  return {};
}

Status BrickWriter::writeTree(VdbOutput& output, const Grid& grid,
                              std::span<const BrickKey> nodes) {
  SURFEIT_RETURN_IF_ERROR(output.appendValue(std::uint32_t{1}));  // buffers of a leaf
  SURFEIT_RETURN_IF_ERROR(output.append(std::vector<std::byte>(4 * grid.components)));
  std::uint32_t roots = 0;
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    roots += i == 0 || nodes[i].first != nodes[i - 1].first ? 1 : 0;
  }
  SURFEIT_RETURN_IF_ERROR(output.appendValue(std::uint32_t{0}));  // tiles
  SURFEIT_RETURN_IF_ERROR(output.appendValue(roots));
  for (std::size_t begin = 0; begin < nodes.size();) {
    std::array<std::uint64_t, 32768 / 64> children = {};
    std::size_t end = begin;
    for (; end < nodes.size() && nodes[end].first == nodes[begin].first; ++end) {
      setBit(children, nodes[end].second >> kBrickChildShift);
    }
    SURFEIT_RETURN_IF_ERROR(output.appendValue(brickRoot(nodes[begin])));
    SURFEIT_RETURN_IF_ERROR(writeMasks(output, children));
    for (; begin < end; ++begin) SURFEIT_RETURN_IF_ERROR(writeNode(output, nodes[begin]));
  }
  return {};
}

// A node of 16^3 leaves, of which the masks are all that is held.
Status BrickWriter::writeNode(VdbOutput& output, const BrickKey& node) {
  std::array<std::uint64_t, 4096 / 64> children = {};
  std::vector<VdbLeafMask> leaves;
  std::uint64_t last = ~std::uint64_t{0};
  while (voxels_.current() != nullptr) {
    const BrickKey key = keyOf(voxels_.current());
    if (!isSameNode(key, node)) break;
    const std::uint64_t leaf = key.second >> kBrickLeafShift & 4095;
    if (leaf != last) leaves.push_back({});
    last = leaf;
    setBit(children, leaf);
    setBit(leaves.back(), key.second & 511);
    SURFEIT_RETURN_IF_ERROR(voxels_.advance());
  }
  SURFEIT_RETURN_IF_ERROR(writeMasks(output, children));
  return output.append(std::as_bytes(std::span(leaves)));
}

Status BrickWriter::writeBuffers(VdbOutput& output, int group, const Grid& grid,
                                 Progress& progress) {
  const std::size_t value_bytes = 4 * grid.components;
  const std::size_t offset = kRecordKeyBytes + 4 * grid.offset;
  std::vector<std::byte> values;
  while (voxels_.current() != nullptr) {
    const BrickKey first = keyOf(voxels_.current());
    if (groupOf(first) != group) break;
    VdbLeafMask mask = {};
    values.clear();
    while (voxels_.current() != nullptr) {
      const BrickKey key = keyOf(voxels_.current());
      if (!isSameLeaf(key, first)) break;
      setBit(mask, key.second & 511);
      const std::byte* value = voxels_.current() + offset;
      values.insert(values.end(), value, value + value_bytes);
      SURFEIT_RETURN_IF_ERROR(voxels_.advance());
    }
    SURFEIT_RETURN_IF_ERROR(output.appendValue(mask));
    SURFEIT_RETURN_IF_ERROR(output.appendValue(std::int8_t{0}));  // inactive are background
    SURFEIT_RETURN_IF_ERROR(output.appendPacked(values, value_bytes));
    progress.advance(values.size() / value_bytes);
  }
  return {};
}

}  // namespace surfeit
