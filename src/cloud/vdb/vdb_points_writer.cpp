#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <numeric>
#include <set>

#include "cloud/rows/channels.h"
#include "cloud/vdb/vdb_coding.h"
#include "cloud/vdb/vdb_held_rows.h"
#include "cloud/vdb/vdb_output.h"
#include "cloud/vdb/vdb_tree.h"
#include "cloud/vdb/vdb_writers.h"
#include "cloud/vdb/vdb_written_attribute.h"
#include "storage/byte_coding.h"

namespace surfeit {
namespace {

constexpr std::uint64_t kLeastPointsPerVoxel = 8;
// A leaf takes some 400 bytes besides its points, and far apart more for the nodes above it
constexpr std::uint64_t kLeastPointsPerLeaf = 256;
constexpr std::size_t kLeafLevels = 3;  // the edge of a leaf is that of 2^3 voxels
constexpr int kMortonBits = 20;         // per axis
constexpr std::size_t kPageBytes = 1 << 20;
// Voxel indices stay below this, whatever the place of the cloud
constexpr double kMostIndex = 1 << 30;

// Spreads the lower 20 bits to every third one.
std::uint64_t spreadBits(std::uint64_t value) {
  std::uint64_t spread = 0;
  for (int bit = 0; bit < kMortonBits; ++bit) spread |= ((value >> bit) & 1) << (3 * bit);
  return spread;
}

class VdbPointsWriter final : public RowWriter {
 public:
  VdbPointsWriter(std::string path, RowLayout element, const RowWriterOptions& options)
      : path_(std::move(path)),
        element_(std::move(element)),
        comments_(options.comments),
        progress_(options.progress),
        rows_(path_, element_.row_bytes, sizeof(VdbEntry), options) {}

  Status declare(const RowWriterOptions& options);

  const RowLayout& element() const override { return element_; }
  std::vector<std::string> notes() const override { return notes_; }
  Status writeRows(std::span<const std::byte> rows) override { return rows_.append(rows); }
  Status finish() override;

 private:
  bool position(std::uint64_t row, std::array<double, 3>& position) const;
  void findFinite();
  int finestLevel() const;
  double chooseVoxelSize();
  void sortIntoVoxels();
  void splitPosition(std::uint64_t row, VdbCoord& voxel, float (&local)[3]) const;
  std::vector<VdbMetadata> gridMetadata() const;
  Status writeBuffers(VdbOutput& output);
  Status writeRecords(VdbOutput& output);
  Status writeVoxels(VdbOutput& output, std::uint64_t sizes_begin);
  Status writePages(VdbOutput& output, const VdbWrittenAttribute& attribute,
                    std::uint64_t sizes_begin);
  std::vector<std::size_t> pagesOf(const VdbWrittenAttribute& attribute) const;
  void encode(const VdbWrittenAttribute& attribute, const VdbLeafRun& leaf,
              std::vector<std::byte>& bytes) const;

