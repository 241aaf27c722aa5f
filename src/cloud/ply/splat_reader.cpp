#include "cloud/ply/splat_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <numbers>
#include <span>
#include <string_view>
#include <utility>

#include "cloud/rows/srgb_curve.h"
#include "cloud/rows/surfel_names.h"

namespace surfeit {
namespace {

constexpr std::size_t kBlockRows = 4096;
constexpr double kLeastCoverage = 1e-6;

constexpr const char* kNeeded[] = {"x",      "y",       "z",       "f_dc_0",  "f_dc_1",
                                   "f_dc_2", "opacity", "scale_0", "scale_1", "rot_0",
                                   "rot_1",  "rot_2",   "rot_3"};
constexpr const char* kThirdScale = "scale_2";
constexpr std::size_t kFirstColor = 3;  // of kNeeded

// What disks have instead; files bring normals that mean nothing.
constexpr const char* kFloats[] = {"nx",    "ny",   "nz",      "radius",  "red",
                                   "green", "blue", "opacity", "coverage"};
constexpr const char* kTwoSided = "two_sided";

bool isReplaced(std::string_view name) {
  const auto has = [&](std::span<const char* const> names) {
    return std::any_of(names.begin(), names.end(),
                       [&](const char* other) { return name == other; });
  };
  return has(std::span(kNeeded).subspan(3)) || has(kFloats) || name == kThirdScale ||
         name == kTwoSided || name.starts_with("f_rest_");
}

bool hasScalar(const RowLayout& element, const char* name) {
  const RowProperty* const property = element.find(name);
  return property != nullptr && !property->is_list;
}

// Whether colors are codes of 8 bits in place of harmonics, as nerfstudio writes them (rgb).
bool hasCodes(const RowLayout& element) {
  return !hasScalar(element, kNeeded[kFirstColor]) &&
         std::all_of(std::begin(kColorNames), std::end(kColorNames), [&](const char* name) {
           return hasScalar(element, name) && element.find(name)->type == ValueType::kUint8;
         });
}

// A value of a splat, in its row.
struct Field {
  std::size_t offset = 0;
  ValueType type = ValueType::kFloat32;

  double of(const std::byte* row) const {
    if (type != ValueType::kFloat32) return rowValue(row + offset, type);
    float value;
    std::memcpy(&value, row + offset, sizeof value);
    return double{value};
  }
};

class SplatReader final : public RowReader {
 public:
  SplatReader(std::unique_ptr<RowReader> splats, bool are_lengths)
      : splats_(std::move(splats)), are_lengths_(are_lengths) {
    const RowLayout& from = splats_->element();
    element_.name = from.name;
    element_.count = from.count;
    for (const RowProperty& property : from.properties) {
      if (property.is_list || isReplaced(property.name)) {
        rest_count_ += property.name.starts_with("f_rest_") ? 1 : 0;
        continue;
      }
      copies_.push_back(property.offset);
      element_.properties.push_back(property);
    }
    for (const char* name : kFloats) element_.properties.push_back({name, ValueType::kFloat32});
    element_.properties.push_back({kTwoSided, ValueType::kUint8});
    for (std::size_t i = copies_.size(); i < element_.properties.size(); ++i) {
      element_.properties[i].is_made = true;
    }
    packRow(element_);
    has_codes_ = hasCodes(from);
    for (std::size_t i = 0; i < std::size(kNeeded); ++i) {
      const bool is_color = i >= kFirstColor && i < kFirstColor + 3;
      fields_[i] = fieldOf(is_color && has_codes_ ? kColorNames[i - kFirstColor] : kNeeded[i]);
    }
    has_third_scale_ = from.find(kThirdScale) != nullptr;
    if (has_third_scale_) third_scale_ = fieldOf(kThirdScale);
  }

  const std::string& path() const override { return splats_->path(); }
  std::string formatName() const override { return splats_->formatName() + " of Gaussian splats"; }
  const RowLayout& element() const override { return element_; }
  std::vector<std::string> comments() const override { return splats_->comments(); }

