#include "brick/brick_input.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <numbers>
#include <string_view>

#include "cloud/cloud_formats.h"
#include "cloud/rows/surfel_names.h"
#include "index/rows/scene_rows.h"
#include "surfels/rows/surfel_mapping.h"

namespace surfeit {
namespace {

constexpr std::size_t kSliceRows = 4096;
constexpr double kShortNormal = 1e-6;
// Sums of weights must stay floats, shares of directions included.
constexpr double kLeastArea = 1e-30;

// What a gather writes.
constexpr std::string_view kGathered[] = {
    "occlusion",   "irradiance", "bent_normal", "illumination_direction",
    "environment", "fluence",    "reflection",  "sh0",
    "sh1",         "sh2",        "sh3",         "sh4",
    "sh5",         "sh6",        "sh7",         "sh8"};
// What tells of the points themselves.
constexpr std::string_view kGeometry[] = {
    "position", "normal",    "radius",    "pscale",      "width",    "area", "view",
    "group",    "two_sided", "long_side", "light_group", "velocity", "id",   "opacity",
    "voxel_i",  "voxel_j",   "voxel_k",   "pixel_x",     "pixel_y"};

bool contains(std::span<const std::string_view> names, std::string_view name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

BrickChannel brickChannel(const RowLayout& element, const RowChannel& channel) {
  BrickChannel made{channel.name, {}};
  for (const std::size_t index : channel.properties) {
    made.properties.push_back(element.properties[index].name);
  }
  return made;
}

// Channels of 1 or 3 numbers are grids as they are; others become one grid per number.
void addChannels(const RowLayout& element, const RowChannel& channel,
                 std::vector<BrickChannel>& channels) {
  if (channel.properties.size() == 1 || channel.properties.size() == 3) {
    channels.push_back(brickChannel(element, channel));
    return;
  }
  for (const std::size_t index : channel.properties) {
    const std::string& name = element.properties[index].name;
    channels.push_back({name, {name}});
  }
}

}  // namespace

Result<std::vector<BrickChannel>> chooseBrickChannels(const RowLayout& element,
                                                      std::span<const std::string> names,
                                                      const std::string& path) {
  const std::vector<RowChannel> all = channelsOf(element);
  std::vector<std::string> listed;
  for (const RowChannel& channel : all) listed.push_back(channel.name);
  std::vector<BrickChannel> channels;
  for (const std::string& name : names) {
    const auto found = std::find(listed.begin(), listed.end(), name);
    if (found != listed.end()) {
      addChannels(element, all[static_cast<std::size_t>(found - listed.begin())], channels);
    } else if (element.find(name) != nullptr && !element.find(name)->is_list) {
      channels.push_back({name, {name}});
    } else {
      return Status::invalidArgument(fmt::format("{}: no channel \"{}\"; this cloud has: {}", path,
                                                 name, fmt::join(listed, ", ")));
    }
  }
  for (const bool gathered : {true, false}) {
    if (!names.empty() || !channels.empty()) break;
    for (const RowChannel& channel : all) {
      const bool fits =
          gathered ? contains(kGathered, channel.name) : !contains(kGeometry, channel.name);
      if (fits) addChannels(element, channel, channels);
    }
  }
  std::size_t values = 0;
  for (const BrickChannel& channel : channels) values += channel.properties.size();
  if (values == 0 || values > kMaxBrickValues) {
    return Status::invalidArgument(fmt::format(
        "{}: found {} numbers to keep of a point, expected 1 to {}; channels of this cloud: {}",
        path, values, kMaxBrickValues, fmt::join(listed, ", ")));
  }
  return channels;
}

Result<BrickInput> BrickInput::open(const std::string& path, std::span<const BrickChannel> channels,
                                    const RowReaderOptions& reading) {
  BrickInput input;
  SURFEIT_ASSIGN_OR_RETURN(input.reader_, openCloud(path, reading));
  SURFEIT_RETURN_IF_ERROR(input.declare(channels));
  return input;
}

BrickInput::Field BrickInput::find(const char* name) const {
  const RowProperty* property = reader_->element().find(name);
  if (property == nullptr || property->is_list) return {};
  return {property->offset, property->type, true};
}

Status BrickInput::declare(std::span<const BrickChannel> channels) {
  const RowLayout& element = reader_->element();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    position_[axis] = find(kPositionNames[axis]);
    normal_[axis] = find(kNormalNames[axis]);
    if (position_[axis].empty()) {
      return Status::corruption(fmt::format("{}: element {} has no property {}", path(),
                                            element.name, kPositionNames[axis]));
    }
  }
  has_normals_ = std::none_of(normal_.begin(), normal_.end(),
                              [](const Field& field) { return field.empty(); });
  area_ = find("area");
  for (const char* name : kRadiusNames) {
    if (!radius_.empty()) break;
    radius_ = find(name);
    radius_scale_ = std::string_view(name) == "width" ? 0.5 : 1;
  }

