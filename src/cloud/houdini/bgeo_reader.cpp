#include "cloud/houdini/bgeo_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <utility>

#include "cloud/houdini/geo_notes.h"
#include "cloud/parts/bytes_behind.h"
#include "cloud/parts/counted_row_reader.h"
#include "cloud/parts/stored_values.h"
#include "storage/byte_input.h"

namespace surfeit {
namespace {

constexpr std::string_view kMagic = "BgeoV";
constexpr std::size_t kHeaderBytes = 41, kWordBytes = 4, kEndBytes = 2;
constexpr std::int32_t kVersion = 5;
constexpr std::int32_t kMaxAttributes = 1024, kMaxStrings = 1 << 20;
// Real points have a few hundred bytes
constexpr std::size_t kMaxRecordBytes = 16 << 10;
constexpr std::uint16_t kMaxValues = 256;
constexpr std::int32_t kFloat = 0, kInteger = 1, kString = 2, kIndexedString = 4, kVector = 5;
// Read at once and decoded together, within the second cache
constexpr std::size_t kBlockBytes = 128 << 10;

template <typename T>
T bigEndian(const std::byte* bytes) {
  std::array<std::byte, sizeof(T)> reversed;
  std::reverse_copy(bytes, bytes + sizeof(T), reversed.begin());
  return std::bit_cast<T>(reversed);
}

// Values of neighbours in a record that become neighbours in a row: floats and integers alike are
// words whose bytes are turned round.
struct WordRun {
  std::size_t from = 0, to = 0, words = 0;
};

class BgeoReader final : public CountedRowReader {
 public:
  explicit BgeoReader(ByteInput input) : input_(std::move(input)) { path_ = input_.path(); }

  Status open(const RowReaderOptions& options) {
    element_.name = "vertex";
    std::int32_t attributes = 0;
    SURFEIT_RETURN_IF_ERROR(readHeader(attributes));
    SURFEIT_RETURN_IF_ERROR(addAttribute("P", 3, ValueType::kFloat32, options));
    record_bytes_ += kWordBytes;  // w
    for (std::int32_t i = 0; i < attributes; ++i) SURFEIT_RETURN_IF_ERROR(readAttribute(options));
    SURFEIT_RETURN_IF_ERROR(checkCount());
    if (has_points_alone_ && input_.size()) {
      std::string note =
          noteOfBytesBehind(*input_.size() - std::min(*input_.size(), endOfPoints()), "point");
      if (!note.empty()) notes_.push_back(std::move(note));
    }
    return {};
  }

  bool isSeekable() const override { return !input_.isCompressed(); }

 private:
  // The next bytes of the header, which is read value by value.
  template <typename T>
  Status next(T& value) {
    std::array<std::byte, sizeof(T)> bytes;
    SURFEIT_RETURN_IF_ERROR(input_.readAt(data_begin_, bytes));
    data_begin_ += sizeof(T);
    value = bigEndian<T>(bytes.data());
    return {};
  }

  Status readHeader(std::int32_t& attributes) {
    std::array<std::byte, kHeaderBytes> bytes;
    SURFEIT_RETURN_IF_ERROR(input_.readAt(0, bytes));
    const auto version = bigEndian<std::int32_t>(&bytes[5]);
    const auto points = bigEndian<std::int32_t>(&bytes[9]);
    attributes = bigEndian<std::int32_t>(&bytes[25]);
    has_points_alone_ = true;
    for (const std::size_t at : {13, 17, 21, 29, 33, 37}) {
      has_points_alone_ = has_points_alone_ && bigEndian<std::int32_t>(&bytes[at]) == 0;
    }
    const auto primitives = bigEndian<std::uint32_t>(&bytes[13]);
    if (std::string note = noteOfGeoPrimitives(primitives); !note.empty()) notes_.push_back(note);
    if (version != kVersion) {
      return damagedAt(5, fmt::format("version {}, expected {}", version, kVersion));
    }
    if (points < 0) return damagedAt(9, fmt::format("{} points, expected none or more", points));
    if (attributes < 0 || attributes > kMaxAttributes) {
      return damagedAt(25,
                       fmt::format("{} attributes, expected 0 to {}", attributes, kMaxAttributes));
    }
    element_.count = static_cast<std::uint64_t>(points);
    format_name_ = "BGEO 5";
    data_begin_ = kHeaderBytes;
    return {};
  }

