#include "cloud/vdb/vdb_output.h"

#include <fmt/format.h>
#define XXH_STATIC_LINKING_ONLY  // the state as a member
#include <xxhash.h>

#include <algorithm>
#include <cstring>

#include "cloud/vdb/vdb_coding.h"
#include "cloud/vdb/vdb_tree.h"

namespace surfeit {
namespace {

constexpr std::uint32_t kFileVersion = 224;
constexpr std::array<std::uint32_t, 2> kLibraryVersion = {10, 0};  // the one that we test with

// Bits of a key below the children of the root, and of inner nodes
constexpr int kRootShift = 36;
constexpr int kChildShift[2] = {21, 9};
constexpr std::size_t kChildren[2] = {32768, 4096};

VdbCoord rootOf(const VdbCoord& voxel) {
  return {voxel[0] & ~4095, voxel[1] & ~4095, voxel[2] & ~4095};
}

// `bits` bits of each coordinate from bit `shift`, x first.
std::uint64_t digits(const VdbCoord& voxel, int shift, int bits) {
  std::uint64_t result = 0;
  for (const std::int32_t value : voxel) {
    const std::uint32_t digit = (static_cast<std::uint32_t>(value) >> shift) & ((1u << bits) - 1);
    result = result << bits | digit;
  }
  return result;
}

template <typename T>
VdbMetadata metadataOf(std::string name, const char* type, const T& value) {
  VdbMetadata entry{std::move(name), type, {}};
  const auto bytes = std::as_bytes(std::span(&value, 1));
  entry.value.assign(bytes.begin(), bytes.end());
  return entry;
}

}  // namespace

void VdbTreeOrder::add(const VdbCoord& voxel) {
  const VdbCoord root = rootOf(voxel);
  if (root == last_root_) return;
  last_root_ = root;
  roots_.push_back(root);
  // Clouds in no order come back to the same roots again and again
  if (roots_.size() >= 1024 && (roots_.size() & (roots_.size() - 1)) == 0) rank();
}

void VdbTreeOrder::rank() {
  std::sort(roots_.begin(), roots_.end());
  roots_.erase(std::unique(roots_.begin(), roots_.end()), roots_.end());
  last_root_ = {1, 1, 1};
}

std::uint64_t VdbTreeOrder::key(const VdbCoord& voxel) {
  const VdbCoord root = rootOf(voxel);
  if (root != last_root_) {
    last_root_ = root;
    last_rank_ = static_cast<std::uint64_t>(std::lower_bound(roots_.begin(), roots_.end(), root) -
                                            roots_.begin());
  }
  return last_rank_ << kRootShift | digits(voxel, 7, 5) << kChildShift[0] |
         digits(voxel, 3, 4) << kChildShift[1] | digits(voxel, 0, 3);
}

VdbCoord VdbTreeOrder::leafOrigin(std::uint64_t key) const {
  VdbCoord origin = root(key);
  const std::uint64_t child = key >> kChildShift[0], leaf = key >> kChildShift[1];
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const int back = 2 - static_cast<int>(axis);
    origin[axis] += static_cast<std::int32_t>(((child >> (5 * back)) & 31) << 7 |
                                              ((leaf >> (4 * back)) & 15) << 3);
  }
  return origin;
}

std::vector<VdbLeafRun> findVdbLeaves(std::span<const VdbEntry> entries) {
  std::vector<VdbLeafRun> leaves;
  for (std::uint64_t i = 0; i < entries.size(); ++i) {
    if (i == 0 || entries[i].key >> kChildShift[1] != entries[i - 1].key >> kChildShift[1]) {
      leaves.push_back({i, i});
    }
    leaves.back().end = i + 1;
  }
  return leaves;
}

VdbMetadata vdbText(std::string name, std::string_view text) {
  VdbMetadata entry{std::move(name), "string", {}};
  const auto bytes = std::as_bytes(std::span(text));
  entry.value.assign(bytes.begin(), bytes.end());
  return entry;
}
VdbMetadata vdbInt64(std::string name, std::int64_t value) {
  return metadataOf(std::move(name), "int64", value);
}
VdbMetadata vdbBool(std::string name, bool value) {
  return metadataOf(std::move(name), "bool", static_cast<std::uint8_t>(value));
}
VdbMetadata vdbCoord(std::string name, const VdbCoord& value) {
  return metadataOf(std::move(name), "vec3i", value);
}

struct VdbOutput::State {
  State(AtomicFile opened, const Progress* polled) : file(std::move(opened)), progress(polled) {
    XXH3_128bits_reset(&hash);
  }

