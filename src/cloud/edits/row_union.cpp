#include "cloud/edits/row_union.h"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <limits>
#include <string_view>
#include <unordered_map>
#include <utility>

#include "cloud/rows/channels.h"
#include "cloud/rows/srgb_curve.h"
#include "cloud/rows/surfel_names.h"

namespace surfeit {
namespace {

// Whether values of a color become values of another type without loss.
bool holdsColor(ValueType to, ValueType from) {
  return to == from || (isFloatType(to) && valueTypeBytes(to) >= valueTypeBytes(from)) ||
         (from == ValueType::kUint8 && to == ValueType::kUint16);
}

// By property, whether it belongs to a color that is coded.
std::vector<bool> findColors(const RowLayout& element) {
  std::vector<bool> is_color(element.properties.size(), false);
  for (const RowChannel& channel : channelsOf(element)) {
    if (!isCodedColor(channel)) continue;
    for (const std::size_t i : channel.properties) is_color[i] = true;
  }
  return is_color;
}

// What codes of a color become as values of another type; empty when they stay.
std::vector<double> convertedCodes(ValueType from, ValueType to) {
  if (!codesSrgb(from)) return {};
  const bool is_widened = from == ValueType::kUint8 && to == ValueType::kUint16;
  if (!isFloatType(to) && !is_widened) return {};
  const std::size_t most = from == ValueType::kUint8 ? 255 : 65535;
  std::vector<double> codes(most + 1);
  for (std::size_t code = 0; code <= most; ++code) {
    codes[code] = is_widened
                      ? static_cast<double>(code * 257)
                      : linearFromSrgbCode(static_cast<double>(code) / static_cast<double>(most));
  }
  return codes;
}

template <std::size_t kBytes>
void copyFixed(const std::byte* from, std::size_t from_stride, std::size_t count, std::byte* to,
               std::size_t to_stride) {
  for (std::size_t i = 0; i < count; ++i, from += from_stride, to += to_stride) {
    std::memcpy(to, from, kBytes);
  }
}

// Constant lengths let the compiler turn each case into a few moves.
void copyBytes(const std::byte* from, std::size_t from_stride, std::size_t bytes, std::size_t count,
               std::byte* to, std::size_t to_stride) {
  switch (bytes) {
    case 1:
      return copyFixed<1>(from, from_stride, count, to, to_stride);
    case 3:
      return copyFixed<3>(from, from_stride, count, to, to_stride);
    case 4:
      return copyFixed<4>(from, from_stride, count, to, to_stride);
    case 12:
      return copyFixed<12>(from, from_stride, count, to, to_stride);
    case 24:
      return copyFixed<24>(from, from_stride, count, to, to_stride);
    default:
      for (std::size_t i = 0; i < count; ++i, from += from_stride, to += to_stride) {
        std::memcpy(to, from, bytes);
      }
  }
}

template <typename In, typename Out>
void convertValues(const std::byte* from, std::size_t from_stride, std::size_t count, std::byte* to,
                   std::size_t to_stride, const std::vector<double>& codes) {
  for (std::size_t i = 0; i < count; ++i, from += from_stride, to += to_stride) {
    In in;
    std::memcpy(&in, from, sizeof in);
    Out out;
    if constexpr (std::is_same_v<In, std::uint8_t> || std::is_same_v<In, std::uint16_t>) {
      out = codes.empty() ? static_cast<Out>(in) : static_cast<Out>(codes[in]);
    } else {
      out = static_cast<Out>(in);
    }
    std::memcpy(to, &out, sizeof out);
  }
}

bool isTintName(std::string_view name) {
  return std::find(std::begin(kOpacityNames), std::end(kOpacityNames), name) !=
         std::end(kOpacityNames);
}

// The property of a color that stands for this one of radiosity or albedo, or of one opacity for
// that of a color; else nullptr.
const char* colorFor(std::string_view name) {
  if (isTintName(name)) return "opacity";
  for (int i = 0; i < 3; ++i) {
    if (name == kRadiosityNames[i] || name == kAlbedoNames[i]) return kColorNames[i];
  }
  return nullptr;
}

}  // namespace

void RowUnion::add(const RowLayout& element) {
  std::unordered_map<std::string, std::size_t> index;
  for (std::size_t i = 0; i < properties_.size(); ++i) index.emplace(properties_[i].name, i);
  for (const RowProperty& property : element.properties) {
    if (property.is_list) continue;
    const auto [entry, is_new] = index.emplace(property.name, properties_.size());
    if (is_new) {
      properties_.push_back(property);
    } else {
      ValueType& type = properties_[entry->second].type;
      type = widestType(type, property.type);
    }
  }
}

RowCopier::RowCopier(const RowLayout& from, const RowLayout& to)
    : from_bytes_(from.row_bytes), to_bytes_(to.row_bytes) {
  std::unordered_map<std::string, std::size_t> index;
  for (std::size_t i = 0; i < from.properties.size(); ++i) {
    if (!from.properties[i].is_list) index.emplace(from.properties[i].name, i);
  }
  const std::vector<bool> is_color = findColors(from);
  for (const RowProperty& target : to.properties) {
    auto found = index.find(target.name);
    if (found != index.end()) {
      addCopy(from.properties[found->second], target, is_color[found->second]);
      continue;
    }
    const char* const color = colorFor(target.name);
    found = color != nullptr ? index.find(color) : index.end();
    if (found != index.end() && holdsColor(target.type, from.properties[found->second].type)) {
      addCopy(from.properties[found->second], target, is_color[found->second]);
      // One opacity is that of each color: nothing to tell
      if (!isTintName(target.name)) colored_.push_back(target.name);
    } else if (!addFull(target)) {
      absent_.push_back(target.name);
    }
  }
}

void RowCopier::addCopy(const RowProperty& source, const RowProperty& target, bool is_color) {
  if (source.type == target.type) {
    addRun({source.offset, target.offset, valueTypeBytes(target.type)});
    return;
  }
  Conversion conversion{source, target, {}};
  if (is_color) conversion.codes = convertedCodes(source.type, target.type);
  conversions_.push_back(std::move(conversion));
}

bool RowCopier::addFull(const RowProperty& target) {
  const bool is_full = target.name == "opacity" || isTintName(target.name) ||
                       target.name == "coverage" || target.name == "alpha";
  if (!is_full) return false;
  filled_.push_back(target);
  full_.push_back(target.name);
  return true;
}

void RowCopier::addRun(const Run& run) {
  if (!runs_.empty()) {
    Run& last = runs_.back();
    if (last.from + last.bytes == run.from && last.to + last.bytes == run.to) {
      last.bytes += run.bytes;
      return;
    }
  }
  runs_.push_back(run);
}

bool RowCopier::keepsRows() const {
  return from_bytes_ == to_bytes_ && runs_.size() == 1 && runs_[0].bytes == to_bytes_;
}

void RowCopier::copy(const std::byte* from, std::size_t step, std::size_t count,
                     std::byte* to) const {
  if (step == 1 && keepsRows()) {
    std::memcpy(to, from, count * to_bytes_);
    return;
  }
  if (!absent_.empty()) std::memset(to, 0, count * to_bytes_);
  const std::size_t stride = step * from_bytes_;
  for (const Run& run : runs_) {
    copyBytes(from + run.from, stride, run.bytes, count, to + run.to, to_bytes_);
  }
  for (const RowProperty& property : filled_) {
    visitValueType(property.type, [&]<typename T>(std::type_identity<T>) {
      T full{1};
      if constexpr (std::is_integral_v<T>) full = std::numeric_limits<T>::max();
      for (std::size_t i = 0; i < count; ++i) {
        std::memcpy(to + i * to_bytes_ + property.offset, &full, sizeof full);
      }
    });
  }
  for (const Conversion& conversion : conversions_) {
    visitValueType(conversion.from.type, [&]<typename In>(std::type_identity<In>) {
      visitValueType(conversion.to.type, [&]<typename Out>(std::type_identity<Out>) {
        convertValues<In, Out>(from + conversion.from.offset, stride, count,
                               to + conversion.to.offset, to_bytes_, conversion.codes);
      });
    });
  }
}

}  // namespace surfeit
