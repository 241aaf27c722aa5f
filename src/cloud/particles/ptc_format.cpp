#include "cloud/particles/ptc_format.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>
#include <utility>

#include "cloud/rows/row_layout.h"
#include "storage/byte_coding.h"

namespace surfeit {
namespace {

constexpr std::string_view kMagic = "pptc";
constexpr std::size_t kMaxHeaderBytes = 64 << 10;  // 256 variables of 64 letters take a third
constexpr std::size_t kUnknownFloats = 4, kUnknownEndBytes = 8, kFillerWords = 32;
constexpr std::uint32_t kFiller = 0xdeadbeef;
constexpr double kCodes = 65535;

struct KindRow {
  std::string_view name;
  ChannelKind kind;
  std::size_t floats;
};
constexpr KindRow kKinds[] = {
    {"float", ChannelKind::kFloat, 1},   {"point", ChannelKind::kPoint, 3},
    {"vector", ChannelKind::kVector, 3}, {"normal", ChannelKind::kNormal, 3},
    {"color", ChannelKind::kColor, 3},   {"matrix", ChannelKind::kMatrix, 16}};

const KindRow& kindRow(ChannelKind kind) {
  return *std::find_if(std::begin(kKinds), std::end(kKinds),
                       [kind](const KindRow& row) { return row.kind == kind; });
}

// Takes a header apart; what is missing at the end of the bytes is found out where it matters.
class HeaderParser {
 public:
  HeaderParser(Bytes bytes, const std::string& path) : bytes_(bytes), rest_(bytes), path_(path) {}

  Result<PtcHeader> parse() {
    rest_.take(kMagic.size());
    const auto version = rest_.get<std::int32_t>();
    if (rest_.ok() && (version < 0 || version > kNewestPtcVersion)) {
      return unexpected(4, fmt::format("version {}", version), "0, 1 or 2");
    }
    header_.version = version;
    SURFEIT_RETURN_IF_ERROR(parseCount());
    for (float& bound : header_.bounds) bound = rest_.get<float>();
    if (version >= 1) rest_.take(kUnknownFloats * sizeof(float));
    if (version >= 2) {
      header_.largest_radius = rest_.get<float>();
      rest_.take(kFillerWords * sizeof(kFiller));
    }
    for (float& value : header_.camera.eye_from_world) value = rest_.get<float>();
    for (float& value : header_.camera.screen_from_world) value = rest_.get<float>();
    for (float& value : header_.camera.format) value = rest_.get<float>();
    SURFEIT_RETURN_IF_ERROR(parseVariables());
    if (version >= 1) rest_.take(kUnknownEndBytes);
    if (!rest_.ok()) return endsEarly();
    header_.data_offset = offset();
    return std::move(header_);
  }

 private:
  std::uint64_t offset() const { return bytes_.size() - rest_.remaining(); }

  Status unexpected(std::uint64_t at, std::string_view found, std::string_view expected) const {
    return Status::corruption(
        fmt::format("{}: header at {}: found {}, expected {}", path_, at, found, expected));
  }
  Status endsEarly() const {
    return Status::corruption(
        fmt::format("{}: header ends early: {} bytes, expected more", path_, bytes_.size()));
  }

  // The count is a double: exact for whole numbers up to 2^53, and all are even beyond.
  Status parseCount() {
    const auto count = rest_.get<double>();
    if (!(count >= 0 && count < 0x1p63 && count == std::floor(count))) {
      return unexpected(8, fmt::format("{} points", count), "a whole number below 2^63");
    }
    header_.count = static_cast<std::uint64_t>(count);
    return {};
  }

  Status parseVariables() {
    const std::uint64_t at = offset();
    const auto variable_count = rest_.get<std::int32_t>();
    const auto float_count = rest_.get<std::int32_t>();
    if (!rest_.ok()) return endsEarly();
    if (variable_count < 0 || std::size_t(variable_count) > kMaxPtcVariables) {
      return unexpected(at, fmt::format("{} variables", variable_count),
                        fmt::format("0 to {}", kMaxPtcVariables));
    }
    std::size_t floats = 0;
    for (std::int32_t i = 0; i < variable_count; ++i) {
      SURFEIT_RETURN_IF_ERROR(parseVariable());
      floats += header_.variables.back().floatCount();
    }
    if (float_count < 0 || std::size_t(float_count) != floats) {
      return unexpected(at + 4, fmt::format("{} floats a point", float_count),
                        fmt::format("{} by the types of its variables", floats));
    }
    return {};
  }

  // "color _radiosity": one or more blanks between the words.
  Status parseVariable() {
    const std::uint64_t at = offset();
    const Bytes text = bytes_.subspan(at);
    const auto end = std::find(text.begin(), text.end(), std::byte{'\n'});
    if (end == text.end()) return endsEarly();
    const std::string_view line(reinterpret_cast<const char*>(text.data()),
                                static_cast<std::size_t>(end - text.begin()));
    rest_.take(line.size() + 1);

    const std::size_t blank = std::min(line.find_first_of(" \t"), line.size());
    const auto* const row =
        std::find_if(std::begin(kKinds), std::end(kKinds),
                     [&](const KindRow& kind) { return kind.name == line.substr(0, blank); });
    std::string_view name = line.substr(blank);
    name.remove_prefix(std::min(name.find_first_not_of(" \t"), name.size()));
    while (!name.empty() && static_cast<unsigned char>(name.back()) <= ' ') name.remove_suffix(1);
    if (row == std::end(kKinds) || !isPropertyName(name)) {
      return unexpected(at, quoteText(line),
                        "float, point, vector, normal, color or matrix and a name");
    }
    header_.variables.push_back({std::string(name), row->kind});
    return {};
  }