  std::string path_;
  RowLayout element_;
  std::vector<std::string> comments_, notes_;
  const Progress* progress_;
  std::vector<VdbWrittenAttribute> attributes_;
  std::size_t position_attribute_ = 0;
  VdbHeldRows rows_;
  std::vector<VdbEntry> entries_;
  std::vector<VdbLeafRun> leaves_;
  VdbTreeOrder order_;
  std::array<double, 3> least_ = {}, greatest_ = {};
  double voxel_size_ = 1;
  bool is_finished_ = false;
};

Status VdbPointsWriter::declare(const RowWriterOptions& options) {
  if (options.count.has_value()) SURFEIT_RETURN_IF_ERROR(rows_.checkRoom(*options.count));
  std::set<std::string> names;
  for (const RowChannel& channel : channelsOf(element_)) {
    VdbWrittenAttribute attribute = vdbWrittenAttribute(channel, element_);
    if (!names.insert(attribute.name).second) {
      return Status::invalidArgument(
          fmt::format("{}: two channels become attribute {}", path_, attribute.name));
    }
    if (attribute.name == vdbName(channel.name) && attribute.name != channel.name) {
      notes_.push_back(
          fmt::format("OpenVDB has letters, digits and _ in names: {} is written as {}",
                      quoteText(channel.name), attribute.name));
    }
    if (attribute.kind == VdbWrittenAttribute::Kind::kPosition)
      position_attribute_ = attributes_.size();
    attributes_.push_back(std::move(attribute));
  }
  return {};
}

bool VdbPointsWriter::position(std::uint64_t row, std::array<double, 3>& position) const {
  const RowChannel& channel = attributes_[position_attribute_].channel;
  bool is_finite = true;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const RowProperty& property = element_.properties[channel.properties[axis]];
    position[axis] = rowValue(rows_.row(row) + property.offset, property.type);
    is_finite &= std::isfinite(position[axis]);
  }
  return is_finite;
}

// Makes an entry of every row that has a place, and the bounds of all.
void VdbPointsWriter::findFinite() {
  entries_.reserve(rows_.count());
  for (std::uint64_t row = 0; row < rows_.count(); ++row) {
    std::array<double, 3> place;
    if (!position(row, place)) continue;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      least_[axis] = entries_.empty() ? place[axis] : std::min(least_[axis], place[axis]);
      greatest_[axis] = entries_.empty() ? place[axis] : std::max(greatest_[axis], place[axis]);
    }
    entries_.push_back({0, row});
  }
  if (entries_.size() < rows_.count()) {
    notes_.push_back(
        fmt::format("{} rows without finite positions", rows_.count() - entries_.size()));
  }
}

// How often the extent may be halved. Of entries sorted by Morton keys the points of a voxel of any
// such size follow each other; how many voxels of each are occupied is told by the digits at which
// neighbours first differ. Leaves count too, since points that repeat each other, or lie in tight
// groups, fill voxels of any size: only leaves tell that smaller ones part nothing but the groups.
int VdbPointsWriter::finestLevel() const {
  std::array<std::uint64_t, kMortonBits + 1> occupied = {1};
  for (std::size_t i = 1; i < entries_.size(); ++i) {
    const std::uint64_t differing = entries_[i].key ^ entries_[i - 1].key;
    if (differing == 0) continue;
    const int digit = (static_cast<int>(std::bit_width(differing)) - 1) / 3;
    ++occupied[static_cast<std::size_t>(kMortonBits - digit)];
  }
  std::partial_sum(occupied.begin(), occupied.end(), occupied.begin());
  const auto isTooFine = [&](std::size_t level) {
    const std::uint64_t leaves = level > kLeafLevels ? occupied[level - kLeafLevels] : 1;
    return entries_.size() < kLeastPointsPerVoxel * occupied[level] ||
           (leaves > 1 && entries_.size() < kLeastPointsPerLeaf * leaves);
  };
  int level = 0;
  while (level < kMortonBits && !isTooFine(static_cast<std::size_t>(level) + 1)) ++level;
  return level;
}

double VdbPointsWriter::chooseVoxelSize() {
  double extent = 0, most = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    extent = std::max(extent, greatest_[axis] - least_[axis]);
    most = std::max({most, std::abs(least_[axis]), std::abs(greatest_[axis])});
  }
  const double least_size = most / kMostIndex;
  if (!(extent > 0) || !std::isfinite(extent)) return std::max(least_size, 1.0);
  constexpr double kCells = 1 << kMortonBits;
  for (VdbEntry& entry : entries_) {
    std::array<double, 3> place;
    position(entry.row, place);
    entry.key = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double cell = (place[axis] - least_[axis]) / extent * kCells;
      entry.key |= spreadBits(static_cast<std::uint64_t>(std::min(cell, kCells - 1))) << axis;
    }
  }
  std::sort(entries_.begin(), entries_.end());
  return std::max(std::ldexp(extent, -finestLevel()), least_size);
}