  std::vector<std::string> notes() const override {
    std::vector<std::string> notes = splats_->notes();
    notes.push_back("Gaussian splats are read as disks of radius sqrt(2 s1 s2), two-sided");
    notes.push_back("their opacity becomes the part of its area that a disk covers");
    notes.push_back("splats of an opacity below 1/255 keep their rows");
    if (are_lengths_) {
      notes.push_back(
          "scales are all above 0 and opacities from 0 to 1: they look like lengths and parts, and "
          "are read as logarithms and logits, as splats have them: write ln(scale) and ln(opacity "
          "/ (1 - opacity))");
    }
    if (rest_count_ > 0) {
      notes.push_back(
          fmt::format("colors by direction, f_rest_0 to f_rest_{}, are not kept", rest_count_ - 1));
    }
    return notes;
  }

  Result<Bytes> readRows(std::size_t max_rows, AlignedBuffer& buffer) override {
    std::size_t count = 0;
    const auto most =
        static_cast<std::size_t>(std::min<std::uint64_t>(max_rows, element_.count - next_row_));
    buffer.reserve(std::max<std::size_t>(1, most) * element_.row_bytes);
    while (true) {
      // At the end too, where the reader looks at what follows
      SURFEIT_ASSIGN_OR_RETURN(
          const Bytes rows,
          splats_->readRows(std::clamp<std::size_t>(most - count, 1, kBlockRows), splat_rows_));
      const std::size_t row_bytes = splats_->element().row_bytes;
      const std::size_t got = rows.size() / row_bytes;
      for (std::size_t i = 0; i < got; ++i) {
        decode(rows.data() + i * row_bytes, buffer.data() + (count + i) * element_.row_bytes);
      }
      count += got;
      next_row_ += got;
      if (got == 0 || count == most) break;
    }
    return Bytes(buffer.data(), count * element_.row_bytes);
  }

  Status rewind() override {
    next_row_ = 0;
    return splats_->rewind();
  }
  bool isSeekable() const override { return splats_->isSeekable(); }
  Status seekRow(std::uint64_t row) override {
    SURFEIT_RETURN_IF_ERROR(splats_->seekRow(row));
    next_row_ = row;
    return {};
  }

 private:
  Field fieldOf(const char* name) const {
    const RowProperty& property = *splats_->element().find(name);
    return {property.offset, property.type};
  }

  // By the names of kNeeded.
  double valueOf(const std::byte* row, std::size_t needed) const { return fields_[needed].of(row); }

  void decode(const std::byte* splat, std::byte* disk) const {
    for (std::size_t i = 0; i < copies_.size(); ++i) {
      const RowProperty& property = element_.properties[i];
      std::memcpy(disk + property.offset, splat + copies_[i], valueTypeBytes(property.type));
    }
    std::array<float, std::size(kFloats)> values;
    decodeShape(splat, values.data());
    for (std::size_t c = 0; c < 3; ++c) {
      const double value = valueOf(splat, kFirstColor + c);
      const double code = has_codes_ ? value / 255 : 0.5 + kSplatColorFactor * value;
      values[4 + c] = static_cast<float>(linearFromSrgbCode(code < 0 ? 0 : code));
    }
    const double opacity = 1 / (1 + std::exp(-valueOf(splat, 6)));
    values[7] = static_cast<float>(opacity);
    values[8] = static_cast<float>(std::max(opacity, kLeastCoverage));
    std::byte* const floats = disk + element_.properties[copies_.size()].offset;
    std::memcpy(floats, values.data(), sizeof values);
    floats[sizeof values] = std::byte{1};  // two_sided
  }

