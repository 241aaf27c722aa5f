#include "brick/brick_pages.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <optional>
#include <sstream>

#include "cloud/vdb/vdb_coding.h"

namespace surfeit {
namespace {

// What an entry of the cache costs beside its leaf's values.
constexpr std::size_t kEntryBytes = 128;
constexpr std::uint64_t kLeastCacheBytes = std::uint64_t{1} << 20;

std::optional<int> wholeNumber(const std::string& text) {
  int number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || end != text.data() + text.size()) return {};
  return number;
}

// Passes over the values of a leaf; without unpacking where they are stored as we write them.
Status skipActiveValues(VdbCursor& cursor, const VdbGrid& grid, const VdbValueType& type,
                        const VdbLeafMask& mask, std::vector<std::byte>& scratch) {
  const bool is_packed = (grid.compression & (kVdbZip | kVdbBlosc)) != 0;
  if (!is_packed || (grid.compression & kVdbActiveMask) == 0) {
    return readVdbActiveValues(cursor, grid.compression, type, mask, scratch);
  }
  std::int8_t kind = 0;
  SURFEIT_RETURN_IF_ERROR(cursor.read(kind));
  if (kind != 0) return cursor.corrupt(fmt::format("node values of kind {}, expected 0", kind));
  std::int64_t size = 0;
  SURFEIT_RETURN_IF_ERROR(cursor.read(size));
  const std::uint64_t bytes =
      size < 0 ? ~static_cast<std::uint64_t>(size) + 1 : static_cast<std::uint64_t>(size);
  return cursor.skip(bytes);
}

}  // namespace

const float* BrickLeaf::at(std::size_t voxel, std::size_t floats) const {
  const std::uint64_t below = mask[voxel / 64] & ((std::uint64_t{1} << (voxel % 64)) - 1);
  return data.data() + (rank[voxel / 64] + static_cast<std::size_t>(std::popcount(below))) * floats;
}

std::size_t BrickLeaf::charge() const { return sizeof(BrickLeaf) + 4 * data.size() + kEntryBytes; }

Result<std::unique_ptr<BrickPages>> BrickPages::open(const std::string& path,
                                                     std::uint64_t memory_bytes) {
  auto pages = std::make_unique<BrickPages>();
  SURFEIT_ASSIGN_OR_RETURN(pages->file_, VdbFile::open(path, Access::kCached));
  pages->memory_bytes_ = memory_bytes;
  SURFEIT_RETURN_IF_ERROR(pages->arrangeGrids());
  SURFEIT_RETURN_IF_ERROR(pages->checkGroups());
  for (Group& group : pages->groups_) {
    if (!group.grids.empty()) SURFEIT_RETURN_IF_ERROR(pages->findLeaves(group));
  }
  pages->shard_bytes_ = (memory_bytes - pages->directory_bytes_) / kShards;
  return pages;
}

Status BrickPages::corrupt(const VdbGrid& grid, const std::string& what) const {
  return Status::corruption(
      fmt::format("{}: grid {}: {}", file_->input.path(), quoteText(grid.name), what));
}

// A channel as its grid tells of it.
Status BrickPages::addChannel(const VdbGrid& grid, const std::string& name) {
  BrickChannel channel{name, {}};
  std::istringstream words(grid.text(kBrickPropertiesName));
  for (std::string word; words >> word;) channel.properties.push_back(word);
  const std::optional<VdbValueType> type = vdbValueType(grid);
  const bool fits = type.has_value() && type->type == ValueType::kFloat32 &&
                    type->components == channel.properties.size() &&
                    std::all_of(channel.properties.begin(), channel.properties.end(),
                                [](const std::string& word) { return isPropertyName(word); });
  value_count_ += channel.properties.size();
  if (!fits || name.empty() || value_count_ > kMaxBrickValues) {
    return corrupt(grid, "its properties do not fit its type");
  }
  channels_.push_back(std::move(channel));
  return {};
}

