#include "cloud/houdini/bgeo_json_cursor.h"

#include <Imath/half.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <utility>

namespace surfeit {
namespace {

constexpr std::size_t kWindowBytes = 64 << 10;
constexpr std::size_t kMaxDefined = 4096, kMaxNumbers = 4096;

// The bytes that begin tokens.
constexpr std::uint8_t kNull = 0x00, kMapBegin = 0x7B, kMapEnd = 0x7D, kArrayBegin = 0x5B,
                       kArrayEnd = 0x5D, kBool = 0x10, kInt8 = 0x11, kInt16 = 0x12, kInt32 = 0x13,
                       kInt64 = 0x14, kFloat16 = 0x18, kFloat32 = 0x19, kFloat64 = 0x1A,
                       kUint8 = 0x21, kUint16 = 0x22, kText = 0x27, kFalse = 0x30, kTrue = 0x31,
                       kDefine = 0x2B, kReference = 0x26, kUndefine = 0x2D, kUniformArray = 0x40,
                       kColon = 0x3A, kComma = 0x2C;
constexpr std::array<std::byte, 5> kLittleEndian{std::byte{0x7F}, std::byte{'N'}, std::byte{'S'},
                                                 std::byte{'J'}, std::byte{'b'}};
constexpr std::array<std::byte, 5> kBigEndian{std::byte{0x7F}, std::byte{'b'}, std::byte{'J'},
                                              std::byte{'S'}, std::byte{'N'}};

std::optional<StoredType> typeOf(std::uint8_t byte) {
  switch (byte) {
    case kInt8:
      return StoredType::kInt8;
    case kInt16:
      return StoredType::kInt16;
    case kInt32:
      return StoredType::kInt32;
    case kInt64:
      return StoredType::kInt64;
    case kFloat16:
      return StoredType::kFloat16;
    case kFloat32:
      return StoredType::kFloat32;
    case kFloat64:
      return StoredType::kFloat64;
    case kUint8:
      return StoredType::kUint8;
    case kUint16:
      return StoredType::kUint16;
    default:
      return std::nullopt;
  }
}

template <typename T>
T reversed(T value) {
  std::array<std::byte, sizeof(T)> bytes;
  std::memcpy(bytes.data(), &value, sizeof value);
  std::reverse(bytes.begin(), bytes.end());
  std::memcpy(&value, bytes.data(), sizeof value);
  return value;
}

}  // namespace

bool startsBinaryJson(std::string_view first_bytes) {
  const Bytes bytes = std::as_bytes(std::span(first_bytes.data(), first_bytes.size()));
  if (bytes.size() < kLittleEndian.size()) return false;
  return std::equal(kLittleEndian.begin(), kLittleEndian.end(), bytes.begin()) ||
         std::equal(kBigEndian.begin(), kBigEndian.end(), bytes.begin());
}

Status BgeoJsonCursor::damaged(std::string_view what) const {
  return Status::corruption(fmt::format("{}: byte {}: {}", input_.path(), offset_, what));
}

Status BgeoJsonCursor::start() {
  std::array<std::byte, 5> magic;
  SURFEIT_RETURN_IF_ERROR(input_.readAt(0, magic));
  is_swapped_ = magic == kBigEndian;
  offset_ = magic.size();
  return {};
}

Status BgeoJsonCursor::advance(std::uint64_t bytes) {
  if (bytes > input_.size() - offset_) {
    return damaged(fmt::format("{} bytes, expected at most the {} that are left of the file", bytes,
                               input_.size() - offset_));
  }
  offset_ += bytes;
  return {};
}

template <typename T>
Status BgeoJsonCursor::get(T& value) {
  if (sizeof(T) > input_.size() - offset_) return damaged("file ends early, inside a value");
  if (offset_ < window_begin_ || offset_ - window_begin_ + sizeof(T) > window_.size()) {
    const std::size_t size =
        static_cast<std::size_t>(std::min<std::uint64_t>(kWindowBytes, input_.size() - offset_));
    SURFEIT_ASSIGN_OR_RETURN(window_, input_.readView(offset_, size, buffer_));
    window_begin_ = offset_;
  }
  std::memcpy(&value, window_.data() + (offset_ - window_begin_), sizeof value);
  if (is_swapped_) value = reversed(value);
  offset_ += sizeof(T);
  return {};
}

Status BgeoJsonCursor::getLength(std::uint64_t& length) {
  std::uint8_t first = 0;
  SURFEIT_RETURN_IF_ERROR(get(first));
  length = first;
  if (first < 0xF1) return {};
  if (first == 0xF2) {
    std::uint16_t value = 0;
    SURFEIT_RETURN_IF_ERROR(get(value));
    length = value;
  } else if (first == 0xF4) {
    std::uint32_t value = 0;
    SURFEIT_RETURN_IF_ERROR(get(value));
    length = value;
  } else if (first == 0xF8) {
    std::int64_t value = 0;
    SURFEIT_RETURN_IF_ERROR(get(value));
    if (value < 0) return damaged(fmt::format("length {}, expected none or more", value));
    length = static_cast<std::uint64_t>(value);
  } else {
    return damaged(fmt::format("length of kind {:#x}, expected 0xf2, 0xf4 or 0xf8", first));
  }
  return {};
}

Status BgeoJsonCursor::getText(std::string& text) {
  std::uint64_t length = 0;
  SURFEIT_RETURN_IF_ERROR(getLength(length));
  const std::uint64_t at = offset_;
  SURFEIT_RETURN_IF_ERROR(advance(length));
  text.resize(static_cast<std::size_t>(std::min<std::uint64_t>(length, kMaxJsonText)));
  return input_.readAt(at, std::as_writable_bytes(std::span(text.data(), text.size())));
}

// A number and a text; it is no value.
Status BgeoJsonCursor::define() {
  std::uint64_t id = 0;
  std::string text;
  SURFEIT_RETURN_IF_ERROR(getLength(id));
  SURFEIT_RETURN_IF_ERROR(getText(text));
  if (defined_.size() >= kMaxDefined && !defined_.contains(id)) {
    return damaged(fmt::format("more than {} defined texts", kMaxDefined));
  }
  defined_[id] = std::move(text);
  return {};
}

template <typename T>
Status BgeoJsonCursor::getInteger(JsonToken& token) {
  T value{};
  SURFEIT_RETURN_IF_ERROR(get(value));
  token.kind = JsonToken::Kind::kInteger;
  token.integer = value;
  token.real = static_cast<double>(value);
  return {};
}

template <typename T>
Status BgeoJsonCursor::getReal(JsonToken& token) {
  T value{};
  SURFEIT_RETURN_IF_ERROR(get(value));
  token.kind = JsonToken::Kind::kReal;
  token.real = value;
  return {};
}

Status BgeoJsonCursor::beginUniform(JsonToken& token) {
  std::uint8_t type = 0;
  SURFEIT_RETURN_IF_ERROR(get(type));
  SURFEIT_RETURN_IF_ERROR(getLength(token.length));
  token.kind = JsonToken::Kind::kUniformArray;
  token.type = typeOf(type);
  token.is_bools = type == kBool;
  token.offset = offset_;
  const std::uint64_t left = input_.size() - offset_;
  // No value takes less than a bit, so that the products below cannot overflow
  if (token.length / 8 > left) return damaged(fmt::format("array of {} values", token.length));
  if (token.type) return advance(token.length * storedBytes(*token.type));
  if (token.is_bools) return advance((token.length + 31) / 32 * 4);
  if (type != kText) return damaged(fmt::format("array of type {:#x}", type));
  for (std::uint64_t i = 0; i < token.length; ++i) {
    std::uint64_t length = 0;
    SURFEIT_RETURN_IF_ERROR(getLength(length));
    SURFEIT_RETURN_IF_ERROR(advance(length));
  }
  return {};
}

Status BgeoJsonCursor::next(JsonToken& token) {
  using Kind = JsonToken::Kind;
  while (true) {
    token.type.reset();
    if (offset_ == input_.size()) {
      token.kind = Kind::kEnd;
      return {};
    }
    std::uint8_t byte = 0;
    SURFEIT_RETURN_IF_ERROR(get(byte));
    switch (byte) {
      case kNull:
        token.kind = Kind::kNull;
        return {};
      case kMapBegin:
        token.kind = Kind::kMapBegin;
        return {};
      case kMapEnd:
        token.kind = Kind::kMapEnd;
        return {};
      case kArrayBegin:
        token.kind = Kind::kArrayBegin;
        return {};
      case kArrayEnd:
        token.kind = Kind::kArrayEnd;
        return {};
      case kBool:
      case kFalse:
      case kTrue: {
        std::uint8_t value = byte == kTrue ? 1 : 0;
        if (byte == kBool) SURFEIT_RETURN_IF_ERROR(get(value));
        token.kind = Kind::kBool;
        token.integer = value != 0 ? 1 : 0;
        return {};
      }
      case kInt8:
        return getInteger<std::int8_t>(token);
      case kInt16:
        return getInteger<std::int16_t>(token);
      case kInt32:
        return getInteger<std::int32_t>(token);
      case kInt64:
        return getInteger<std::int64_t>(token);
      case kUint8:
        return getInteger<std::uint8_t>(token);
      case kUint16:
        return getInteger<std::uint16_t>(token);
      case kFloat32:
        return getReal<float>(token);
      case kFloat64:
        return getReal<double>(token);
      case kFloat16: {
        std::uint16_t half = 0;
        SURFEIT_RETURN_IF_ERROR(get(half));
        token.kind = Kind::kReal;
        token.real = imath_half_to_float(half);
        return {};
      }
      case kText:
        token.kind = Kind::kText;
        return getText(token.text);
      case kReference: {
        std::uint64_t id = 0;
        SURFEIT_RETURN_IF_ERROR(getLength(id));
        const auto found = defined_.find(id);
        if (found == defined_.end()) return damaged(fmt::format("text {} is not defined", id));
        token.kind = Kind::kText;
        token.text = found->second;
        return {};
      }
      case kUniformArray:
        return beginUniform(token);
      case kDefine:
        SURFEIT_RETURN_IF_ERROR(define());
        break;
      case kUndefine: {
        std::uint64_t id = 0;
        SURFEIT_RETURN_IF_ERROR(getLength(id));
        defined_.erase(id);
        break;
      }
      case kColon:
      case kComma:
        break;
      default:
        --offset_;
        return damaged(fmt::format("found {:#04x}, expected a token of binary JSON", byte));
    }
  }
}

Status BgeoJsonCursor::skip(const JsonToken& token) {
  using Kind = JsonToken::Kind;
  if (token.kind != Kind::kMapBegin && token.kind != Kind::kArrayBegin) return {};
  JsonToken inner;
  for (std::uint64_t depth = 1; depth > 0;) {
    SURFEIT_RETURN_IF_ERROR(next(inner));
    if (inner.kind == Kind::kEnd) return damaged("file ends early, inside a map or an array");
    if (inner.kind == Kind::kMapBegin || inner.kind == Kind::kArrayBegin) ++depth;
    if (inner.kind == Kind::kMapEnd || inner.kind == Kind::kArrayEnd) --depth;
  }
  return {};
}

Status BgeoJsonCursor::readBools(const JsonToken& token, std::vector<bool>& bools) {
  // Word by word; bit i of a word is value i
  bools.clear();
  const std::uint64_t end = std::exchange(offset_, token.offset);
  for (std::uint64_t begin = 0; begin < token.length; begin += 32) {
    std::uint32_t word = 0;
    SURFEIT_RETURN_IF_ERROR(get(word));
    const std::uint64_t count = std::min<std::uint64_t>(32, token.length - begin);
    for (std::uint64_t bit = 0; bit < count; ++bit) bools.push_back(((word >> bit) & 1u) != 0);
  }
  offset_ = end;
  return {};
}

Status BgeoJsonCursor::readNumbers(const JsonToken& token, std::vector<double>& numbers) {
  if (!token.type || token.length > kMaxNumbers) {
    return damaged(
        fmt::format("array of {} values, expected at most {} numbers", token.length, kMaxNumbers));
  }
  std::vector<std::byte> bytes(static_cast<std::size_t>(token.length) * storedBytes(*token.type));
  SURFEIT_RETURN_IF_ERROR(input_.readAt(token.offset, bytes));
  numbers.resize(static_cast<std::size_t>(token.length));
  std::array<std::byte, 8> value;
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const StoredPlace place{*token.type, is_swapped_, 1, 0};
    decodeStored(place, bytes.data() + i * storedBytes(*token.type), 1, value.data(), 8);
    numbers[i] = rowValue(value.data(), plyTypeOf(*token.type));
  }
  return {};
}

}  // namespace surfeit
