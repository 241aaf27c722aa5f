// The fields of a point: those of its format, and extra bytes as their descriptions say.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "cloud/scans/las_format.h"
#include "storage/byte_coding.h"

namespace surfeit {
namespace {

constexpr std::size_t kMaxUndescribed = 64;  // extra bytes that are kept without a description

// One description of extra bytes.
struct Descriptor {
  explicit Descriptor(Bytes bytes) {
    ByteReader reader(bytes);
    reader.take(2);
    const unsigned code = reader.get<std::uint8_t>();
    options = reader.get<std::uint8_t>();
    name = lasTextOf(reader.take(32));
    reader.take(4);  // unused
    const Bytes stated = reader.take(24);
    reader.take(2 * 24);  // min, max
    for (double& value : scale) value = reader.get<double>();
    for (double& value : origin) value = reader.get<double>();
    is_known = code <= 30;
    // Types 11 to 20 are two, 21 to 30 three values of types 1 to 10
    type = code == 0 ? LasType::kBytes : static_cast<LasType>((code - 1) % 10 + 1);
    components = code == 0 ? options : (code - 1) / 10 + 1;
    if (!is_known) components = 0;
    no_data = noDataOf(stated);
  }
  bool hasScale() const { return type != LasType::kBytes && (options & 8) != 0; }
  bool hasOrigin() const { return type != LasType::kBytes && (options & 16) != 0; }

  // As rows have it: stated as a whole number or real of 64 bits, before it is scaled.
  double noDataOf(Bytes stated) const {
    ByteReader reader(stated);
    const bool is_unsigned = type == LasType::kUint8 || type == LasType::kUint16 ||
                             type == LasType::kUint32 || type == LasType::kUint64;
    const bool is_real = type == LasType::kFloat32 || type == LasType::kFloat64;
    const double value = is_real       ? reader.get<double>()
                         : is_unsigned ? double(reader.get<std::uint64_t>())
                                       : double(reader.get<std::int64_t>());
    return value * (hasScale() ? scale[0] : 1) + (hasOrigin() ? origin[0] : 0);
  }

  std::string name;
  LasType type = LasType::kBytes;
  unsigned options = 0;
  double no_data = 0;
  std::size_t components = 0;
  bool is_known = true;
  std::array<double, 3> scale{}, origin{};
};

LasField fieldOf(const Descriptor& descriptor, std::size_t offset,
                 std::vector<std::string>& notes) {
  LasField field;
  field.name = descriptor.name.empty() ? std::string(kLasExtraBytes) : descriptor.name;
  field.components = descriptor.components;
  field.stored = descriptor.type;
  field.type = plyTypeOf(descriptor.type);
  field.kind = field.components == 3 ? ChannelKind::kVector : ChannelKind::kFloat;
  field.offset = offset;
  field.is_extra = true;
  const std::string name = quoteText(field.name);
  for (std::size_t i = 0; i < std::min<std::size_t>(3, field.components); ++i) {
    if (descriptor.hasScale()) field.scale[i] = descriptor.scale[i];
    if (descriptor.hasOrigin()) field.origin[i] = descriptor.origin[i];
    field.is_scaled = field.is_scaled || descriptor.hasScale() || descriptor.hasOrigin();
    if (std::isfinite(field.scale[i]) && field.scale[i] != 0 && std::isfinite(field.origin[i])) {
      continue;
    }
    notes.push_back(fmt::format("extra bytes {}: scale {} and offset {} are left out", name,
                                field.scale[i], field.origin[i]));
    field.scale[i] = 1;
    field.origin[i] = 0;
  }
  if (field.is_scaled) field.type = ValueType::kFloat64;
  if (field.stored == LasType::kUint64 || field.stored == LasType::kInt64) {
    notes.push_back(fmt::format("integers of 64 bits become float64, exact to 2^53: {}", name));
  }
  if (descriptor.type != LasType::kBytes && (descriptor.options & 1) != 0) {
    notes.push_back(
        fmt::format("extra bytes {}: {} stands for no value, as the file says, and stays: --filter "
                    "\"{} != {}\" leaves such points out",
                    name, descriptor.no_data, field.name, descriptor.no_data));
  }
  return field;
}

}  // namespace

std::vector<LasField> LasHeader::fields(std::vector<std::string>* told) const {
  std::vector<std::string> found;
  std::vector<LasField> fields = lasFields(point_format);
  fields.front().scale = scale;  // the position
  fields.front().origin = origin;
  std::size_t offset = lasRecordBytes(point_format);
  for (std::size_t at = 0; at < descriptors.size(); at += kLasDescriptorBytes) {
    const Descriptor descriptor(Bytes(descriptors).subspan(at, kLasDescriptorBytes));
    const std::size_t size = descriptor.components * lasTypeBytes(descriptor.type);
    if (!descriptor.is_known || size > record_bytes - offset) {
      found.push_back(fmt::format(
          "extra bytes {}: {}, so they and what follows have no names", quoteText(descriptor.name),
          descriptor.is_known ? "the points are too short" : "of an unknown type"));
      break;
    }
    if (descriptor.type == LasType::kBytes && descriptor.components > kMaxUndescribed) {
      found.push_back(fmt::format("{} bytes of every point without a type are not kept: {}", size,
                                  quoteText(descriptor.name)));
    } else if (size > 0) {
      fields.push_back(fieldOf(descriptor, offset, found));
      fields.back().descriptor = at / kLasDescriptorBytes;
    }
    offset += size;
  }
  const std::size_t left = record_bytes - offset;
  if (left > kMaxUndescribed) {
    found.push_back(
        fmt::format("{} bytes of every point without a description are not kept", left));
  } else if (left > 0) {
    LasField field;
    field.name = kLasExtraBytes;
    field.stored = LasType::kBytes;
    field.components = left;
    field.offset = offset;
    field.is_extra = true;
    fields.push_back(field);
  }
  if (told != nullptr) *told = std::move(found);
  return fields;
}

}  // namespace surfeit