  const std::vector<RowChannel> all = channelsOf(element);
  for (const BrickChannel& wanted : channels) {
    for (const std::string& name : wanted.properties) {
      const RowProperty* property = element.find(name);
      if (property == nullptr || property->is_list) {
        return Status::invalidArgument(
            fmt::format("{}: no property {} of channel {}; all clouds of a brick map need its "
                        "channels",
                        path(), name, wanted.name));
      }
      const auto index = static_cast<std::size_t>(property - element.properties.data());
      for (const RowChannel& channel : all) {
        const auto at = std::find(channel.properties.begin(), channel.properties.end(), index);
        if (at == channel.properties.end()) continue;
        values_.push_back({channel, static_cast<std::size_t>(at - channel.properties.begin())});
        const bool is_plain = property->type == ValueType::kFloat32;
        plain_.push_back({property->offset, property->type, is_plain});
        break;
      }
    }
  }
  point_values_.resize(values_.size());
  return {};
}

// What is wrong with the row, or nullptr.
const char* BrickInput::decode(const std::byte* row, BrickInputPoint& point) {
  point.position = {position_[0].read(row), position_[1].read(row), position_[2].read(row)};
  for (int axis = 0; axis < 3; ++axis) {
    if (!(std::abs(point.position[axis]) <= static_cast<double>(kLargestLength))) {
      return "a position that is not finite or too large";
    }
  }
  point.normal = glm::vec3(0);
  if (has_normals_) {
    const glm::dvec3 normal(normal_[0].read(row), normal_[1].read(row), normal_[2].read(row));
    const double length = glm::length(normal);
    if (!std::isfinite(length)) return "a normal that is not finite";
    if (length > kShortNormal) point.normal = glm::vec3(normal / length);
  }
  point.area = 0;
  if (!area_.empty()) {
    point.area = area_.read(row);
  } else if (!radius_.empty()) {
    const double radius = radius_scale_ * radius_.read(row);
    point.area = radius > 0 ? std::numbers::pi * radius * radius : radius;
  }
  if (hasSizes() && !(point.area >= kLeastArea && point.area <= double(kLargestArea))) {
    return "an area or radius that is not positive, or too large or small";
  }
  for (std::size_t i = 0; i < values_.size(); ++i) {
    if (plain_[i].exists) {
      std::memcpy(&point_values_[i], row + plain_[i].offset, sizeof(float));
    } else {
      point_values_[i] = static_cast<float>(
          channelValue(reader_->element(), values_[i].channel, values_[i].component, row));
    }
    if (!std::isfinite(point_values_[i])) return "a value that is not finite";
  }
  point.values = point_values_;
  return nullptr;
}

Status BrickInput::forEach(bool strict, Progress& progress, std::uint64_t* skipped,
                           const std::function<Status(const BrickInputPoint&)>& visit) {
  SURFEIT_RETURN_IF_ERROR(reader_->rewind());
  const std::size_t row_bytes = reader_->element().row_bytes;
  std::uint64_t record = 0, defects = 0, first_defect = 0;
  const char* what = nullptr;
  while (true) {
    if (progress.isCancelled()) return Status::interrupted();
    SURFEIT_ASSIGN_OR_RETURN(const Bytes rows, reader_->readRows(kSliceRows, buffer_));
    if (rows.empty()) break;
    for (std::size_t at = 0; at < rows.size(); at += row_bytes, ++record) {
      BrickInputPoint point;
      const char* defect = decode(rows.data() + at, point);
      if (defect == nullptr) {
        SURFEIT_RETURN_IF_ERROR(visit(point));
        continue;
      }
      if (strict) {
        return Status::corruption(fmt::format("{}: record {}: {}", path(), record, defect));
      }
      if (defects++ == 0) {
        first_defect = record;
        what = defect;
      }
    }
    progress.advance(rows.size() / row_bytes);
  }
  if (defects > 0 && skipped != nullptr) {
    *skipped += defects;
    progress.note(fmt::format("{}: skipped {} records (first: record {}, {})", path(), defects,
                              first_defect, what));
  }
  return {};
}

void BrickExtent::add(const BrickInputPoint& point) {
  least = glm::min(least, point.position);
  greatest = glm::max(greatest, point.position);
  if (points++ == 0) {
    low.assign(point.values.begin(), point.values.end());
    high = low;
  }
  for (std::size_t i = 0; i < low.size(); ++i) {
    low[i] = std::min(low[i], point.values[i]);
    high[i] = std::max(high[i], point.values[i]);
  }
}

double BrickExtent::size() const {
  const glm::dvec3 extent = greatest - least;
  return std::max({extent.x, extent.y, extent.z});
}

void AreaMedian::add(double area) {
  const int bin = static_cast<int>(std::floor((std::log2(area) - kLeastOctave) * kBinsPerOctave));
  ++bins_[static_cast<std::size_t>(std::clamp(bin, 0, kBinsPerOctave * kOctaves - 1))];
  ++count_;
}

double AreaMedian::median() const {
  std::uint64_t below = 0;
  for (std::size_t bin = 0; bin < bins_.size(); ++bin) {
    below += bins_[bin];
    if (2 * below >= count_) {
      return std::exp2((static_cast<double>(bin) + 0.5) / kBinsPerOctave + kLeastOctave);
    }
  }
  return 1;
}

OccupancyArea::OccupancyArea(const BrickExtent& extent)
    : origin_(extent.least), bits_((std::size_t{1} << (3 * kLevels)) / 64) {
  cell_ = std::max(extent.size(), 1e-30) / (1 << kLevels);
}

void OccupancyArea::add(const glm::dvec3& position) {
  std::size_t index = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const double place = (position[axis] - origin_[axis]) / cell_;
    const int last = (1 << kLevels) - 1;
    index = index << kLevels | static_cast<std::size_t>(std::min(static_cast<int>(place), last));
  }
  bits_[index / 64] |= std::uint64_t{1} << (index % 64);
  ++count_;
}