  AtomicFile file;
  const Progress* progress;
  XXH3_state_t hash;  // of all that was appended
  std::uint64_t uuid_begin = 0;
  std::uint64_t places_begin = 0;  // of the grid being written
  std::array<std::int64_t, 3> places = {};
  std::vector<std::byte> packed;
};

VdbOutput::VdbOutput(std::unique_ptr<State> state) : state_(std::move(state)) {}
VdbOutput::VdbOutput(VdbOutput&&) noexcept = default;
VdbOutput& VdbOutput::operator=(VdbOutput&&) noexcept = default;
VdbOutput::~VdbOutput() = default;

std::uint64_t VdbOutput::size() const { return state_->file.size(); }

Status VdbOutput::append(Bytes bytes) {
  if (state_->progress != nullptr && state_->progress->isCancelled()) return Status::interrupted();
  XXH3_128bits_update(&state_->hash, bytes.data(), bytes.size());
  return state_->file.append(bytes);
}

Status VdbOutput::appendText(std::string_view text) {
  SURFEIT_RETURN_IF_ERROR(appendValue(static_cast<std::uint32_t>(text.size())));
  return append(std::as_bytes(std::span(text)));
}

Status VdbOutput::patch(std::uint64_t offset, Bytes bytes) {
  return state_->file.writeAt(offset, bytes);
}

namespace {

Status appendMetadata(VdbOutput& output, std::span<const VdbMetadata> metadata) {
  SURFEIT_RETURN_IF_ERROR(output.appendValue(static_cast<std::uint32_t>(metadata.size())));
  for (const VdbMetadata& entry : metadata) {
    SURFEIT_RETURN_IF_ERROR(output.appendText(entry.name));
    SURFEIT_RETURN_IF_ERROR(output.appendText(entry.type));
    SURFEIT_RETURN_IF_ERROR(output.appendValue(static_cast<std::uint32_t>(entry.value.size())));
    SURFEIT_RETURN_IF_ERROR(output.append(entry.value));
  }
  return {};
}

}  // namespace

Result<VdbOutput> VdbOutput::create(const std::string& path, std::span<const std::string> comments,
                                    std::uint32_t grid_count, const Progress* progress) {
  SURFEIT_ASSIGN_OR_RETURN(AtomicFile file, AtomicFile::create(path));
  VdbOutput output(std::make_unique<State>(std::move(file), progress));
  SURFEIT_RETURN_IF_ERROR(output.appendValue(kVdbMagic));
  SURFEIT_RETURN_IF_ERROR(output.appendValue(kFileVersion));
  SURFEIT_RETURN_IF_ERROR(output.appendValue(kLibraryVersion));
  SURFEIT_RETURN_IF_ERROR(output.appendValue(char{1}));  // grids have places
  output.state_->uuid_begin = output.size();
  SURFEIT_RETURN_IF_ERROR(output.appendValue(std::array<char, kVdbUuidBytes>()));
  std::vector<VdbMetadata> metadata = {vdbText("creator", "Surfeit")};
  for (std::size_t i = 0; i < comments.size(); ++i) {
    metadata.push_back(vdbText(fmt::format("comment{:04}", i + 1), comments[i]));
  }
  SURFEIT_RETURN_IF_ERROR(appendMetadata(output, metadata));
  SURFEIT_RETURN_IF_ERROR(output.appendValue(grid_count));
  return output;
}

Status VdbOutput::beginGrid(const std::string& name, const std::string& type,
                            std::span<const VdbMetadata> metadata, Bytes transform_record) {
  SURFEIT_RETURN_IF_ERROR(appendText(name));
  SURFEIT_RETURN_IF_ERROR(appendText(type));
  SURFEIT_RETURN_IF_ERROR(appendText(""));  // no instance
  state_->places_begin = size();
  state_->places = {};
  SURFEIT_RETURN_IF_ERROR(appendValue(state_->places));
  state_->places[0] = static_cast<std::int64_t>(size());
  SURFEIT_RETURN_IF_ERROR(appendValue(kVdbBlosc | kVdbActiveMask));
  SURFEIT_RETURN_IF_ERROR(appendMetadata(*this, metadata));
  return append(transform_record);
}

Status VdbOutput::endTree() {
  state_->places[1] = static_cast<std::int64_t>(size());
  return {};
}

Status VdbOutput::endGrid() {
  state_->places[2] = static_cast<std::int64_t>(size());
  return patch(state_->places_begin, std::as_bytes(std::span(state_->places)));
}