// Sorts the grids by level and direction. The first group names the channels.
Status BrickPages::arrangeGrids() {
  std::vector<std::string> names = {kBrickWeightName};
  for (const VdbGrid& grid : file_->grids) {
    const std::optional<int> version = wholeNumber(grid.text(kBrickVersionName));
    if (version != kBrickVersion) {
      return corrupt(grid, fmt::format("found brick_version {}, expected {}: no brick map",
                                       quoteText(grid.text(kBrickVersionName)), kBrickVersion));
    }
    const std::optional<int> level = wholeNumber(grid.text(kBrickLevelName));
    const auto direction = std::find(kBrickDirectionNames.begin(), kBrickDirectionNames.end(),
                                     grid.text(kBrickDirectionName)) -
                           kBrickDirectionNames.begin();
    if (!level.has_value() || *level < 0 || *level >= kMostBrickLevels ||
        direction == kBrickDirections) {
      return corrupt(grid, "no level and direction of a brick map");
    }
    const double size = std::ldexp(grid.transform.linear[0][0], -*level);
    if (level_count_ == 0) voxel_size_ = size;
    if (!(size > 0) || size != voxel_size_) {
      return corrupt(grid, fmt::format("finest voxels of {}, expected {}", size, voxel_size_));
    }
    level_count_ = std::max(level_count_, *level + 1);

    const std::string name = grid.text(kBrickChannelName);
    const bool is_weight = grid.text(kBrickPropertiesName).empty() && name == kBrickWeightName;
    std::size_t place = 0;
    if (!is_weight) {
      place = 1;
      while (place < names.size() && names[place] != name) ++place;
      if (place == names.size()) {
        SURFEIT_RETURN_IF_ERROR(addChannel(grid, name));
        names.push_back(name);
      }
    }
    Group& group = groups_[static_cast<std::size_t>(*level * kBrickDirections + direction)];
    if (group.grids.size() <= place) group.grids.resize(place + 1);
    if (group.grids[place] != nullptr) return corrupt(grid, "its level and direction come twice");
    group.grids[place] = &grid;
  }
  return {};
}

Status BrickPages::checkGroups() const {
  if (channels_.empty()) {
    return Status::corruption(fmt::format("{}: no grids of a brick map", file_->input.path()));
  }
  for (const Group& group : groups_) {
    if (group.grids.empty()) continue;
    const VdbGrid* some = *std::find_if(group.grids.begin(), group.grids.end(),
                                        [](const VdbGrid* grid) { return grid != nullptr; });
    if (group.grids.size() != channels_.size() + 1 ||
        std::find(group.grids.begin(), group.grids.end(), nullptr) != group.grids.end()) {
      return corrupt(*some, "its level and direction lack a channel or the weights");
    }
    for (std::size_t i = 0; i < group.grids.size(); ++i) {
      const std::optional<VdbValueType> type = vdbValueType(*group.grids[i]);
      const std::size_t components = i == 0 ? 1 : channels_[i - 1].properties.size();
      if (!type.has_value() || type->type != ValueType::kFloat32 ||
          type->components != components) {
        return corrupt(*group.grids[i], fmt::format("type {}, expected {} floats",
                                                    quoteText(group.grids[i]->type), components));
      }
    }
  }
  return {};
}

Status BrickPages::checkMemory() const {
  if (directory_bytes_ + kLeastCacheBytes <= memory_bytes_) return {};
  // What is needed follows from the file's size: no leaf takes less than its masks
  return Status::budgetTooSmall(
      fmt::format("{}: a budget of {} KiB for look-ups does not hold the list of its pages; {} MiB "
                  "will do",
                  file_->input.path(), memory_bytes_ >> 10,
                  (file_->input.size() / 4 + 2 * kLeastCacheBytes) >> 20));
}

Status BrickPages::findLeaves(Group& group) {
  const VdbGrid& weights = *group.grids.front();
  SURFEIT_ASSIGN_OR_RETURN(VdbTreeWalk walk,
                           VdbTreeWalk::open(*file_, weights, *vdbValueType(weights)));
  VdbBlock block;
  while (true) {
    SURFEIT_ASSIGN_OR_RETURN(const bool found, walk.next(block));
    if (!found) break;
    if (!block.is_leaf) return corrupt(weights, "an active tile, expected leaves alone");
    group.origins.push_back(block.origin);
    directory_bytes_ += sizeof(VdbCoord) + 8 * group.grids.size();
    SURFEIT_RETURN_IF_ERROR(checkMemory());
  }
  group.origins.shrink_to_fit();
  group.offsets.resize(group.origins.size() * group.grids.size());
  for (std::size_t grid = 0; grid < group.grids.size(); ++grid) {
    SURFEIT_RETURN_IF_ERROR(findBuffers(group, grid));
  }
  return {};
}

// Where the values of each leaf begin. Every grid must have the leaves and voxels of the others.
Status BrickPages::findBuffers(Group& group, std::size_t grid) {
  const VdbGrid& values = *group.grids[grid];
  const VdbValueType type = *vdbValueType(values);
  SURFEIT_ASSIGN_OR_RETURN(VdbTreeWalk walk, VdbTreeWalk::open(*file_, values, type));
  VdbCursor cursor(file_->input, values.buffers_begin, values.end);
  VdbBlock block;
  std::vector<std::byte> scratch;
  for (std::size_t leaf = 0;; ++leaf) {
    SURFEIT_ASSIGN_OR_RETURN(const bool found, walk.next(block));
    if (found != (leaf < group.origins.size()) ||
        (found && (!block.is_leaf || block.origin != group.origins[leaf]))) {
      return corrupt(values, "its leaves are not those of the other channels");
    }
    if (!found) return {};
    group.offsets[leaf * group.grids.size() + grid] = cursor.offset();
    VdbLeafMask mask = {};
    SURFEIT_RETURN_IF_ERROR(cursor.read(mask));
    if (mask != block.mask)
      return cursor.corrupt("the mask of a leaf differs from that in the tree");
    SURFEIT_RETURN_IF_ERROR(skipActiveValues(cursor, values, type, mask, scratch));
  }
}