  // Normal and radius.
  void decodeShape(const std::byte* splat, float* values) const {
    // The axis of the smallest scale; a splat of two scales is flat
    const double scales[3] = {valueOf(splat, 7), valueOf(splat, 8),
                              has_third_scale_ ? third_scale_.of(splat) : -INFINITY};
    const std::size_t smallest =
        static_cast<std::size_t>(std::min_element(scales, scales + 3) - scales);
    const double log_product = scales[(smallest + 1) % 3] + scales[(smallest + 2) % 3];

    // That column of the rotation's matrix
    double w = valueOf(splat, 9), x = valueOf(splat, 10), y = valueOf(splat, 11),
           z = valueOf(splat, 12);
    const double length = std::sqrt(w * w + x * x + y * y + z * z);
    w /= length, x /= length, y /= length, z /= length;
    const double columns[3][3] = {
        {1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)},
        {2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)},
        {2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)}};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      values[axis] = static_cast<float>(columns[smallest][axis]);
    }
    const bool is_number = std::none_of(scales, scales + 3, [](double s) { return std::isnan(s); });
    values[3] = static_cast<float>(is_number ? std::numbers::sqrt2 * std::exp(log_product / 2)
                                             : std::numeric_limits<double>::quiet_NaN());
  }

  std::unique_ptr<RowReader> splats_;
  bool are_lengths_;
  RowLayout element_;
  std::vector<std::size_t> copies_;  // where the first properties of element_ stand in a splat
  std::array<Field, std::size(kNeeded)> fields_;
  Field third_scale_;
  bool has_third_scale_ = false, has_codes_ = false;
  std::size_t rest_count_ = 0;
  std::uint64_t next_row_ = 0;
  AlignedBuffer splat_rows_;
};

// Whether all scales are above 0 and all opacities from 0 to 1, in rows from all over the file: the
// first of real splats is not so.
Result<bool> haveLengths(RowReader& splats) {
  constexpr std::uint64_t kPlaces = 64;
  constexpr std::size_t kRowsOfPlace = 64;
  const RowLayout& element = splats.element();
  const RowProperty &opacity = *element.find("opacity"), &scale = *element.find("scale_0"),
                    &other = *element.find("scale_1");
  const bool takes_places = splats.isSeekable() && element.count > kPlaces * kRowsOfPlace;
  bool have_lengths = element.count > 0;
  AlignedBuffer buffer;
  for (std::uint64_t place = 0; have_lengths && (!takes_places || place < kPlaces); ++place) {
    if (takes_places && !splats.seekRow(element.count / kPlaces * place).ok()) break;
    const Result<Bytes> rows = splats.readRows(kRowsOfPlace, buffer);
    if (!rows.ok() || rows->empty()) break;
    for (std::size_t at = 0; at < rows->size(); at += element.row_bytes) {
      const auto value = [&](const RowProperty& property) {
        return rowValue(&(*rows)[at + property.offset], property.type);
      };
      const double part = value(opacity);
      have_lengths = have_lengths && value(scale) > 0 && value(other) > 0 && part >= 0 && part <= 1;
    }
  }
  SURFEIT_RETURN_IF_ERROR(splats.rewind());
  return have_lengths;
}

}  // namespace

bool areSplats(const RowLayout& element) {
  for (std::size_t i = 0; i < std::size(kNeeded); ++i) {
    const bool is_color = i >= kFirstColor && i < kFirstColor + 3;
    if (!hasScalar(element, kNeeded[i]) && !(is_color && hasCodes(element))) return false;
  }
  return true;
}

std::vector<std::string> missingOfSplats(const RowLayout& element) {
  constexpr std::size_t kMost = 5;
  std::vector<std::string> missing;
  for (const char* name : kNeeded) {
    if (element.find(name) == nullptr) missing.emplace_back(name);
  }
  const bool has_place = element.find("x") != nullptr && element.find("opacity") != nullptr;
  if (!has_place || missing.size() >= kMost || areSplats(element)) missing.clear();
  return missing;
}

Result<std::unique_ptr<RowReader>> readSplatsAsDisks(std::unique_ptr<RowReader> splats) {
  SURFEIT_ASSIGN_OR_RETURN(const bool are_lengths, haveLengths(*splats));
  return std::unique_ptr<RowReader>(std::make_unique<SplatReader>(std::move(splats), are_lengths));
}

}  // namespace surfeit