  Status readAttribute(const RowReaderOptions& options) {
    const std::uint64_t at = data_begin_;
    std::uint16_t length = 0, values = 0;
    std::int32_t type = 0;
    SURFEIT_RETURN_IF_ERROR(next(length));
    std::string name(length, '\0');
    SURFEIT_RETURN_IF_ERROR(
        input_.readAt(data_begin_, std::as_writable_bytes(std::span(name.data(), name.size()))));
    data_begin_ += length;
    SURFEIT_RETURN_IF_ERROR(next(values));
    SURFEIT_RETURN_IF_ERROR(next(type));

    const std::string quoted = quoteText(name);
    if (values == 0 || values > kMaxValues) {
      return damagedAt(at, fmt::format("attribute {} has {} values, expected 1 to {}", quoted,
                                       values, kMaxValues));
    }
    switch (type) {
      case kFloat:
      case kVector:
        data_begin_ += std::uint64_t{values} * kWordBytes;
        return addAttribute(name, values, ValueType::kFloat32, options);
      case kInteger:
        data_begin_ += std::uint64_t{values} * kWordBytes;
        return addAttribute(name, values, ValueType::kInt32, options);
      case kIndexedString:
        notes_.push_back(fmt::format("strings are read as their indices: {}", quoted));
        SURFEIT_RETURN_IF_ERROR(skipStrings());
        return addAttribute(name, values, ValueType::kInt32, options);
      case kString:
        return damagedAt(at, fmt::format("attribute {} has strings (type 2), expected numbers or "
                                         "indexed strings",
                                         quoted));
      default:
        return damagedAt(
            at, fmt::format("attribute {} of type {}, expected 0, 1, 4 or 5", quoted, type));
    }
  }

  // Their number, then the strings.
  Status skipStrings() {
    std::int32_t strings = 0;
    SURFEIT_RETURN_IF_ERROR(next(strings));
    if (strings < 0 || strings > kMaxStrings) {
      return damagedAt(data_begin_ - 4,
                       fmt::format("{} strings, expected 0 to {}", strings, kMaxStrings));
    }
    for (std::int32_t i = 0; i < strings; ++i) {
      std::uint16_t length = 0;
      SURFEIT_RETURN_IF_ERROR(next(length));
      data_begin_ += length;
    }
    return {};
  }

  Status addAttribute(const std::string& name, std::size_t values, ValueType type,
                      const RowReaderOptions& options) {
    const std::size_t to = element_.row_bytes;
    SURFEIT_RETURN_IF_ERROR(addChannel(name, values, guessChannelKind(name, values), type,
                                       options.channels, path_, element_));
    const std::size_t from = record_bytes_;
    record_bytes_ += values * kWordBytes;
    if (record_bytes_ > kMaxRecordBytes) {
      return damagedAt(data_begin_, fmt::format("points of more than {} bytes", kMaxRecordBytes));
    }
    if (element_.row_bytes == to) return {};  // dropped
    if (!runs_.empty() && runs_.back().from + runs_.back().words * kWordBytes == from) {
      runs_.back().words += values;
    } else {
      runs_.push_back({from, to, values});
    }
    return {};
  }

  // And two bytes that end files.
  std::uint64_t endOfPoints() const {
    return data_begin_ + element_.count * record_bytes_ + kEndBytes;
  }

  Status checkCount() const {
    const std::optional<std::uint64_t> size = input_.size();
    if (!size) return {};
    const std::uint64_t fit = (*size - std::min(*size, data_begin_)) / record_bytes_;
    if (element_.count <= fit) return {};
    return damagedRow(fit, fmt::format("file ends early: {} bytes at {} hold {} points of {} "
                                       "bytes, expected {}",
                                       *size - std::min(*size, data_begin_), data_begin_, fit,
                                       record_bytes_, element_.count));
  }

  Status decodeRows(std::size_t count, std::byte* rows) override {
    const std::size_t block = std::max<std::size_t>(1, kBlockBytes / record_bytes_);
    for (std::size_t done = 0; done < count;) {
      const std::size_t step = std::min(count - done, block);
      const std::uint64_t at = data_begin_ + (row() + done) * record_bytes_;
      SURFEIT_ASSIGN_OR_RETURN(const Bytes records,
                               input_.readView(at, step * record_bytes_, buffer_));
      if (records.size() < step * record_bytes_) {
        return damagedRow(row() + done + records.size() / record_bytes_,
                          fmt::format("file ends early: {} bytes at {}, expected {}",
                                      records.size(), at, step * record_bytes_));
      }
      decodeBlock(records.data(), step, rows + done * element_.row_bytes);
      done += step;
    }
    return {};
  }

  void decodeBlock(const std::byte* records, std::size_t count, std::byte* rows) const {
    for (const WordRun& run : runs_) {
      const StoredPlace place{StoredType::kFloat32, true, run.words, record_bytes_};
      decodeStored(place, records + run.from, count, rows + run.to, element_.row_bytes);
    }
  }

  Status checkEnd() override {
    if (has_points_alone_) {
      SURFEIT_RETURN_IF_ERROR(checkNothingBehind(input_, endOfPoints(), "point"));
    }
    return input_.checkUnchanged();
  }

  ByteInput input_;
  std::uint64_t data_begin_ = 0;
  bool has_points_alone_ = true;  // no primitives, groups and other attributes behind them
  std::size_t record_bytes_ = 0;
  std::vector<WordRun> runs_;
  AlignedBuffer buffer_;
};

}  // namespace

bool recognisesBgeo(std::string_view first_bytes) { return first_bytes.starts_with(kMagic); }

Result<std::unique_ptr<RowReader>> openBgeo(const std::string& path,
                                            const RowReaderOptions& options) {
  SURFEIT_ASSIGN_OR_RETURN(ByteInput input, ByteInput::open(path, options.access));
  auto reader = std::make_unique<BgeoReader>(std::move(input));
  SURFEIT_RETURN_IF_ERROR(reader->open(options));
  return std::unique_ptr<RowReader>(std::move(reader));
}

}  // namespace surfeit
