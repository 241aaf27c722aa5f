#include "cloud/scans/las_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <string_view>
#include <unordered_set>
#include <utility>

#include "cloud/rows/channels.h"
#include "cloud/rows/surfel_names.h"
#include "cloud/scans/las_reader.h"
#include "storage/byte_coding.h"

namespace surfeit {
namespace {

constexpr std::size_t kLargestRecordBytes = 65535, kMaxNameBytes = 32;
constexpr std::size_t kMaxDescriptors = 65535 / kLasDescriptorBytes;

class Planner {
 public:
  Planner(const LasWish& wish, const std::string& path) : wish_(wish), path_(path) {}

  Result<LasPlan> plan() {
    SURFEIT_RETURN_IF_ERROR(takePosition());
    chooseFormat();
    plan_.record_bytes = lasRecordBytes(plan_.point_format);
    for (const LasField& field : lasFields(plan_.point_format)) addField(field);
    if (wish_.like != nullptr) addLikeExtraBytes();
    for (const RowProperty& property : wish_.element->properties) {
      if (!taken_.contains(property.name)) addExtraBytes(property);
    }
    if (plan_.record_bytes > kLargestRecordBytes || descriptor_count_ > kMaxDescriptors) {
      return Status::invalidArgument(fmt::format(
          "{}: {} extra values of {} bytes, expected at most {} values and {} bytes: convert with "
          "--keep or --drop first",
          path_, descriptor_count_, plan_.record_bytes, kMaxDescriptors, kLargestRecordBytes));
    }
    if (!has_described_) plan_.descriptors.clear();
    return std::move(plan_);
  }

 private:
  const RowProperty* find(std::string_view name) const { return wish_.element->find(name); }
  bool isMisfit(const std::string& property) const {
    return std::find(wish_.misfits.begin(), wish_.misfits.end(), property) != wish_.misfits.end();
  }

  Status takePosition() {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const RowProperty* const property = find(kPositionNames[axis]);
      if (property == nullptr) {
        return Status::invalidArgument(
            fmt::format("{}: no positions to write, expected properties x, y and z", path_));
      }
      plan_.position[axis] = *property;
      taken_.insert(property->name);
    }
    return {};
  }

  // The format of `like`, or the one that has what rows have.
  void chooseFormat() {
    const bool has_color = std::all_of(std::begin(kColorNames), std::end(kColorNames),
                                       [&](const char* name) { return find(name) != nullptr; });
    const bool has_nir = find("nir") != nullptr;
    const bool is_long = wish_.count.value_or(0) > std::numeric_limits<std::uint32_t>::max();
    if (wish_.like != nullptr) {
      plan_.minor = std::max(wish_.like->minor, 2u);
      plan_.point_format = wish_.like->point_format;
      if (is_long) plan_.minor = std::max(plan_.minor, 4u);
    } else if (wish_.prefers_keys && !is_long && !has_nir && find("overlap") == nullptr &&
               find("scanner_channel") == nullptr) {
      plan_.minor = 2;
      plan_.point_format = find("gps_time") != nullptr ? 1 : 0;
    }
    unsigned& format = plan_.point_format;
    if (format == 0 && find("gps_time") != nullptr) format = 1;
    if (format == 2 && find("gps_time") != nullptr) format = 3;
    constexpr unsigned kWithColor[] = {2, 3, 2, 3, 5, 5, 7, 7, 8, 10, 10};
    if (has_color) format = kWithColor[format];
    if (has_nir && has_color && format == 7) format = 8;
    if (format == 5 || format == 4) plan_.minor = std::max(plan_.minor, 3u);
  }

  void addField(const LasField& field) {
    if (field.name == "return_number") plan_.return_number = field;
    if (field.name == "number_of_returns") plan_.number_of_returns = field;
    if (field.name == "withheld") plan_.withheld = field;
    if (field.name == "position") return;
    const std::vector<std::string> names = lasPropertyNames(field, {});
    for (std::size_t i = 0; i < names.size(); ++i) {
      const RowProperty* const property = find(names[i]);
      if (property == nullptr || isMisfit(names[i])) continue;
      LasColumn column{LasValue(field, i, property->offset, property->type), names[i]};
      if (field.kind == ChannelKind::kColor) setColor(*property, column);
      const bool is_sure = column.coding != LasColumn::Coding::kValue || fits(field, *property);
      if (!is_sure) plan_.doubtful.push_back(plan_.columns.size());
      taken_.insert(names[i]);
      plan_.has_returns =
          plan_.has_returns || field.name == "return_number" || field.name == "number_of_returns";
      plan_.columns.push_back(std::move(column));
    }
  }

  // Colors are integers of 16 bits: others become that.
  void setColor(const RowProperty& property, LasColumn& column) {
    const bool is_first = column.property == kColorNames[0];
    if (isFloatType(property.type)) {
      column.coding = LasColumn::Coding::kLinear;
      if (is_first) plan_.notes.push_back("scene-linear red green blue becomes sRGB of 16 bits");
    } else if (property.type == ValueType::kUint8 && !comesFromLike(property)) {
      column.coding = LasColumn::Coding::kShade;
    }
  }

