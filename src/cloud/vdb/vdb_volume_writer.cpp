#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <set>

#include "cloud/rows/channels.h"
#include "cloud/vdb/vdb_coding.h"
#include "cloud/vdb/vdb_held_rows.h"
#include "cloud/vdb/vdb_output.h"
#include "cloud/vdb/vdb_writers.h"

namespace surfeit {
namespace {

// A channel as a grid.
struct Grid {
  RowChannel channel;
  std::vector<std::size_t> components;  // of the channel
  std::string name, value_type;         // "float", "vec3s", "int32"
  std::size_t valueBytes() const { return 4 * components.size(); }
};

class VdbVolumeWriter final : public RowWriter {
 public:
  VdbVolumeWriter(std::string path, RowLayout element, const VdbGrid& like,
                  const RowWriterOptions& options)
      : path_(std::move(path)),
        element_(std::move(element)),
        comments_(options.comments),
        progress_(options.progress),
        is_level_set_(like.text("class") == "level set"),
        like_metadata_(like.metadata),
        transform_record_(like.transform_record),
        rows_(path_, element_.row_bytes, sizeof(VdbEntry), options) {}

  Status declare(const RowWriterOptions& options);

  const RowLayout& element() const override { return element_; }
  std::vector<std::string> notes() const override { return notes_; }
  Status writeRows(std::span<const std::byte> rows) override;
  Status finish() override;

 private:
  bool isGrid(const RowChannel& channel);
  void addGrid(const RowChannel& channel, std::vector<std::size_t> components, std::string name);
  VdbCoord voxel(const std::byte* row) const;
  void sortIntoVoxels();
  std::vector<VdbMetadata> gridMetadata(const Grid& grid) const;
  void encode(const Grid& grid, const VdbLeafRun& leaf, std::vector<std::byte>& values) const;
  Status writeGrid(VdbOutput& output, const Grid& grid) const;

  std::string path_;
  RowLayout element_;
  std::vector<std::string> comments_, notes_;
  const Progress* progress_;
  bool is_level_set_ = false, is_finished_ = false;
  std::vector<VdbMetadata> like_metadata_;
  std::vector<std::byte> transform_record_;
  std::vector<Grid> grids_;
  std::size_t voxel_properties_[3] = {};
  VdbHeldRows rows_;
  std::vector<VdbEntry> entries_;
  std::vector<VdbLeafRun> leaves_;
  VdbTreeOrder order_;
};

// Whether a channel is more than where a row lies.
bool VdbVolumeWriter::isGrid(const RowChannel& channel) {
  const bool is_voxel = std::any_of(
      std::begin(voxel_properties_), std::end(voxel_properties_), [&](std::size_t index) {
        return std::find(channel.properties.begin(), channel.properties.end(), index) !=
               channel.properties.end();
      });
  if (is_voxel || channel.name == "position" || channel.name == "radius") return false;
  if (is_level_set_ && channel.name == "distance") {
    notes_.push_back("the level set itself is not written again: rows lack its inside");
    return false;
  }
  return true;
}

void VdbVolumeWriter::addGrid(const RowChannel& channel, std::vector<std::size_t> components,
                              std::string name) {
  const bool is_coded = isCodedColor(channel);
  bool is_whole = !is_coded && components.size() == 1;
  for (const std::size_t component : components) {
    const ValueType type = element_.properties[channel.properties[component]].type;
    is_whole &= type != ValueType::kFloat32 && type != ValueType::kFloat64;
    if (type == ValueType::kFloat64) {
      notes_.push_back(fmt::format("float64 becomes float32: {}", name));
    } else if (is_whole && type == ValueType::kUint32) {
      notes_.push_back(fmt::format("uint32 above 2^31 becomes 2^31 - 1: {}", name));
    }
  }
  if (vdbName(name) != name) {
    notes_.push_back(fmt::format("OpenVDB has letters, digits and _ in names: {} is written as {}",
                                 quoteText(name), vdbName(name)));
  }
  const char* type = is_whole ? "int32" : (components.size() == 3 ? "vec3s" : "float");
  grids_.push_back({channel, std::move(components), vdbName(name), type});
}

Status VdbVolumeWriter::declare(const RowWriterOptions& options) {
  if (options.count.has_value()) SURFEIT_RETURN_IF_ERROR(rows_.checkRoom(*options.count));
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const RowProperty* property = element_.find(kVoxelNames[axis]);
    if (property->type != ValueType::kInt32) {
      return Status::invalidArgument(fmt::format("{}: {} is {}, expected int", path_,
                                                 property->name, valueTypeName(property->type)));
    }
    voxel_properties_[axis] = static_cast<std::size_t>(property - element_.properties.data());
  }
  for (const RowChannel& channel : channelsOf(element_)) {
    if (!isGrid(channel)) continue;
    const std::size_t count = channel.properties.size();
    if (count == 1 || count == 3) {
      std::vector<std::size_t> all(count);
      for (std::size_t i = 0; i < count; ++i) all[i] = i;
      addGrid(channel, std::move(all), channel.name);
      continue;
    }
    for (std::size_t i = 0; i < count; ++i) {
      addGrid(channel, {i}, element_.properties[channel.properties[i]].name);
    }
  }
  if (grids_.empty()) {
    return Status::invalidArgument(
        fmt::format("{}: rows have no channel that a grid could be made of", path_));
  }
  std::set<std::string> names;
  for (const Grid& grid : grids_) {
    if (!names.insert(grid.name).second) {
      return Status::invalidArgument(
          fmt::format("{}: two channels become grid {}", path_, grid.name));
    }
  }
  return {};
}

Status VdbVolumeWriter::writeRows(std::span<const std::byte> rows) { return rows_.append(rows); }

VdbCoord VdbVolumeWriter::voxel(const std::byte* row) const {
  VdbCoord voxel;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    std::memcpy(&voxel[axis], row + element_.properties[voxel_properties_[axis]].offset, 4);
  }
  return voxel;
}