// The voxel of a row, and its place from the voxel's centre, in voxels.
void VdbPointsWriter::splitPosition(std::uint64_t row, VdbCoord& voxel, float (&local)[3]) const {
  std::array<double, 3> place;
  position(row, place);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double index = place[axis] / voxel_size_;
    const double whole = std::floor(index + 0.5);
    voxel[axis] = static_cast<std::int32_t>(whole);
    local[axis] = static_cast<float>(index - whole);
  }
}

void VdbPointsWriter::sortIntoVoxels() {
  VdbCoord voxel;
  float local[3];
  for (const VdbEntry& entry : entries_) {
    splitPosition(entry.row, voxel, local);
    order_.add(voxel);
  }
  order_.rank();
  for (VdbEntry& entry : entries_) {
    splitPosition(entry.row, voxel, local);
    entry.key = order_.key(voxel);
  }
  std::sort(entries_.begin(), entries_.end());
  leaves_ = findVdbLeaves(entries_);
}

std::vector<VdbMetadata> VdbPointsWriter::gridMetadata() const {
  VdbCoord least = {}, greatest = {};
  std::int64_t voxel_count = 0;
  for (std::size_t i = 0; i < entries_.size(); ++i) {
    if (i > 0 && entries_[i].key == entries_[i - 1].key) continue;
    VdbCoord voxel;
    float local[3];
    splitPosition(entries_[i].row, voxel, local);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      least[axis] = i == 0 ? voxel[axis] : std::min(least[axis], voxel[axis]);
      greatest[axis] = i == 0 ? voxel[axis] : std::max(greatest[axis], voxel[axis]);
    }
    ++voxel_count;
  }
  return {vdbText("class", "unknown"),
          vdbCoord("file_bbox_max", greatest),
          vdbCoord("file_bbox_min", least),
          vdbText("file_compression", "blosc + active values"),
          vdbInt64("file_voxel_count", voxel_count),
          vdbBool("is_saved_as_half_float", false),
          vdbText("name", "points"),
          vdbText("vector_type", "invariant")};
}

// A descriptor for all leaves, then what each leaf's arrays are.
Status VdbPointsWriter::writeRecords(VdbOutput& output) {
  SURFEIT_RETURN_IF_ERROR(output.appendValue(std::uint8_t{1}));  // for all leaves
  SURFEIT_RETURN_IF_ERROR(output.appendValue(static_cast<std::uint64_t>(attributes_.size())));
  std::vector<std::pair<std::string, std::uint64_t>> names;
  for (const VdbWrittenAttribute& attribute : attributes_) {
    SURFEIT_RETURN_IF_ERROR(output.appendText(attribute.value_type));
    SURFEIT_RETURN_IF_ERROR(output.appendText("null"));
    names.emplace_back(attribute.name, names.size());
  }
  std::sort(names.begin(), names.end());
  for (const auto& [name, index] : names) {
    SURFEIT_RETURN_IF_ERROR(output.appendText(name));
    SURFEIT_RETURN_IF_ERROR(output.appendValue(index));
  }
  SURFEIT_RETURN_IF_ERROR(output.appendValue(std::uint64_t{0}));  // groups
  SURFEIT_RETURN_IF_ERROR(output.appendValue(std::uint32_t{0}));  // metadata
  for (const VdbLeafRun& leaf : leaves_) {
    const std::uint64_t size = leaf.end - leaf.begin;
    for (const VdbWrittenAttribute& attribute : attributes_) {
      const std::uint64_t bytes = size * attribute.pointBytes();
      if (bytes > kVdbMaxArrayBytes) {
        return Status::failed(
            fmt::format("{}: {} points in 8^3 voxels of edge {} have {} bytes of attribute {}, "
                        "expected at most {}: leave out what lies far away from most, or convert "
                        "the cloud in parts",
                        path_, size, voxel_size_, bytes, attribute.name, kVdbMaxArrayBytes));
      }
      const bool is_strided = attribute.stride != 1;
      SURFEIT_RETURN_IF_ERROR(output.appendValue(bytes + 6));
      SURFEIT_RETURN_IF_ERROR(output.appendValue(kVdbConstantStride));
      SURFEIT_RETURN_IF_ERROR(output.appendValue(
          static_cast<std::uint8_t>(kVdbPaged | (is_strided ? kVdbStrided : 0))));
      SURFEIT_RETURN_IF_ERROR(output.appendValue(static_cast<std::uint32_t>(size)));
      if (is_strided) SURFEIT_RETURN_IF_ERROR(output.appendValue(attribute.stride));
    }
  }
  return {};
}

