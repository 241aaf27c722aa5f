#include "cloud/rows/row_layout.h"

#include <algorithm>
#include <cstring>
#include <span>
#include <utility>

namespace surfeit {
namespace {

constexpr std::size_t kMaxQuotedChars = 40;
constexpr std::size_t kMaxNameChars = 64;

struct TypeRow {
  ValueType type;
  std::size_t bytes;
  std::string_view classic, sized;
};

// In the order of ValueType
constexpr TypeRow kTypes[] = {
    {ValueType::kInt8, 1, "char", "int8"},        {ValueType::kUint8, 1, "uchar", "uint8"},
    {ValueType::kInt16, 2, "short", "int16"},     {ValueType::kUint16, 2, "ushort", "uint16"},
    {ValueType::kInt32, 4, "int", "int32"},       {ValueType::kUint32, 4, "uint", "uint32"},
    {ValueType::kFloat32, 4, "float", "float32"}, {ValueType::kFloat64, 8, "double", "float64"},
};

const TypeRow& typeRow(ValueType type) { return kTypes[static_cast<std::size_t>(type)]; }

}  // namespace

std::size_t valueTypeBytes(ValueType type) { return typeRow(type).bytes; }

std::string_view valueTypeName(ValueType type) { return typeRow(type).classic; }

std::optional<ValueType> valueTypeFromName(std::string_view name) {
  for (const TypeRow& row : kTypes) {
    if (name == row.classic || name == row.sized) return row.type;
  }
  return std::nullopt;
}

ValueType widestType(ValueType a, ValueType b) {
  const auto isSigned = [](ValueType type) {
    return type == ValueType::kInt8 || type == ValueType::kInt16 || type == ValueType::kInt32;
  };
  if (a == b) return a;
  if (valueTypeBytes(a) < valueTypeBytes(b)) std::swap(a, b);
  if (isFloatType(a) || isFloatType(b)) {
    // A float holds integers of 16 bits
    const bool is_small = (isFloatType(a) ? valueTypeBytes(b) : valueTypeBytes(a)) <= 2;
    const ValueType floating = isFloatType(a) ? a : b;
    return floating == ValueType::kFloat32 && is_small ? ValueType::kFloat32 : ValueType::kFloat64;
  }
  if (isSigned(a) == isSigned(b) || (isSigned(a) && valueTypeBytes(a) > valueTypeBytes(b)))
    return a;
  switch (valueTypeBytes(a)) {
    case 1:
      return ValueType::kInt16;
    case 2:
      return ValueType::kInt32;
    default:
      return ValueType::kFloat64;
  }
}

bool isPropertyName(std::string_view word) {
  return !word.empty() && word.size() <= kMaxNameChars &&
         std::none_of(word.begin(), word.end(),
                      [](char c) { return static_cast<unsigned char>(c) <= ' ' || c == '\x7f'; });
}

bool RowLayout::hasLists() const {
  return std::any_of(properties.begin(), properties.end(),
                     [](const RowProperty& property) { return property.is_list; });
}

const RowProperty* RowLayout::find(std::string_view property) const {
  for (const RowProperty& candidate : properties) {
    if (candidate.name == property) return &candidate;
  }
  return nullptr;
}

double rowValue(const std::byte* bytes, ValueType type) {
  return visitValueType(type, [bytes]<typename T>(std::type_identity<T>) {
    T value;
    std::memcpy(&value, bytes, sizeof value);
    return static_cast<double>(value);
  });
}

void packRow(RowLayout& element) {
  element.row_bytes = 0;
  for (RowProperty& property : element.properties) {
    if (property.is_list) continue;
    property.offset = element.row_bytes;
    element.row_bytes += valueTypeBytes(property.type);
  }
}

void swapValue(std::byte* value, ValueType type) {
  // Constant lengths let the compiler turn each case into a few moves
  switch (valueTypeBytes(type)) {
    case 2:
      std::reverse(value, value + 2);
      break;
    case 4:
      std::reverse(value, value + 4);
      break;
    case 8:
      std::reverse(value, value + 8);
      break;
    default:
      break;
  }
}

void swapRows(const RowLayout& element, std::span<std::byte> rows) {
  if (element.row_bytes == 0) return;
  for (std::size_t row = 0; row + element.row_bytes <= rows.size(); row += element.row_bytes) {
    for (const RowProperty& property : element.properties) {
      if (!property.is_list) swapValue(&rows[row + property.offset], property.type);
    }
  }
}

void widenValue(std::byte* value, WideInteger wide) {
  const auto widen = [value]<typename T>(T stored) {
    std::memcpy(&stored, value, sizeof stored);
    const double real = static_cast<double>(stored);
    std::memcpy(value, &real, sizeof real);
  };
  if (wide == WideInteger::kSigned) widen(std::int64_t{});
  if (wide == WideInteger::kUnsigned) widen(std::uint64_t{});
}

void widenRows(const RowLayout& element, std::span<std::byte> rows) {
  for (const RowProperty& property : element.properties) {
    if (property.is_list || property.wide == WideInteger::kNone) continue;
    for (std::size_t at = property.offset; at < rows.size(); at += element.row_bytes) {
      widenValue(&rows[at], property.wide);
    }
  }
}

std::string quoteText(std::string_view text) {
  std::string quoted = "'";
  for (const char c : text.substr(0, kMaxQuotedChars)) quoted += c >= ' ' && c <= '~' ? c : '?';
  if (text.size() > kMaxQuotedChars) quoted += "...";
  return quoted + "'";
}

}  // namespace surfeit