void VdbVolumeWriter::sortIntoVoxels() {
  for (std::uint64_t row = 0; row < rows_.count(); ++row) order_.add(voxel(rows_.row(row)));
  order_.rank();
  entries_.reserve(rows_.count());
  for (std::uint64_t row = 0; row < rows_.count(); ++row) {
    entries_.push_back({order_.key(voxel(rows_.row(row))), row});
  }
  if (!std::is_sorted(entries_.begin(), entries_.end())) {
    std::sort(entries_.begin(), entries_.end());
  }
  // The last row of a voxel counts
  std::size_t kept = 0;
  for (std::size_t i = 0; i < entries_.size(); ++i) {
    if (kept > 0 && entries_[kept - 1].key == entries_[i].key) --kept;
    entries_[kept++] = entries_[i];
  }
  entries_.resize(kept);
  leaves_ = findVdbLeaves(entries_);
}

// That of the source, except for what is about its values and its file.
std::vector<VdbMetadata> VdbVolumeWriter::gridMetadata(const Grid& grid) const {
  constexpr std::string_view kReplaced[] = {"class", "name", "is_saved_as_half_float",
                                            "vector_type", "value_type"};
  std::vector<VdbMetadata> metadata;
  std::string grid_class = "unknown";
  for (const VdbMetadata& entry : like_metadata_) {
    if (entry.name == "class" && !is_level_set_) grid_class = entry.text();
    if (entry.name.starts_with("file_") ||
        std::find(std::begin(kReplaced), std::end(kReplaced), entry.name) != std::end(kReplaced)) {
      continue;
    }
    metadata.push_back(entry);
  }
  VdbCoord least = {}, greatest = {};
  for (std::size_t i = 0; i < entries_.size(); ++i) {
    const VdbCoord place = voxel(rows_.row(entries_[i].row));
    for (std::size_t axis = 0; axis < 3; ++axis) {
      least[axis] = i == 0 ? place[axis] : std::min(least[axis], place[axis]);
      greatest[axis] = i == 0 ? place[axis] : std::max(greatest[axis], place[axis]);
    }
  }
  metadata.push_back(vdbText("class", grid_class));
  metadata.push_back(vdbCoord("file_bbox_max", greatest));
  metadata.push_back(vdbCoord("file_bbox_min", least));
  metadata.push_back(vdbText("file_compression", "blosc + active values"));
  metadata.push_back(vdbInt64("file_voxel_count", static_cast<std::int64_t>(entries_.size())));
  metadata.push_back(vdbBool("is_saved_as_half_float", false));
  metadata.push_back(vdbText("name", grid.name));
  metadata.push_back(vdbText("vector_type", "invariant"));
  return metadata;
}

void VdbVolumeWriter::encode(const Grid& grid, const VdbLeafRun& leaf,
                             std::vector<std::byte>& values) const {
  values.clear();
  for (std::uint64_t i = leaf.begin; i < leaf.end; ++i) {
    const std::byte* row = rows_.row(entries_[i].row);
    for (const std::size_t component : grid.components) {
      const double value = channelValue(element_, grid.channel, component, row);
      std::byte bytes[4];
      if (grid.value_type == "int32") {
        constexpr double kMost = 2147483647;
        const std::int32_t whole = static_cast<std::int32_t>(std::min(value, kMost));
        std::memcpy(bytes, &whole, 4);
      } else {
        const float real = static_cast<float>(value);
        std::memcpy(bytes, &real, 4);
      }
      values.insert(values.end(), bytes, bytes + 4);
    }
  }
}

Status VdbVolumeWriter::writeGrid(VdbOutput& output, const Grid& grid) const {
  SURFEIT_RETURN_IF_ERROR(output.beginGrid(grid.name, "Tree_" + grid.value_type + "_5_4_3",
                                           gridMetadata(grid), transform_record_));
  SURFEIT_RETURN_IF_ERROR(output.appendTree(order_, entries_, leaves_, grid.valueBytes()));
  SURFEIT_RETURN_IF_ERROR(output.endTree());
  std::vector<std::byte> values;
  for (const VdbLeafRun& leaf : leaves_) {
    SURFEIT_RETURN_IF_ERROR(
        output.appendMask(std::span(entries_).subspan(leaf.begin, leaf.end - leaf.begin)));
    SURFEIT_RETURN_IF_ERROR(output.appendValue(std::int8_t{0}));  // inactive are background
    encode(grid, leaf, values);
    SURFEIT_RETURN_IF_ERROR(output.appendPacked(values, grid.valueBytes()));
  }
  return output.endGrid();
}

Status VdbVolumeWriter::finish() {
  if (is_finished_) return Status::invalidArgument(fmt::format("{}: finished already", path_));
  is_finished_ = true;
  sortIntoVoxels();
  SURFEIT_ASSIGN_OR_RETURN(
      VdbOutput output,
      VdbOutput::create(path_, comments_, static_cast<std::uint32_t>(grids_.size()), progress_));
  for (const Grid& grid : grids_) SURFEIT_RETURN_IF_ERROR(writeGrid(output, grid));
  return output.finish();
}

}  // namespace

Result<std::unique_ptr<RowWriter>> createVdbVolumes(const std::string& path, RowLayout element,
                                                    const VdbVolumeReader& like,
                                                    const RowWriterOptions& options) {
  auto writer = std::make_unique<VdbVolumeWriter>(path, std::move(element), like.grid(), options);
  SURFEIT_RETURN_IF_ERROR(writer->declare(options));
  return std::unique_ptr<RowWriter>(std::move(writer));
}

}  // namespace surfeit