// Masks, and where the points of each voxel end; the sizes of the latter go to `sizes_begin`.
Status VdbPointsWriter::writeVoxels(VdbOutput& output, std::uint64_t sizes_begin) {
  std::vector<std::uint16_t> sizes;
  std::vector<std::byte> packed;
  for (const VdbLeafRun& leaf : leaves_) {
    const std::span<const VdbEntry> entries =
        std::span(entries_).subspan(leaf.begin, leaf.end - leaf.begin);
    std::array<std::uint32_t, kVdbLeafVoxels> ends = {};
    for (const VdbEntry& entry : entries) ++ends[entry.key & (kVdbLeafVoxels - 1)];
    for (std::size_t i = 1; i < ends.size(); ++i) ends[i] += ends[i - 1];
    packed.clear();
    packBlosc(std::as_bytes(std::span(ends)), sizeof(ends[0]), packed);
    sizes.push_back(static_cast<std::uint16_t>(packed.size()));
    SURFEIT_RETURN_IF_ERROR(output.appendMask(entries));
    SURFEIT_RETURN_IF_ERROR(output.appendValue(sizes.back()));
    SURFEIT_RETURN_IF_ERROR(output.append(packed));
  }
  return output.patch(sizes_begin, std::as_bytes(std::span(sizes)));
}

// The leaves at which pages of an attribute end: as many arrays as a page holds, at least one.
std::vector<std::size_t> VdbPointsWriter::pagesOf(const VdbWrittenAttribute& attribute) const {
  std::vector<std::size_t> ends;
  std::uint64_t page_bytes = 0;
  for (std::size_t i = 0; i < leaves_.size(); ++i) {
    const std::uint64_t bytes = (leaves_[i].end - leaves_[i].begin) * attribute.pointBytes();
    if (i > 0 && page_bytes + bytes > kPageBytes) {
      ends.push_back(i);
      page_bytes = 0;
    }
    page_bytes += bytes;
  }
  if (!leaves_.empty()) ends.push_back(leaves_.size());
  return ends;
}

// Appends the array of a leaf.
void VdbPointsWriter::encode(const VdbWrittenAttribute& attribute, const VdbLeafRun& leaf,
                             std::vector<std::byte>& bytes) const {
  std::size_t next = bytes.size();
  bytes.resize(next + (leaf.end - leaf.begin) * attribute.pointBytes());
  for (std::uint64_t i = leaf.begin; i < leaf.end; ++i) {
    std::byte* out = bytes.data() + next;
    next += attribute.pointBytes();
    if (attribute.kind == VdbWrittenAttribute::Kind::kPosition) {
      VdbCoord voxel;
      float local[3];
      splitPosition(entries_[i].row, voxel, local);
      std::memcpy(out, local, sizeof(local));
    } else {
      encodeVdbPoint(attribute, element_, rows_.row(entries_[i].row), out);
    }
  }
}