  bool comesFromLike(const RowProperty& property) const {
    if (wish_.like_element == nullptr) return false;
    const RowProperty* const there = wish_.like_element->find(property.name);
    return there != nullptr && there->type == property.type;
  }

  // Whether all values of the property's type, or those that a LAS file has, are values of a field.
  bool fits(const LasField& field, const RowProperty& property) const {
    if (comesFromLike(property)) return true;
    if (field.is_scaled) return false;
    if (plyTypeOf(field.stored) == property.type && field.bit_count == 0) return true;
    if (field.stored == LasType::kFloat64) return true;
    if (isFloatType(field.type) || isFloatType(property.type)) return false;
    const LasRange room = lasRange(field.stored, field.bit_count);
    const LasRange range = lasRange(lasTypeOf(property.type), 0);
    return range.least >= room.least && range.most <= room.most;
  }

  // Extra bytes of `like` that rows still have, as they were.
  void addLikeExtraBytes() {
    for (LasField field : wish_.like->fields(nullptr)) {
      if (!field.is_extra) continue;
      const std::vector<std::string> names = lasPropertyNames(field, {});
      const bool is_kept = std::all_of(names.begin(), names.end(), [&](const std::string& name) {
        const RowProperty* const property = find(name);
        return property != nullptr && !taken_.contains(name) && property->type == field.type;
      });
      if (!is_kept || names.empty()) continue;
      const std::size_t from = field.descriptor.value_or(0) * kLasDescriptorBytes;
      if (field.descriptor) {
        const auto begin = wish_.like->descriptors.begin() + static_cast<std::ptrdiff_t>(from);
        plan_.descriptors.insert(plan_.descriptors.end(), begin,
                                 begin + std::ptrdiff_t{kLasDescriptorBytes});
        has_described_ = true;
        ++descriptor_count_;
      } else {
        describe(field.name, LasType::kBytes, field.components);
      }
      file_names_.insert(field.name);
      field.offset = plan_.record_bytes;
      plan_.record_bytes += field.bytes();
      for (std::size_t i = 0; i < names.size(); ++i) {
        const RowProperty* const property = find(names[i]);
        taken_.insert(names[i]);
        plan_.columns.push_back({LasValue(field, i, property->offset, property->type), names[i]});
      }
    }
  }

  void addExtraBytes(const RowProperty& property) {
    LasField field;
    field.name = extraName(property.name);
    field.stored = lasTypeOf(property.type);
    field.type = property.type;
    field.offset = plan_.record_bytes;
    field.is_extra = true;
    plan_.record_bytes += field.bytes();
    describe(field.name, field.stored, 0);
    has_described_ = true;
    plan_.columns.push_back({LasValue(field, 0, property.offset, property.type), property.name});
    if (lasPropertyNames(field, {}) != std::vector{property.name}) {
      plan_.notes.push_back(
          fmt::format("{} is read back as {}", quoteText(property.name), quoteText(field.name)));
    }
  }

  // What other programs call it, and none that is there.
  std::string extraName(const std::string& property) {
    std::string name = property;
    for (int axis = 0; axis < 3; ++axis) {
      if (property == kNormalNames[axis]) name = fmt::format("Normal{}", "XYZ"[axis]);
    }
    if (isMisfit(property)) {
      name += "_value";
      plan_.notes.push_back(fmt::format(
          "{} has values that the field of LAS cannot hold: they are the extra bytes {}", property,
          name));
    }
    const std::string stem = name.substr(0, kMaxNameBytes - 4);
    if (name.size() > kMaxNameBytes) name = name.substr(0, kMaxNameBytes);
    for (int i = 2; file_names_.contains(name); ++i) name = fmt::format("{}_{}", stem, i);
    file_names_.insert(name);
    return name;
  }

  void describe(const std::string& name, LasType type, std::size_t byte_count) {
    std::vector<std::byte> descriptor;
    ByteWriter writer(descriptor);
    writer.put(std::uint16_t{0});
    writer.put(static_cast<std::uint8_t>(type));
    writer.put(static_cast<std::uint8_t>(byte_count));
    writer.putBytes(std::as_bytes(std::span(name)));
    descriptor.resize(kLasDescriptorBytes);
    plan_.descriptors.insert(plan_.descriptors.end(), descriptor.begin(), descriptor.end());
    ++descriptor_count_;
  }

  const LasWish& wish_;
  const std::string& path_;
  LasPlan plan_;
  std::unordered_set<std::string> taken_;       // properties that have their place
  std::unordered_set<std::string> file_names_;  // of extra bytes
  std::size_t descriptor_count_ = 0;
  bool has_described_ = false;  // whether extra bytes have a description besides their number
};

}  // namespace

Result<LasPlan> planLas(const LasWish& wish, const std::string& path) {
  return Planner(wish, path).plan();
}

}  // namespace surfeit