Status VdbOutput::appendTree(const VdbTreeOrder& order, std::span<const VdbEntry> entries,
                             std::span<const VdbLeafRun> leaves, std::size_t value_bytes) {
  SURFEIT_RETURN_IF_ERROR(appendValue(std::uint32_t{1}));  // buffers of a leaf
  SURFEIT_RETURN_IF_ERROR(append(std::vector<std::byte>(value_bytes)));
  const auto root = [&](std::size_t leaf) { return entries[leaves[leaf].begin].key >> kRootShift; };
  std::uint32_t child_count = 0;
  for (std::size_t i = 0; i < leaves.size(); ++i) {
    child_count += i == 0 || root(i) != root(i - 1) ? 1 : 0;
  }
  SURFEIT_RETURN_IF_ERROR(appendValue(std::uint32_t{0}));  // tiles
  SURFEIT_RETURN_IF_ERROR(appendValue(child_count));
  for (std::size_t begin = 0; begin < leaves.size();) {
    std::size_t end = begin + 1;
    while (end < leaves.size() && root(end) == root(begin)) ++end;
    SURFEIT_RETURN_IF_ERROR(appendValue(order.root(entries[leaves[begin].begin].key)));
    SURFEIT_RETURN_IF_ERROR(appendNode(entries, leaves.subspan(begin, end - begin), 0));
    begin = end;
  }
  return {};
}

// An inner node: which children it has, no active tiles, and its children.
Status VdbOutput::appendNode(std::span<const VdbEntry> entries, std::span<const VdbLeafRun> leaves,
                             int depth) {
  const auto child = [&](std::size_t leaf) {
    return entries[leaves[leaf].begin].key >> kChildShift[depth] & (kChildren[depth] - 1);
  };
  std::vector<std::uint64_t> masks(2 * kChildren[depth] / 64);
  for (std::size_t i = 0; i < leaves.size(); ++i) {
    masks[child(i) / 64] |= std::uint64_t{1} << (child(i) % 64);
  }
  SURFEIT_RETURN_IF_ERROR(append(std::as_bytes(std::span(masks))));
  SURFEIT_RETURN_IF_ERROR(appendValue(std::int8_t{0}));   // what is inactive is background
  SURFEIT_RETURN_IF_ERROR(appendValue(std::int64_t{0}));  // no active values
  for (std::size_t begin = 0; begin < leaves.size();) {
    std::size_t end = begin + 1;
    while (end < leaves.size() && child(end) == child(begin)) ++end;
    const std::span<const VdbLeafRun> part = leaves.subspan(begin, end - begin);
    if (depth == 0) {
      SURFEIT_RETURN_IF_ERROR(appendNode(entries, part, 1));
    } else {
      SURFEIT_RETURN_IF_ERROR(
          appendMask(entries.subspan(part[0].begin, part[0].end - part[0].begin)));
    }
    begin = end;
  }
  return {};
}

Status VdbOutput::appendMask(std::span<const VdbEntry> leaf) {
  VdbLeafMask mask = {};
  for (const VdbEntry& entry : leaf) {
    const std::size_t voxel = entry.key & (kVdbLeafVoxels - 1);
    mask[voxel / 64] |= std::uint64_t{1} << (voxel % 64);
  }
  return appendValue(mask);
}

Status VdbOutput::appendPacked(Bytes bytes, std::size_t value_bytes) {
  state_->packed.clear();
  const std::size_t packed =
      bytes.size() < 64 ? bytes.size() : packBlosc(bytes, value_bytes, state_->packed);
  if (packed < bytes.size()) {
    SURFEIT_RETURN_IF_ERROR(appendValue(static_cast<std::int64_t>(packed)));
    return append(state_->packed);
  }
  SURFEIT_RETURN_IF_ERROR(appendValue(-static_cast<std::int64_t>(bytes.size())));
  return append(bytes);
}

Status VdbOutput::finish() {
  const XXH128_hash_t hash = XXH3_128bits_digest(&state_->hash);
  const std::string text = fmt::format("{:08x}-{:04x}-{:04x}-{:04x}-{:012x}", hash.high64 >> 32,
                                       hash.high64 >> 16 & 0xFFFF, hash.high64 & 0xFFFF,
                                       hash.low64 >> 48, hash.low64 & 0xFFFFFFFFFFFF);
  SURFEIT_RETURN_IF_ERROR(patch(state_->uuid_begin, std::as_bytes(std::span(text))));
  return state_->file.commit();
}

}  // namespace surfeit