// The pages of an attribute; their sizes go to `sizes_begin`.
Status VdbPointsWriter::writePages(VdbOutput& output, const VdbWrittenAttribute& attribute,
                                   std::uint64_t sizes_begin) {
  std::vector<std::array<std::int32_t, 2>> sizes;
  std::vector<std::byte> page, packed;
  std::size_t leaf = 0;
  for (const std::size_t end : pagesOf(attribute)) {
    page.clear();
    packed.clear();
    for (; leaf < end; ++leaf) encode(attribute, leaves_[leaf], page);
    packBlosc(page, attribute.component_bytes, packed);
    sizes.push_back(
        {static_cast<std::int32_t>(packed.size()), static_cast<std::int32_t>(page.size())});
    SURFEIT_RETURN_IF_ERROR(output.append(packed));
  }
  return output.patch(sizes_begin, std::as_bytes(std::span(sizes)));
}

// All passes; sizes that stand in front of what they are of are completed behind it.
Status VdbPointsWriter::writeBuffers(VdbOutput& output) {
  if (leaves_.empty()) return output.appendValue(std::uint16_t{0});
  SURFEIT_RETURN_IF_ERROR(
      output.appendValue(static_cast<std::uint16_t>(4 + 2 * attributes_.size())));
  const std::uint64_t voxel_sizes = output.size();
  SURFEIT_RETURN_IF_ERROR(output.append(std::vector<std::byte>(2 * leaves_.size())));
  SURFEIT_RETURN_IF_ERROR(writeRecords(output));
  std::vector<std::uint64_t> page_sizes;
  for (const VdbWrittenAttribute& attribute : attributes_) {
    page_sizes.push_back(output.size());
    SURFEIT_RETURN_IF_ERROR(output.append(std::vector<std::byte>(8 * pagesOf(attribute).size())));
  }
  SURFEIT_RETURN_IF_ERROR(writeVoxels(output, voxel_sizes));
  for (std::size_t i = 0; i < attributes_.size(); ++i) {
    SURFEIT_RETURN_IF_ERROR(writePages(output, attributes_[i], page_sizes[i]));
  }
  return {};
}

Status VdbPointsWriter::finish() {
  if (is_finished_) return Status::invalidArgument(fmt::format("{}: finished already", path_));
  is_finished_ = true;
  findFinite();
  voxel_size_ = chooseVoxelSize();
  sortIntoVoxels();

  // A uniform scale, with the values that OpenVDB derives from it
  std::vector<std::byte> transform;
  ByteWriter writer(transform);
  constexpr std::string_view kType = "UniformScaleMap";
  writer.put(static_cast<std::uint32_t>(kType.size()));
  writer.putBytes(std::as_bytes(std::span(kType)));
  const double h = voxel_size_;
  for (const double value : {h, h, 1 / h, 1 / (h * h), 0.5 / h}) {
    for (int axis = 0; axis < 3; ++axis) writer.put(value);
  }

  SURFEIT_ASSIGN_OR_RETURN(VdbOutput output, VdbOutput::create(path_, comments_, 1, progress_));
  SURFEIT_RETURN_IF_ERROR(
      output.beginGrid("points", "Tree_ptdataidx32_5_4_3", gridMetadata(), transform));
  SURFEIT_RETURN_IF_ERROR(output.appendTree(order_, entries_, leaves_, sizeof(std::uint32_t)));
  SURFEIT_RETURN_IF_ERROR(output.endTree());
  SURFEIT_RETURN_IF_ERROR(writeBuffers(output));
  SURFEIT_RETURN_IF_ERROR(output.endGrid());
  return output.finish();
}

}  // namespace

Result<std::unique_ptr<RowWriter>> createVdbPoints(const std::string& path, RowLayout element,
                                                   const RowWriterOptions& options) {
  auto writer = std::make_unique<VdbPointsWriter>(path, std::move(element), options);
  SURFEIT_RETURN_IF_ERROR(writer->declare(options));
  return std::unique_ptr<RowWriter>(std::move(writer));
}

}  // namespace surfeit