  Bytes bytes_;
  ByteReader rest_;
  const std::string& path_;
  PtcHeader header_;
};

// sin and cos of the 65536 angles that phi can stand for, from those of its two bytes: 8 KiB that
// stay in the first-level cache, in doubles, so that the floats are as good as computed ones.
class PhiTable {
 public:
  PhiTable() {
    for (int i = 0; i < 256; ++i) {
      high_[i] = at(2 * std::numbers::pi * (i * 256 / kCodes - 0.5));
      low_[i] = at(2 * std::numbers::pi * (i / kCodes));
    }
  }

  std::pair<double, double> sinCos(std::uint16_t phi) const {
    const auto& [high_sin, high_cos] = high_[phi >> 8];
    const auto& [low_sin, low_cos] = low_[phi & 255];
    return {high_sin * low_cos + high_cos * low_sin, high_cos * low_cos - high_sin * low_sin};
  }

 private:
  using SinCos = std::pair<double, double>;
  static SinCos at(double angle) { return {std::sin(angle), std::cos(angle)}; }

  std::array<SinCos, 256> high_, low_;
};

}  // namespace

std::size_t PtcVariable::floatCount() const { return kindRow(kind).floats; }

std::size_t PtcHeader::recordBytes() const {
  std::size_t bytes = kPtcPointBytes;
  for (const PtcVariable& variable : variables) bytes += variable.floatCount() * sizeof(float);
  return bytes;
}

bool recognisesPtc(std::string_view first_bytes) { return first_bytes.starts_with(kMagic); }

Result<PtcHeader> readPtcHeader(ByteInput& input) {
  std::vector<std::byte> bytes(kMaxHeaderBytes);
  SURFEIT_ASSIGN_OR_RETURN(const std::size_t got, input.readSome(0, bytes));
  bytes.resize(got);
  const std::string_view magic(reinterpret_cast<const char*>(bytes.data()),
                               std::min(got, kMagic.size()));
  if (!recognisesPtc(magic)) {
    return Status::corruption(fmt::format("{}: begins with {}, expected {}", input.path(),
                                          quoteText(magic), quoteText(kMagic)));
  }
  return HeaderParser(bytes, input.path()).parse();
}

std::vector<std::byte> formatPtcHeader(const PtcHeader& header) {
  std::vector<std::byte> bytes;
  ByteWriter out(bytes);
  const auto put_all = [&out](const auto& values) {
    for (const auto& value : values) out.put(value);
  };
  out.putBytes(std::as_bytes(std::span(kMagic)));
  out.put(std::int32_t{header.version});
  out.put(static_cast<double>(header.count));
  put_all(header.bounds);
  if (header.version >= 1) put_all(std::array<float, kUnknownFloats>{});
  if (header.version >= 2) {
    out.put(header.largest_radius);
    for (std::size_t i = 0; i < kFillerWords; ++i) out.put(kFiller);
  }
  put_all(header.camera.eye_from_world);
  put_all(header.camera.screen_from_world);
  put_all(header.camera.format);
  out.put(static_cast<std::int32_t>(header.variables.size()));
  out.put(static_cast<std::int32_t>((header.recordBytes() - kPtcPointBytes) / sizeof(float)));
  for (const PtcVariable& variable : header.variables) {
    const std::string line = fmt::format("{} {}\n", kindRow(variable.kind).name, variable.name);
    out.putBytes(std::as_bytes(std::span(line)));
  }
  if (header.version >= 1) put_all(std::array<std::uint8_t, kUnknownEndBytes>{});
  return bytes;
}

PtcNormal encodePtcNormal(const float normal[3]) {
  const double x = normal[0], y = normal[1], z = normal[2];
  const double length = std::sqrt(x * x + y * y + z * z);
  if (!(length > 0 && std::isfinite(length))) return {};
  const double turn = std::atan2(x, y) / (2 * std::numbers::pi) + 0.5;
  const double height = (z / length + 1) / 2;
  PtcNormal code;
  code.phi = static_cast<std::uint16_t>(std::min(std::floor(turn * kCodes + 0.5), kCodes));
  code.z = static_cast<std::uint16_t>(std::clamp(std::floor(height * kCodes + 0.5), 0.0, kCodes));
  // At the pole any phi will do, but this one would be the zero normal
  if (code.phi == 65535 && code.z == 65535) code.phi = 0;
  return code;
}

void decodePtcNormal(PtcNormal code, float normal[3]) {
  static const PhiTable kPhiTable;
  if (code.phi == 65535 && code.z == 65535) {
    normal[0] = normal[1] = normal[2] = 0;
    return;
  }
  const double z = 2 * (code.z / kCodes) - 1;
  const double radius = std::sqrt(std::max(0.0, 1 - z * z));
  const auto [sin_phi, cos_phi] = kPhiTable.sinCos(code.phi);
  normal[0] = static_cast<float>(radius * sin_phi);
  normal[1] = static_cast<float>(radius * cos_phi);
  normal[2] = static_cast<float>(z);
}

}  // namespace surfeit