// A surface that cuts M cells of edge h has an area of about 2/3 M h^2. Cells are to hold some
// points each, or they would count the points instead.
double OccupancyArea::area() const {
  std::vector<std::uint64_t> bits = bits_;
  for (int level = kLevels;; --level) {
    std::uint64_t occupied = 0;
    for (const std::uint64_t word : bits)
      occupied += static_cast<std::uint64_t>(std::popcount(word));
    const double cell = cell_ * std::exp2(kLevels - level);
    if (count_ >= 4 * occupied || level == 2) {
      return 2.0 / 3 * static_cast<double>(occupied) * cell * cell / static_cast<double>(count_);
    }
    const std::size_t mask = (std::size_t{1} << level) - 1;
    std::vector<std::uint64_t> coarser((std::size_t{1} << (3 * (level - 1))) / 64 + 1);
    for (std::size_t word = 0; word < bits.size(); ++word) {
      for (std::uint64_t left = bits[word]; left != 0; left &= left - 1) {
        const std::size_t index = word * 64 + static_cast<std::size_t>(std::countr_zero(left));
        const std::size_t x = index >> (2 * level), y = index >> level & mask, z = index & mask;
        const std::size_t up = ((x / 2) << (level - 1) | y / 2) << (level - 1) | z / 2;
        coarser[up / 64] |= std::uint64_t{1} << (up % 64);
      }
    }
    bits = std::move(coarser);
  }
}

}  // namespace surfeit
