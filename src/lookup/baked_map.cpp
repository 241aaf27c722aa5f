#include "lookup/baked_map.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <utility>

#include "brick/brick_layout.h"
#include "cloud/vdb/vdb_file.h"

namespace surfeit {
namespace {

// The distance at which points still count, in spacings: gaps of a bake, and receivers somewhat off
// the surface.
constexpr double kReach = 8;

}  // namespace

bool isBrickMap(const std::string& path) {
  const Result<InputFile> input = InputFile::open(path);
  std::array<std::byte, sizeof kVdbMagic> first{};
  if (!input.ok() || !input->readAt(0, first).ok()) return false;
  if (std::memcmp(first.data(), kVdbMagic.data(), first.size()) != 0) return false;
  const Result<std::shared_ptr<const VdbFile>> file = VdbFile::open(path, Access::kCached);
  return file.ok() &&
         std::any_of((*file)->grids.begin(), (*file)->grids.end(),
                     [](const VdbGrid& grid) { return !grid.text(kBrickVersionName).empty(); });
}

Result<BakedMap> BakedMap::open(const std::string& path, const LookupOptions& options,
                                const BakedMapMemory& memory, Progress& progress) {
  BakedMap map;
  map.interpolation_ = options.interpolation;
  map.filter_width_ = options.filter_width;
  if (isBrickMap(path)) {
    if (options.interpolation == LookupInterpolation::kNearest || options.max_distance > 0) {
      return Status::invalidArgument(fmt::format(
          "{}: a brick map has no points: its voxels are interpolated linearly (look up the cloud "
          "that it was made of for nearest values and a max distance)",
          path));
    }
    SURFEIT_ASSIGN_OR_RETURN(map.brick_, BrickMap::open(path, memory.hold_bytes));
    SURFEIT_RETURN_IF_ERROR(map.chooseOfBrick(path, options.values));
    return map;
  }
  if (options.filter_width > 0) {
    return Status::invalidArgument(fmt::format(
        "{}: a filter width of {} needs a brick map, and this is none (surfeit brick makes one)",
        path, options.filter_width));
  }
  BakedPoints::Options reading;
  reading.path = path;
  reading.values = options.values;
  SURFEIT_ASSIGN_OR_RETURN(reading.reading.channels, parseChannelRenames(options.map_channels));
  reading.reading.filter = options.map_filter;
  reading.reading.selections = std::make_shared<RowSelections>();
  reading.strict = options.strict;
  reading.sort_bytes = memory.open_bytes;
  reading.hold_bytes = memory.hold_bytes;
  reading.threads = memory.threads;
  reading.beside_bytes = memory.beside_bytes;
  reading.temporary_directory = memory.temporary_directory;
  SURFEIT_ASSIGN_OR_RETURN(map.points_, BakedPoints::open(reading, progress));
  map.takePoints(options, path, progress);
  return map;
}

Status BakedMap::chooseOfBrick(const std::string& path, std::span<const std::string> wanted) {
  std::vector<std::string> all;
  std::vector<bool> is_found(wanted.size(), false);
  std::size_t place = 0;
  for (const BrickChannel& channel : brick_->channels()) {
    all.push_back(channel.name);
    bool is_chosen = false;
    for (const std::string& property : channel.properties) {
      bool takes = wanted.empty();
      for (std::size_t i = 0; i < wanted.size(); ++i) {
        if (wanted[i] != channel.name && wanted[i] != property) continue;
        takes = is_found[i] = true;
      }
      if (takes) {
        chosen_.push_back(place);
        names_.push_back(property);
      }
      is_chosen = is_chosen || takes;
      ++place;
    }
    if (is_chosen) channels_.push_back(channel.name);
  }
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    if (is_found[i]) continue;
    return Status::invalidArgument(fmt::format("{}: no channel \"{}\"; this brick map has: {}",
                                               path, wanted[i], fmt::join(all, ", ")));
  }
  return {};
}

void BakedMap::takePoints(const LookupOptions& options, const std::string& path,
                          Progress& progress) {
  for (const BrickChannel& channel : points_->channels()) {
    channels_.push_back(channel.name);
    names_.insert(names_.end(), channel.properties.begin(), channel.properties.end());
  }
  if (!points_->hasNormals()) {
    progress.note(
        fmt::format("{}: no normals: its values count for surfaces of all directions", path));
  }
  reach_ = options.max_distance;
  if (reach_ > 0) return;
  reach_ = kReach * points_->spacing();
  if (reach_ > 0) {
    progress.inform(fmt::format(
        "{}: points up to {:.4g} away count, {:.0f} times their spacing (--max-distance)", path,
        reach_, kReach));
  } else {
    reach_ = std::numeric_limits<double>::infinity();
  }
}

void BakedMap::describe(LookupStats& stats) const {
  stats.is_brick_map = brick_.has_value();
  stats.channels = channels_;
  if (points_ == nullptr) return;
  stats.points = points_->pointCount();
  stats.skipped_points = points_->skippedCount();
  stats.spacing = points_->spacing();
  stats.max_distance = reach_;
  stats.temporary_bytes = points_->temporaryBytes();
  stats.page_loads = points_->loads();
}

BakedMap::Reader::Reader(const BakedMap& map) : map_(map) {
  if (map.points_ != nullptr) {
    search_.emplace(*map.points_, map.interpolation_, map.reach_);
  } else {
    all_.resize(map.brick_->valueCount());
  }
}

Result<bool> BakedMap::Reader::find(const glm::dvec3& position, const glm::vec3& normal,
                                    std::span<float> values) {
  if (search_) return search_->find(position, normal, values);
  SURFEIT_ASSIGN_OR_RETURN(const bool is_found,
                           map_.brick_->lookup(position, normal, map_.filter_width_, all_.data()));
  if (!is_found) return false;
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = all_[map_.chosen_[i]];
  return true;
}

}  // namespace surfeit
