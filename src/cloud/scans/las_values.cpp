#include "cloud/scans/las_values.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "core/assert.h"

namespace surfeit {
namespace {

constexpr double kAngleUnit = 0.006;  // degrees, of point formats 6 to 10

// Where the parts of a record begin; 0 where the point format has none.
struct PointFormat {
  std::size_t bytes, gps_time, color, nir, wave_packet;
};
constexpr std::array<PointFormat, kLasPointFormats> kPointFormats{{{20, 0, 0, 0, 0},
                                                                   {28, 20, 0, 0, 0},
                                                                   {26, 0, 20, 0, 0},
                                                                   {34, 20, 28, 0, 0},
                                                                   {57, 20, 0, 0, 28},
                                                                   {63, 20, 28, 0, 34},
                                                                   {30, 22, 0, 0, 0},
                                                                   {36, 22, 30, 0, 0},
                                                                   {38, 22, 30, 36, 0},
                                                                   {59, 22, 0, 0, 30},
                                                                   {67, 22, 30, 36, 38}}};

LasField whole(std::string_view name, LasType stored, std::size_t offset) {
  LasField field;
  field.name = name;
  field.stored = stored;
  field.type = plyTypeOf(stored);
  field.offset = offset;
  return field;
}

LasField bits(std::string_view name, std::size_t offset, unsigned shift, unsigned bit_count) {
  LasField field = whole(name, LasType::kUint8, offset);
  field.shift = shift;
  field.bit_count = bit_count;
  return field;
}

LasField triple(std::string_view name, ChannelKind kind, LasType stored, std::size_t offset) {
  LasField field = whole(name, stored, offset);
  field.components = 3;
  field.kind = kind;
  return field;
}

LasField positionField() {
  LasField field = triple("position", ChannelKind::kPoint, LasType::kInt32, 0);
  field.type = ValueType::kFloat64;
  field.is_scaled = true;
  return field;
}

void addWavePacket(std::size_t offset, std::vector<LasField>& fields) {
  fields.push_back(whole("wavepacket_index", LasType::kUint8, offset));
  fields.push_back(whole("wavepacket_offset", LasType::kUint64, offset + 1));
  fields.push_back(whole("wavepacket_size", LasType::kUint32, offset + 9));
  fields.push_back(whole("return_point_wave_location", LasType::kFloat32, offset + 13));
  fields.push_back(whole("x_t", LasType::kFloat32, offset + 17));
  fields.push_back(whole("y_t", LasType::kFloat32, offset + 21));
  fields.push_back(whole("z_t", LasType::kFloat32, offset + 25));
}

// Returns, flags and scan of formats 0 to 5.
void addOldFlags(std::vector<LasField>& fields) {
  fields.push_back(bits("return_number", 14, 0, 3));
  fields.push_back(bits("number_of_returns", 14, 3, 3));
  fields.push_back(bits("scan_direction_flag", 14, 6, 1));
  fields.push_back(bits("edge_of_flight_line", 14, 7, 1));
  fields.push_back(bits("synthetic", 15, 5, 1));
  fields.push_back(bits("key_point", 15, 6, 1));
  fields.push_back(bits("withheld", 15, 7, 1));
  fields.push_back(whole("scan_angle", LasType::kInt8, 16));
  fields.push_back(whole("user_data", LasType::kUint8, 17));
  fields.push_back(whole("point_source_id", LasType::kUint16, 18));
}

// And of formats 6 to 10.
void addFlags(std::vector<LasField>& fields) {
  fields.push_back(bits("return_number", 14, 0, 4));
  fields.push_back(bits("number_of_returns", 14, 4, 4));
  fields.push_back(bits("scan_direction_flag", 15, 6, 1));
  fields.push_back(bits("edge_of_flight_line", 15, 7, 1));
  fields.push_back(bits("synthetic", 15, 0, 1));
  fields.push_back(bits("key_point", 15, 1, 1));
  fields.push_back(bits("withheld", 15, 2, 1));
  fields.push_back(bits("overlap", 15, 3, 1));
  fields.push_back(bits("scanner_channel", 15, 4, 2));
  LasField angle = whole("scan_angle", LasType::kInt16, 18);
  angle.type = ValueType::kFloat32;
  angle.is_scaled = true;
  angle.scale.fill(kAngleUnit);
  fields.push_back(angle);
  fields.push_back(whole("user_data", LasType::kUint8, 17));
  fields.push_back(whole("point_source_id", LasType::kUint16, 20));
}

// Calls `visit` with std::type_identity<T>, T being the C++ type of stored values.
template <typename Visit>
decltype(auto) visitLasType(LasType type, Visit visit) {
  switch (type) {
    case LasType::kUint64:
      return visit(std::type_identity<std::uint64_t>());
    case LasType::kInt64:
      return visit(std::type_identity<std::int64_t>());
    default:
      return visitValueType(plyTypeOf(type), visit);
  }
}

template <typename T>
void copyValues(const std::byte* from, std::size_t from_stride, std::size_t count, std::byte* to,
                std::size_t to_stride) {
  for (std::size_t i = 0; i < count; ++i, from += from_stride, to += to_stride) {
    std::memcpy(to, from, sizeof(T));
  }
}

// The nearest value of an integer type to a number; `fits` says whether it is one.
template <typename T>
T integerOf(double number, bool& fits) {
  const LasRange range{static_cast<double>(std::numeric_limits<T>::min()),
                       static_cast<double>(std::numeric_limits<T>::max())};
  const double rounded = std::nearbyint(number);
  fits = rounded >= range.least && rounded <= range.most;
  if (std::isnan(rounded)) return 0;
  if (rounded <= range.least) return std::numeric_limits<T>::min();
  // The largest of 64 bits is no double: from there on all are the largest
  if (rounded >= range.most) return std::numeric_limits<T>::max();
  return static_cast<T>(rounded);
}

}  // namespace

std::size_t lasTypeBytes(LasType type) {
  constexpr std::size_t kBytes[] = {1, 1, 1, 2, 2, 4, 4, 8, 8, 4, 8};
  return kBytes[static_cast<std::size_t>(type)];
}

ValueType plyTypeOf(LasType type) {
  constexpr ValueType kTypes[] = {ValueType::kUint8,   ValueType::kUint8,   ValueType::kInt8,
                                  ValueType::kUint16,  ValueType::kInt16,   ValueType::kUint32,
                                  ValueType::kInt32,   ValueType::kFloat64, ValueType::kFloat64,
                                  ValueType::kFloat32, ValueType::kFloat64};
  return kTypes[static_cast<std::size_t>(type)];
}

LasType lasTypeOf(ValueType type) {
  constexpr LasType kTypes[] = {LasType::kInt8,    LasType::kUint8,  LasType::kInt16,
                                LasType::kUint16,  LasType::kInt32,  LasType::kUint32,
                                LasType::kFloat32, LasType::kFloat64};
  return kTypes[static_cast<std::size_t>(type)];
}

std::vector<LasField> lasFields(unsigned point_format) {
  SURFEIT_CHECK(point_format < kLasPointFormats);
  const PointFormat& format = kPointFormats[point_format];
  std::vector<LasField> fields = {positionField(), whole("intensity", LasType::kUint16, 12)};
  const bool is_old = point_format <= 5;
  fields.push_back(is_old ? bits("classification", 15, 0, 5)
                          : whole("classification", LasType::kUint8, 16));
  if (format.color != 0) {
    fields.push_back(triple("color", ChannelKind::kColor, LasType::kUint16, format.color));
  }
  is_old ? addOldFlags(fields) : addFlags(fields);
  if (format.gps_time != 0) {
    fields.push_back(whole("gps_time", LasType::kFloat64, format.gps_time));
  }
  if (format.nir != 0) fields.push_back(whole("nir", LasType::kUint16, format.nir));
  if (format.wave_packet != 0) addWavePacket(format.wave_packet, fields);
  return fields;
}

std::size_t lasRecordBytes(unsigned point_format) {
  SURFEIT_CHECK(point_format < kLasPointFormats);
  return kPointFormats[point_format].bytes;
}

LasValue::LasValue(const LasField& field, std::size_t component, std::size_t row,
                   ValueType row_type)
    : record_offset(field.offset + component * lasTypeBytes(field.stored)),
      row_offset(row),
      stored(field.stored),
      type(row_type),
      shift(field.shift),
      bit_count(field.bit_count),
      is_scaled(field.is_scaled),
      scale(field.scale[std::min<std::size_t>(component, 2)]),
      origin(field.origin[std::min<std::size_t>(component, 2)]) {}

void decodeLas(const LasValue& value, const std::byte* records, std::size_t record_bytes,
               std::size_t count, std::byte* rows, std::size_t row_bytes) {
  const std::byte* from = records + value.record_offset;
  std::byte* to = rows + value.row_offset;
  if (value.bit_count != 0) {
    const unsigned mask = (1u << value.bit_count) - 1;
    for (std::size_t i = 0; i < count; ++i, from += record_bytes, to += row_bytes) {
      *to = static_cast<std::byte>(static_cast<unsigned>(*from) >> value.shift & mask);
    }
    return;
  }
  visitLasType(value.stored, [&]<typename T>(std::type_identity<T>) {
    if (!value.is_scaled && sizeof(T) == valueTypeBytes(value.type) &&
        plyTypeOf(value.stored) == value.type && value.stored != LasType::kUint64 &&
        value.stored != LasType::kInt64) {
      return copyValues<T>(from, record_bytes, count, to, row_bytes);
    }
    const auto convert = [&]<typename Out>(std::type_identity<Out>) {
      for (std::size_t i = 0; i < count; ++i, from += record_bytes, to += row_bytes) {
        T number;
        std::memcpy(&number, from, sizeof number);
        const Out out = static_cast<Out>(static_cast<double>(number) * value.scale + value.origin);
        std::memcpy(to, &out, sizeof out);
      }
    };
    value.type == ValueType::kFloat32 ? convert(std::type_identity<float>())
                                      : convert(std::type_identity<double>());
  });
}

std::size_t encodeLas(const LasValue& value, const std::byte* rows, std::size_t row_bytes,
                      std::size_t count, std::byte* records, std::size_t record_bytes) {
  const std::byte* from = rows + value.row_offset;
  std::byte* to = records + value.record_offset;
  std::size_t misfits = 0;
  if (value.bit_count != 0) {
    const double most = lasRange(value.stored, value.bit_count).most;
    for (std::size_t i = 0; i < count; ++i, from += row_bytes, to += record_bytes) {
      const double number = rowValue(from, value.type);
      const double clipped = number >= 0 ? std::min(std::nearbyint(number), most) : 0;
      misfits += clipped != number;
      *to |= static_cast<std::byte>(static_cast<unsigned>(clipped) << value.shift);
    }
    return misfits;
  }
  visitLasType(value.stored, [&]<typename T>(std::type_identity<T>) {
    visitValueType(value.type, [&]<typename In>(std::type_identity<In>) {
      if (std::is_same_v<T, In> && !value.is_scaled) {
        return copyValues<T>(from, row_bytes, count, to, record_bytes);
      }
      for (std::size_t i = 0; i < count; ++i, from += row_bytes, to += record_bytes) {
        In number;
        std::memcpy(&number, from, sizeof number);
        const double real = (static_cast<double>(number) - value.origin) / value.scale;
        T out;
        if constexpr (std::is_floating_point_v<T>) {
          out = static_cast<T>(real);
        } else {
          bool fits = false;
          out = integerOf<T>(real, fits);
          misfits += !fits || (!value.is_scaled && static_cast<double>(out) != real);
        }
        std::memcpy(to, &out, sizeof out);
      }
    });
  });
  return misfits;
}

LasRange lasRange(LasType stored, unsigned bit_count) {
  if (bit_count != 0) return {0, static_cast<double>((1u << bit_count) - 1)};
  return visitLasType(stored, [](auto type) {
    using T = typename decltype(type)::type;
    return LasRange{static_cast<double>(std::numeric_limits<T>::lowest()),
                    static_cast<double>(std::numeric_limits<T>::max())};
  });
}

}  // namespace surfeit
