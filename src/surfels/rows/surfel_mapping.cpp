#include "surfels/rows/surfel_mapping.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <string_view>
#include <vector>

#include "cloud/rows/channels.h"
#include "cloud/rows/srgb_curve.h"
#include "cloud/rows/surfel_names.h"
#include "core/assert.h"
#include "core/long_side.h"
#include "core/surfel_normal.h"

namespace surfeit {
namespace {

// Of codes of 8 bits.
const std::array<float, 256>& linearFromSrgb8() {
  static const std::array<float, 256> table = [] {
    std::array<float, 256> values{};
    for (std::size_t i = 0; i < values.size(); ++i) {
      values[i] = static_cast<float>(linearFromSrgbCode(static_cast<double>(i) / 255));
    }
    return values;
  }();
  return table;
}

// Whether a float can hold the value; false for NaN too.
bool fitsFloat(double value) { return std::abs(value) <= std::numeric_limits<float>::max(); }

// A property whose name differs by a letter or two that changed places; empty: none.
std::string misspeltAs(const RowLayout& element, std::string_view name) {
  for (const RowProperty& property : element.properties) {
    if (property.is_list || property.name.size() != name.size() || name.size() < 4) continue;
    std::size_t others = 0;
    for (std::size_t i = 0; i < name.size(); ++i) others += property.name[i] != name[i] ? 1 : 0;
    if (others == 1) return property.name;
    std::string ours(name), theirs(property.name);
    std::sort(ours.begin(), ours.end());
    std::sort(theirs.begin(), theirs.end());
    if (others == 2 && ours == theirs) return property.name;
  }
  return {};
}

}  // namespace

// The property of that name, absent when the element has none. `name` must outlive the mapping.
Result<SurfelMapping::Field> SurfelMapping::findField(const RowLayout& element, const char* name,
                                                      const std::string& path) {
  Field field;
  field.name = name;
  const RowProperty* property = element.find(name);
  if (property == nullptr) return field;
  if (property->is_list) {
    return Status::corruption(fmt::format(
        "{}: element {}: property {} is a list, expected a scalar", path, element.name, name));
  }
  field.offset = static_cast<std::ptrdiff_t>(property->offset);
  field.type = property->type;
  return field;
}

// Finds all three properties or none, and says whether they are there. One or two of three are
// more likely a mistake than a cloud without that channel.
Result<bool> SurfelMapping::findTriple(const RowLayout& element, const char* const (&names)[3],
                                       const std::string& path, Field (&fields)[3]) {
  const char* missing = nullptr;
  const char* found = nullptr;
  std::string drops;
  for (int i = 0; i < 3; ++i) {
    SURFEIT_ASSIGN_OR_RETURN(fields[i], findField(element, names[i], path));
    (fields[i].isPresent() ? found : missing) = names[i];
    if (!fields[i].isPresent()) continue;
    drops += fmt::format("{}{}", drops.empty() ? "" : ",", dropsOf(element, names[i]));
  }
  if (found != nullptr && missing != nullptr) {
    std::string advice = std::string_view(names[0]) == kPositionNames[0]
                             ? ""
                             : fmt::format(": --channels {} leaves out what there is", drops);
    if (const std::string misspelt = misspeltAs(element, missing); !misspelt.empty()) {
      advice = fmt::format(": --channels {}={} takes {} for it", misspelt, missing, misspelt);
    }
    return Status::corruption(fmt::format("{}: element {}: found property {} without {}{}", path,
                                          element.name, found, missing, advice));
  }
  return found != nullptr;
}

Result<SurfelMapping> SurfelMapping::create(const RowLayout& element, const std::string& path) {
  SurfelMapping mapping;
  CloudChannels& channels = mapping.channels_;

  // Position and normal
  SURFEIT_ASSIGN_OR_RETURN(const bool has_position,
                           findTriple(element, kPositionNames, path, mapping.position_));
  if (!has_position) {
    return Status::corruption(
        fmt::format("{}: element {}: found no properties x, y, z", path, element.name));
  }
  SURFEIT_ASSIGN_OR_RETURN(channels.normal,
                           findTriple(element, kNormalNames, path, mapping.normal_));

  // Radius by the first of its names, area
  for (const char* name : kRadiusNames) {
    SURFEIT_ASSIGN_OR_RETURN(mapping.radius_, findField(element, name, path));
    mapping.radius_scale_ = std::string_view(name) == "width" ? 0.5 : 1.0;
    channels.radius = mapping.radius_.isPresent();
    if (channels.radius) break;
  }
  SURFEIT_ASSIGN_OR_RETURN(mapping.area_, findField(element, "area", path));
  channels.area = mapping.area_.isPresent();
  if (channels.radius && !channels.area) {
    SURFEIT_ASSIGN_OR_RETURN(mapping.coverage_, findField(element, "coverage", path));
  }

  // Radiosity and albedo; colors stand in for what is absent
  SURFEIT_ASSIGN_OR_RETURN(channels.radiosity,
                           findTriple(element, kRadiosityNames, path, mapping.radiosity_));
  SURFEIT_ASSIGN_OR_RETURN(channels.albedo,
                           findTriple(element, kAlbedoNames, path, mapping.albedo_));
  for (int i = 0; i < 3; ++i) {
    mapping.radiosity_[i].is_srgb = codesSrgb(mapping.radiosity_[i].type);
    mapping.albedo_[i].is_srgb = codesSrgb(mapping.albedo_[i].type);
  }
  if (!channels.radiosity || !channels.albedo) {
    Field color[3];
    SURFEIT_ASSIGN_OR_RETURN(const bool has_color, findTriple(element, kColorNames, path, color));
    for (Field& field : color) {
      field.is_srgb = codesSrgb(field.type);
      if (!field.is_srgb && !isFloatType(field.type)) {
        return Status::corruption(fmt::format(
            "{}: element {}: property {} is {}, expected uchar, ushort, float or double", path,
            element.name, field.name, valueTypeName(field.type)));
      }
    }
    if (has_color && !channels.radiosity) std::copy(color, color + 3, mapping.radiosity_);
    if (has_color && !channels.albedo) std::copy(color, color + 3, mapping.albedo_);
    channels.radiosity = channels.radiosity || has_color;
    channels.albedo = channels.albedo || has_color;
  }

  if (!mapping.coverage_.isPresent()) {
    SURFEIT_ASSIGN_OR_RETURN(channels.tint,
                             findTriple(element, kOpacityNames, path, mapping.opacity_));
    if (!channels.tint) {
      SURFEIT_ASSIGN_OR_RETURN(mapping.opacity_[0], findField(element, "opacity", path));
    }
    channels.opacity = mapping.opacity_[0].isPresent();
  }
  SURFEIT_ASSIGN_OR_RETURN(mapping.two_sided_, findField(element, "two_sided", path));
  channels.two_sided = mapping.two_sided_.isPresent();
  SURFEIT_ASSIGN_OR_RETURN(channels.long_side,
                           findTriple(element, kLongSideNames, path, mapping.long_side_));

  // Group by the first of its names
  for (const char* name : kGroupNames) {
    SURFEIT_ASSIGN_OR_RETURN(mapping.group_, findField(element, name, path));
    channels.group = mapping.group_.isPresent();
    if (channels.group) break;
  }
  mapping.findDrops(element);
  mapping.row_bytes_ = element.row_bytes;
  mapping.fast_decoder_ = mapping.makeFastDecoder();
  return mapping;
}

// What a user types, so that records are read without their bad values.
void SurfelMapping::findDrops(const RowLayout& element) {
  for (const RowProperty& property : element.properties) {
    const std::string channel(channelToDrop(property.name));
    if (channel.empty() || !isSurfelProperty(property.name)) continue;
    drops_.try_emplace(channel, dropsOf(element, channel));
  }
  // A value of either, whichever a color stands in for
  if (!drops_.contains("color")) drops_["color"] = "color=-";
}

void SurfelMapping::setOrigin(const glm::dvec3& origin) {
  origin_ = origin;
  fast_decoder_ = makeFastDecoder();
}

// The decoder of rows whose used properties are floats about an origin of 0, but for colors of 8
// bits and a two_sided of a byte; nothing when there is any other, long sides or opacity. Its
// limits are those of decodeRow.
std::optional<FloatRowDecoder> SurfelMapping::makeFastDecoder() const {
  FloatRowDecoder decoder(row_bytes_);
  bool is_fast = !channels_.long_side && !channels_.opacity && !coverage_.isPresent() &&
                 origin_ == glm::dvec3(0);
  const auto add = [&](const Field& field, std::size_t place, float least, float most) {
    if (!field.isPresent()) return;
    const std::size_t offset = static_cast<std::size_t>(field.offset);
    if (field.type == ValueType::kFloat32) {
      decoder.addFloat(offset, place, least, most);
    } else if (field.type == ValueType::kUint8 && field.is_srgb) {
      decoder.addByte(offset, place, linearFromSrgb8());
    } else {
      is_fast = false;
    }
  };
  const auto addTriple = [&](const Field(&fields)[3], std::size_t place, float least, float most) {
    for (std::size_t i = 0; i < 3; ++i) add(fields[i], place + i * sizeof(float), least, most);
  };
  constexpr float kLargestFloat = std::numeric_limits<float>::max();
  // Sizes below go the slow way: a thread may take subnormal numbers for zero
  constexpr float kMoreThanZero = std::numeric_limits<float>::min();
  addTriple(position_, offsetof(Surfel, position), -kLargestLength, kLargestLength);
  addTriple(normal_, offsetof(Surfel, normal), -kLargestFloat, kLargestFloat);
  add(radius_, offsetof(Surfel, radius), kMoreThanZero, kLargestLength);
  add(area_, offsetof(Surfel, area), kMoreThanZero, kLargestArea);
  addTriple(radiosity_, offsetof(Surfel, radiosity), 0, kLargestColor);
  addTriple(albedo_, offsetof(Surfel, albedo), 0, kLargestColor);
  decoder.setRadiusScale(static_cast<float>(radius_scale_));

  if (two_sided_.isPresent()) {
    is_fast &= valueTypeBytes(two_sided_.type) == 1;
    decoder.setTwoSided(static_cast<std::size_t>(two_sided_.offset));
  }
  is_fast &= !group_.isPresent() || !isFloatType(group_.type);
  if (group_.isPresent() && is_fast) {
    decoder.setGroup(static_cast<std::size_t>(group_.offset), valueTypeBytes(group_.type));
  }
  if (!is_fast) return std::nullopt;
  return decoder;
}

// The value as the surfel has it, not yet checked. The two types of nearly all clouds go first.
double SurfelMapping::Field::read(const std::byte* row) const {
  if (type == ValueType::kFloat32) {
    float value;
    std::memcpy(&value, row + offset, sizeof value);
    return value;
  }
  if (!is_srgb) return rowValue(row + offset, type);
  if (type == ValueType::kUint8)
    return linearFromSrgb8()[std::to_integer<std::size_t>(row[offset])];
  return linearFromSrgbCode(rowValue(row + offset, type) / 65535);
}

double SurfelMapping::Field::whole() const {
  return isFloatType(type) ? 1 : valueTypeBytes(type) == 1 ? 255 : 65535;
}

glm::dvec3 SurfelMapping::positionOf(const std::byte* row) const {
  return {position_[0].read(row), position_[1].read(row), position_[2].read(row)};
}

SurfelMapping::Defect SurfelMapping::decodeRow(const std::byte* row, Surfel& surfel) const {
  // Read all values, so that a value that is not finite goes before any other defect
  Defect defect;
  const auto read = [&](const Field& field) {
    if (!field.isPresent()) return 0.0;
    const double value = field.read(row);
    if (!fitsFloat(value) && defect.kind == nullptr) {
      defect = {&SurfelDefects::non_finite, field.name, value, "a number that a float can hold"};
    }
    return value;
  };
  double position[3], normal[3], radiosity[3], albedo[3], long_side[3], opacity[3];
  for (int i = 0; i < 3; ++i) {
    position[i] = read(position_[i]);
    normal[i] = read(normal_[i]);
    radiosity[i] = read(radiosity_[i]);
    albedo[i] = read(albedo_[i]);
    long_side[i] = read(long_side_[i]);
    opacity[i] = read(opacity_[i]) / opacity_[i].whole();
  }
  const double radius = radius_scale_ * read(radius_);
  const double area = read(area_);
  const bool is_two_sided = read(two_sided_) != 0;
  const double coverage = read(coverage_);
  const double group = read(group_);
  if (defect.kind != nullptr) return defect;

  // Radius and area as floats: what is too small for a float is zero
  surfel = Surfel{};
  surfel.radius = static_cast<float>(radius);
  if (radius_.isPresent() && surfel.radius <= 0) {
    return {&SurfelDefects::bad_radius, radius_.name, radius_.read(row), "more than 0"};
  }
  surfel.area = static_cast<float>(area);
  if (area_.isPresent() && surfel.area <= 0) {
    return {&SurfelDefects::bad_area, area_.name, area, "more than 0"};
  }

  if (coverage_.isPresent()) {
    if (!(coverage > 0 && coverage <= 1)) {
      return {&SurfelDefects::bad_area, coverage_.name, coverage, "more than 0 and at most 1"};
    }
    surfel.area = -static_cast<float>(coverage);
  }

  if (surfel.radius > kLargestLength) {
    return {&SurfelDefects::out_of_range, radius_.name, radius_.read(row), "at most 1e12"};
  }
  if (surfel.area > kLargestArea) {
    return {&SurfelDefects::out_of_range, area_.name, area, "at most 1e24"};
  }

  switch (normalise(normal[0], normal[1], normal[2], surfel.normal)) {
    case NormalKind::kDirection:
      break;
    case NormalKind::kNone:
      surfel.flags |= kSurfelSphere;
      break;
    case NormalKind::kTooShort:
      return {&SurfelDefects::short_normal, "length of nx, ny, nz",
              normalLength(normal[0], normal[1], normal[2]), "0 or at least 1e-6"};
  }
  if (is_two_sided) surfel.flags |= kSurfelTwoSided;
  if (surfel.area > 0) {
    setLongSide({static_cast<float>(long_side[0]), static_cast<float>(long_side[1]),
                 static_cast<float>(long_side[2])},
                surfel);
  }

  for (int i = 0; i < 3; ++i) {
    if (radiosity[i] < 0) {
      return {&SurfelDefects::negative_color, radiosity_[i].name, radiosity[i], "0 or more"};
    }
    if (albedo[i] < 0) {
      return {&SurfelDefects::negative_color, albedo_[i].name, albedo[i], "0 or more"};
    }
    if (std::abs(position[i]) > kLargestLength) {
      return {&SurfelDefects::out_of_range, position_[i].name, position[i], "at most 1e12"};
    }
    if (std::max(radiosity[i], albedo[i]) > kLargestColor) {
      return {&SurfelDefects::out_of_range, "color", std::max(radiosity[i], albedo[i]),
              "at most 1e12"};
    }
    surfel.position[i] = static_cast<float>(position[i] - origin_[i]);
    surfel.radiosity[i] = static_cast<float>(radiosity[i]);
    surfel.albedo[i] = static_cast<float>(albedo[i]);
  }

  // Some formats have no type but floats
  if (!(group >= 0 && group < kMaxGroups && group == std::floor(group))) {
    return {&SurfelDefects::bad_group, group_.name, group, "0 to 63"};
  }
  surfel.group = static_cast<std::uint8_t>(group);
  if (!channels_.opacity) return {};
  // Clear in all colors is nothing, in one it is a tint
  const double most = channels_.tint ? std::max({opacity[0], opacity[1], opacity[2]}) : opacity[0];
  for (int i = 0; i < (channels_.tint ? 3 : 1); ++i) {
    if (opacity[i] >= 0 && opacity[i] <= 1 && most > 0) continue;
    return {&SurfelDefects::bad_opacity, opacity_[i].name, opacity[i], "more than 0 and at most 1"};
  }
  surfel.transparency = transparencyOf(opacity[0]);
  if (channels_.tint) surfel.setOpacity(opacity[0], opacity[1], opacity[2]);
  return {};
}

bool SurfelMapping::decode(const std::byte* row, std::uint64_t record, Surfel& surfel,
                           SurfelDefects& defects) const {
  const Defect defect = decodeRow(row, surfel);
  if (defect.kind == nullptr) return true;
  const auto drops = drops_.find(channelToDrop(defect.property));
  (defects.*defect.kind)
      .add(record, defect.property, defect.value,
           drops == drops_.end() ? std::string() : drops->second);
  return false;
}

std::size_t SurfelMapping::decodeRows(std::span<const std::byte> rows, std::uint64_t first_record,
                                      std::span<Surfel> surfels, SurfelDefects& defects) const {
  const std::size_t row_count = rows.size() / row_bytes_;
  SURFEIT_ASSERT(rows.size() % row_bytes_ == 0 && surfels.size() >= row_count);
  std::size_t size = 0;
  for (std::size_t begin = 0; begin < row_count; begin += FloatRowDecoder::kBlockRows) {
    const std::size_t count = std::min(FloatRowDecoder::kBlockRows, row_count - begin);
    const std::byte* const block = rows.data() + begin * row_bytes_;
    std::uint64_t left_over = ~std::uint64_t{0};
    if (fast_decoder_) left_over = fast_decoder_->decode(block, count, &surfels[size]);
    if (left_over == 0) {
      size += count;
      continue;
    }

    // Valid surfels move up to where the invalid ones leave room
    const std::size_t block_size = size;
    for (std::size_t i = 0; i < count; ++i) {
      if ((left_over >> i & 1) == 0) {
        surfels[size] = surfels[block_size + i];
        ++size;
      } else if (decode(block + i * row_bytes_, first_record + begin + i, surfels[size], defects)) {
        ++size;
      }
    }
  }
  return size;
}

std::string SurfelMapping::describeDefect(const std::byte* row) const {
  Surfel surfel;
  const Defect defect = decodeRow(row, surfel);
  if (defect.kind == nullptr) return {};
  return fmt::format("{} is {}, expected {}", defect.property, defect.value, defect.expected);
}

}  // namespace surfeit