double BrickPages::voxelSize(int level) const { return std::ldexp(voxel_size_, level); }

Result<std::shared_ptr<const BrickLeaf>> BrickPages::leaf(int group_index, const VdbCoord& origin) {
  const Group& group = groups_[static_cast<std::size_t>(group_index)];
  const auto found =
      std::lower_bound(group.origins.begin(), group.origins.end(), origin, precedesInTree);
  if (found == group.origins.end() || *found != origin) return std::shared_ptr<const BrickLeaf>();
  const auto number = static_cast<std::uint64_t>(found - group.origins.begin());
  const std::uint64_t key = static_cast<std::uint64_t>(group_index) << 48 | number;

  Shard& shard = shards_[(key ^ key >> 48) % kShards];
  {
    const std::lock_guard lock(shard.mutex);
    if (const auto entry = shard.index.find(key); entry != shard.index.end()) {
      shard.entries.splice(shard.entries.begin(), shard.entries, entry->second);
      return entry->second->second;
    }
  }
  // Two threads may read the same page; the second finds it there
  SURFEIT_ASSIGN_OR_RETURN(std::shared_ptr<const BrickLeaf> loaded, load(group, number));
  const std::lock_guard lock(shard.mutex);
  if (const auto entry = shard.index.find(key); entry != shard.index.end()) {
    return entry->second->second;
  }
  shard.entries.emplace_front(key, loaded);
  shard.index.emplace(key, shard.entries.begin());
  shard.bytes += loaded->charge();
  while (shard.bytes > shard_bytes_ && shard.entries.size() > 1) {
    shard.bytes -= shard.entries.back().second->charge();
    shard.index.erase(shard.entries.back().first);
    shard.entries.pop_back();
  }
  return loaded;
}

// Reads and checks a leaf: masks that agree, weights above 0, values that are finite.
Result<std::shared_ptr<const BrickLeaf>> BrickPages::load(const Group& group,
                                                          std::size_t number) const {
  const std::size_t floats = value_count_ + 1;
  auto leaf = std::make_shared<BrickLeaf>();
  std::vector<std::byte> bytes;
  std::size_t offset = 0;
  for (std::size_t i = 0; i < group.grids.size(); ++i) {
    const VdbGrid& grid = *group.grids[i];
    const VdbValueType type = *vdbValueType(grid);
    const std::size_t next = (number + 1) * group.grids.size() + i;
    VdbCursor cursor(file_->input, group.offsets[number * group.grids.size() + i],
                     next < group.offsets.size() ? group.offsets[next] : grid.end);
    VdbLeafMask mask = {};
    SURFEIT_RETURN_IF_ERROR(cursor.read(mask));
    if (i == 0) {
      leaf->mask = mask;
      std::size_t voxels = 0;
      for (std::size_t word = 0; word < mask.size(); ++word) {
        leaf->rank[word] = static_cast<std::uint16_t>(voxels);
        voxels += static_cast<std::size_t>(std::popcount(mask[word]));
      }
      leaf->data.resize(voxels * floats);
    } else if (mask != leaf->mask) {
      return cursor.corrupt("a leaf has other voxels than in the other channels");
    }
    SURFEIT_RETURN_IF_ERROR(readVdbActiveValues(cursor, grid.compression, type, mask, bytes));
    const std::size_t voxels = leaf->data.size() / floats;
    for (std::size_t voxel = 0; voxel < voxels; ++voxel) {
      float* to = leaf->data.data() + voxel * floats + offset;
      std::memcpy(to, bytes.data() + voxel * type.bytes, type.bytes);
      for (std::size_t c = 0; c < type.components; ++c) {
        if (std::isfinite(to[c]) && (i > 0 || to[c] > 0)) continue;
        return cursor.corrupt(fmt::format("a voxel of value {}, expected a finite one{}", to[c],
                                          i == 0 ? " above 0" : ""));
      }
    }
    offset += type.components;
  }
  return std::shared_ptr<const BrickLeaf>(std::move(leaf));
}

std::uint64_t BrickPages::cachedBytes() const {
  std::uint64_t bytes = 0;
  for (Shard& shard : shards_) {
    const std::lock_guard lock(shard.mutex);
    bytes += shard.bytes;
  }
  return bytes;
}

}  // namespace surfeit
