#include "io/formats/las_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <optional>
#include <utility>
#include <vector>

#include "io/byte_coding.h"
#include "io/formats/fixed_record_reader.h"

namespace surfeit {
namespace {

constexpr std::string_view kMagic = "LASF";
constexpr std::size_t kHeaderBytes = 227, kHeaderBytes14 = 375;
// Where things stand in the header
constexpr std::size_t kVersion = 24, kHeaderSize = 94, kPointFormat = 104, kScale = 131;
constexpr std::size_t kCount14 = 247;
// Where things stand in every point
constexpr std::size_t kIntensity = 12;

// Either of the two top bits of the point format marks points that are compressed.
constexpr unsigned kLazBits = 0xC0;

// The least record and where things stand in it; 0 where the format has none.
struct PointFormat {
  std::size_t record_bytes, classification, color;
};
constexpr std::array<PointFormat, 11> kPointFormats{{{20, 15, 0},
                                                     {28, 15, 0},
                                                     {26, 15, 20},
                                                     {34, 15, 28},
                                                     {57, 15, 0},
                                                     {63, 15, 28},
                                                     {30, 16, 0},
                                                     {36, 16, 30},
                                                     {38, 16, 30},
                                                     {59, 16, 0},
                                                     {67, 16, 30}}};
// Up to here the five lower bits of the classification are the class, the others are flags
constexpr unsigned kLastFormatWithFlags = 5;
constexpr std::byte kClassBits{31};

struct LasHeader {
  unsigned major = 0, minor = 0, point_format = 0;
  std::uint64_t count = 0, data_offset = 0;
  std::size_t record_bytes = 0;
  std::array<double, 3> scale{}, origin{};
};

class HeaderParser {
 public:
  HeaderParser(Bytes bytes, const std::string& path) : bytes_(bytes), path_(path) {}

  Result<LasHeader> parse() {
    const std::string_view magic(reinterpret_cast<const char*>(bytes_.data()),
                                 std::min(bytes_.size(), kMagic.size()));
    if (!recognisesLas(magic)) return unexpected(0, quotePlyText(magic), quotePlyText(kMagic));
    if (bytes_.size() < kHeaderBytes) return endsEarly(kHeaderBytes);
    header_.major = get<std::uint8_t>(kVersion);
    header_.minor = get<std::uint8_t>(kVersion + 1);
    if (header_.major != 1 || header_.minor > 4) {
      return unexpected(kVersion, fmt::format("version {}.{}", header_.major, header_.minor),
                        "1.0 to 1.4");
    }
    const auto header_size = get<std::uint16_t>(kHeaderSize);
    const std::size_t least_size = header_.minor < 4 ? kHeaderBytes : kHeaderBytes14;
    if (header_size < least_size) {
      return unexpected(kHeaderSize, fmt::format("a header of {} bytes", header_size),
                        fmt::format("{} or more", least_size));
    }
    if (bytes_.size() < least_size) return endsEarly(least_size);
    header_.data_offset = get<std::uint32_t>(kHeaderSize + 2);
    if (header_.data_offset < header_size) {
      return unexpected(kHeaderSize + 2, fmt::format("points at {}", header_.data_offset),
                        fmt::format("{} or more", header_size));
    }
    SURFEIT_RETURN_IF_ERROR(parsePointFormat());
    parseCount();
    SURFEIT_RETURN_IF_ERROR(parseScale());
    return header_;
  }

 private:
  template <typename T>
  T get(std::size_t at) const {
    return ByteReader(bytes_.subspan(at)).get<T>();
  }

  Status unexpected(std::size_t at, std::string_view found, std::string_view expected) const {
    return Status::corruption(
        fmt::format("{}: header at {}: found {}, expected {}", path_, at, found, expected));
  }
  Status endsEarly(std::size_t expected) const {
    return Status::corruption(fmt::format("{}: header ends early: {} bytes, expected {}", path_,
                                          bytes_.size(), expected));
  }

  Status parsePointFormat() {
    const unsigned stored = get<std::uint8_t>(kPointFormat);
    if ((stored & kLazBits) != 0) {
      return Status::corruption(fmt::format(
          "{}: found LAZ, compressed LAS, which is not read: decompress it first (laszip, las2las, "
          "pdal translate)",
          path_));
    }
    header_.point_format = stored;
    if (stored >= kPointFormats.size()) {
      return unexpected(kPointFormat, fmt::format("point format {}", stored), "0 to 10");
    }
    header_.record_bytes = get<std::uint16_t>(kPointFormat + 1);
    if (header_.record_bytes < kPointFormats[stored].record_bytes) {
      return unexpected(kPointFormat + 1, fmt::format("points of {} bytes", header_.record_bytes),
                        fmt::format("{} or more for point format {}",
                                    kPointFormats[stored].record_bytes, stored));
    }
    return {};
  }

  // Version 1.4 has a count of 64 bits; the older one must be 0 where that does not fit, and some
  // writers leave the newer one 0.
  void parseCount() {
    header_.count = get<std::uint32_t>(kPointFormat + 3);
    if (header_.minor < 4) return;
    const auto count = get<std::uint64_t>(kCount14);
    if (count != 0) header_.count = count;
  }

  Status parseScale() {
    for (std::size_t i = 0; i < 3; ++i) {
      const std::size_t scale_at = kScale + i * sizeof(double);
      const std::size_t origin_at = scale_at + 3 * sizeof(double);
      header_.scale[i] = get<double>(scale_at);
      header_.origin[i] = get<double>(origin_at);
      if (!std::isfinite(header_.scale[i]) || header_.scale[i] == 0) {
        return unexpected(scale_at, fmt::format("scale {}", header_.scale[i]),
                          "a finite number other than 0");
      }
      if (!std::isfinite(header_.origin[i])) {
        return unexpected(origin_at, fmt::format("offset {}", header_.origin[i]),
                          "a finite number");
      }
    }
    return {};
  }

  Bytes bytes_;
  const std::string& path_;
  LasHeader header_;
};

class LasReader : public FixedRecordReader {
 public:
  static Result<std::unique_ptr<RowReader>> open(const std::string& path,
                                                 const RowReaderOptions& options) {
    SURFEIT_ASSIGN_OR_RETURN(ByteInput input, ByteInput::open(path, options.access));
    std::array<std::byte, kHeaderBytes14> bytes;
    SURFEIT_ASSIGN_OR_RETURN(const std::size_t got, input.readSome(0, bytes));
    SURFEIT_ASSIGN_OR_RETURN(const LasHeader header,
                             HeaderParser(Bytes(bytes).first(got), path).parse());
    auto reader = std::unique_ptr<LasReader>(new LasReader(std::move(input), header));
    SURFEIT_RETURN_IF_ERROR(reader->addChannels(options.channels));
    SURFEIT_RETURN_IF_ERROR(reader->setRecords(header.data_offset, header.record_bytes));
    return std::unique_ptr<RowReader>(std::move(reader));
  }

  std::string formatName() const override {
    return fmt::format("LAS {}.{} point format {}", header_.major, header_.minor,
                       header_.point_format);
  }

  std::vector<std::string> notes() const override {
    return {
        "returns, flags, scan angles, times and whatever else a point has besides position, "
        "intensity, classification and color are not kept"};
  }

 private:
  LasReader(ByteInput input, const LasHeader& header)
      : FixedRecordReader(std::move(input)), header_(header) {
    element_.name = "vertex";
    element_.count = header.count;
  }

  Status addChannels(std::span<const ChannelRename> renames) {
    const PointFormat& format = kPointFormats[header_.point_format];
    SURFEIT_ASSIGN_OR_RETURN(position_,
                             add("position", 3, ChannelKind::kPoint, PlyType::kFloat64, renames));
    SURFEIT_ASSIGN_OR_RETURN(intensity_,
                             add("intensity", 1, ChannelKind::kFloat, PlyType::kUint16, renames));
    SURFEIT_ASSIGN_OR_RETURN(
        classification_, add("classification", 1, ChannelKind::kFloat, PlyType::kUint8, renames));
    if (format.color != 0) {
      SURFEIT_ASSIGN_OR_RETURN(color_,
                               add("color", 3, ChannelKind::kColor, PlyType::kUint16, renames));
    }
    SURFEIT_RETURN_IF_ERROR(checkChannelsLeft(element_, path()));
    return {};
  }

  // Where the channel begins in a row; nothing when it is dropped.
  Result<std::optional<std::size_t>> add(std::string_view name, std::size_t components,
                                         ChannelKind kind, PlyType type,
                                         std::span<const ChannelRename> renames) {
    const std::size_t at = element_.row_bytes;
    SURFEIT_RETURN_IF_ERROR(addChannel(name, components, kind, type, renames, path(), element_));
    if (element_.row_bytes == at) return std::optional<std::size_t>();
    return std::optional(at);
  }

  void decodeRecords(const std::byte* records, std::size_t count, std::byte* rows) const override {
    const PointFormat& format = kPointFormats[header_.point_format];
    const std::byte class_bits =
        header_.point_format <= kLastFormatWithFlags ? kClassBits : std::byte{255};
    for (std::size_t i = 0; i < count; ++i) {
      const std::byte* const record = records + i * header_.record_bytes;
      std::byte* const row = rows + i * element_.row_bytes;
      if (position_) {
        std::int32_t stored[3];
        double position[3];
        std::memcpy(stored, record, sizeof stored);
        for (std::size_t axis = 0; axis < 3; ++axis) {
          position[axis] = stored[axis] * header_.scale[axis] + header_.origin[axis];
        }
        std::memcpy(row + *position_, position, sizeof position);
      }
      if (intensity_) std::memcpy(row + *intensity_, record + kIntensity, 2);
      if (classification_) row[*classification_] = record[format.classification] & class_bits;
      if (color_) std::memcpy(row + *color_, record + format.color, 6);
    }
  }

  LasHeader header_;
  std::optional<std::size_t> position_, intensity_, classification_, color_;  // places in a row
};

}  // namespace

bool recognisesLas(std::string_view first_bytes) { return first_bytes.starts_with(kMagic); }

Result<std::unique_ptr<RowReader>> openLas(const std::string& path,
                                           const RowReaderOptions& options) {
  return LasReader::open(path, options);
}

}  // namespace surfeit
