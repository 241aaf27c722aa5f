#include "cloud/scans/las_format.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <optional>
#include <utility>

#include "cloud/scans/las_crs.h"
#include "storage/byte_coding.h"

namespace surfeit {
namespace {

using Places = LasHeaderPlaces;

// Either of the two top bits of the point format marks points that are compressed
constexpr unsigned kLazBits = 0xC0;
// What is read of one record of variable length; those that are looked at are far shorter
constexpr std::size_t kMaxRecordBytes = 1 << 20;
// Records that are looked at: real files have a few
constexpr std::size_t kMaxRecords = 4096;
constexpr std::size_t kBlockBytes = 1 << 20;

class HeaderParser {
 public:
  HeaderParser(Bytes bytes, const std::string& path) : bytes_(bytes), path_(path) {}

  Result<LasHeader> parse() {
    const std::string_view magic(reinterpret_cast<const char*>(bytes_.data()),
                                 std::min(bytes_.size(), kLasMagic.size()));
    if (magic != kLasMagic) return unexpected(0, quoteText(magic), quoteText(kLasMagic));
    if (bytes_.size() < kLasHeaderBytes12) return endsEarly(kLasHeaderBytes12);
    const unsigned major = get<std::uint8_t>(Places::kVersion);
    header_.minor = get<std::uint8_t>(Places::kVersion + 1);
    if (major != 1 || header_.minor > 5) {
      return unexpected(Places::kVersion, fmt::format("version {}.{}", major, header_.minor),
                        "1.0 to 1.5");
    }
    header_.header_size = get<std::uint16_t>(Places::kHeaderSize);
    const std::size_t least_size = header_.minor < 4   ? kLasHeaderBytes12
                                   : header_.minor < 5 ? kLasHeaderBytes14
                                                       : kLasHeaderBytes15;
    if (header_.header_size < least_size) {
      return unexpected(Places::kHeaderSize,
                        fmt::format("a header of {} bytes", header_.header_size),
                        fmt::format("{} or more", least_size));
    }
    if (bytes_.size() < least_size) return endsEarly(least_size);
    header_.data_offset = get<std::uint32_t>(Places::kDataOffset);
    if (header_.data_offset < header_.header_size) {
      return unexpected(Places::kDataOffset, fmt::format("points at {}", header_.data_offset),
                        fmt::format("{} or more", header_.header_size));
    }
    SURFEIT_RETURN_IF_ERROR(parsePointFormat());
    SURFEIT_RETURN_IF_ERROR(parseScale());
    parseCounts();
    const std::size_t kept = std::min<std::uint64_t>(header_.header_size, bytes_.size());
    header_.bytes.assign(bytes_.begin(), bytes_.begin() + static_cast<std::ptrdiff_t>(kept));
    header_.path = path_;
    return std::move(header_);
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
    const unsigned stored = get<std::uint8_t>(Places::kPointFormat);
    if ((stored & kLazBits) != 0) {
      return Status::corruption(fmt::format(
          "{}: found LAZ, compressed LAS (or COPC, which is LAZ inside), which is not read: unpack "
          "it first: `pdal translate IN.laz OUT.las`, `laszip64 -i IN.laz -o OUT.las` (LAStools), "
          "or in Python `pip install laspy[lazrs]` and "
          "`laspy.read(\"IN.laz\").write(\"OUT.las\")`",
          path_));
    }
    header_.point_format = stored;
    if (stored >= kLasPointFormats) {
      return unexpected(Places::kPointFormat, fmt::format("point format {}", stored), "0 to 10");
    }
    if (header_.minor >= 5 && stored < 6) {
      return unexpected(Places::kPointFormat, fmt::format("point format {}", stored),
                        "6 to 10 in version 1.5");
    }
    header_.record_bytes = get<std::uint16_t>(Places::kRecordBytes);
    if (header_.record_bytes < lasRecordBytes(stored)) {
      return unexpected(
          Places::kRecordBytes, fmt::format("points of {} bytes", header_.record_bytes),
          fmt::format("{} or more for point format {}", lasRecordBytes(stored), stored));
    }
    return {};
  }

  // Version 1.4 has a count of 64 bits; the older one must be 0 where that does not fit, and some
  // writers leave the newer one 0.
  void parseCounts() {
    header_.variable_count = get<std::uint32_t>(Places::kRecordCount);
    header_.count = get<std::uint32_t>(Places::kCount);
    if (header_.minor == 3 && bytes_.size() >= kLasHeaderBytes13 &&
        header_.header_size >= kLasHeaderBytes13) {
      // Its waveforms are the only record that may stand behind the points
      header_.extended_offset = get<std::uint64_t>(Places::kWaveforms);
      header_.extended_count = header_.extended_offset != 0;
    }
    if (header_.minor < 4) return;
    const auto count = get<std::uint64_t>(Places::kCount64);
    if (count != 0) header_.count = count;
    header_.extended_offset = get<std::uint64_t>(Places::kExtendedOffset);
    header_.extended_count = get<std::uint32_t>(Places::kExtendedCount);
    if (header_.minor < 5) return;
    if (const auto offset = get<std::uint16_t>(Places::kTimeOffset); offset != 0) {
      header_.notes.push_back(fmt::format(
          "gps_time counts from the time offset of the header, {} million seconds", offset));
    }
  }

  Status parseScale() {
    for (std::size_t i = 0; i < 3; ++i) {
      const std::size_t scale_at = Places::kScale + i * sizeof(double);
      const std::size_t origin_at = Places::kOrigin + i * sizeof(double);
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

// How many points there are, whatever the header counts.
class PointCounter {
 public:
  PointCounter(ByteInput& input, LasHeader& header) : input_(input), header_(header) {}

  Status count() {
    SURFEIT_RETURN_IF_ERROR(findEnd());
    const std::uint64_t stated = header_.count;
    const std::uint64_t room = (end_ - std::min(end_, header_.data_offset)) / header_.record_bytes;
    if (room < stated) {
      return Status::corruption(fmt::format(
          "{}: file ends early: {} bytes at {} hold {} records of {} bytes, expected {}: copy or "
          "export it again",
          input_.path(), end_ - std::min(end_, header_.data_offset), header_.data_offset, room,
          header_.record_bytes, stated));
    }
    const std::uint64_t tail_at = header_.data_offset + stated * header_.record_bytes;
    if (tail_at == end_) return {};
    SURFEIT_ASSIGN_OR_RETURN(const std::uint64_t filled_end, findFilledEnd(tail_at));
    const std::uint64_t filled =
        (filled_end - tail_at + header_.record_bytes - 1) / header_.record_bytes;
    const std::uint64_t added = std::min(room - stated, filled);
    SURFEIT_ASSIGN_OR_RETURN(const bool are_points, looksLikePoints(tail_at, added));
    if (added > 0 && are_points) {
      header_.count += added;
      header_.notes.push_back(fmt::format(
          "the header counts {} points, the file has {}: all are read", stated, header_.count));
    }
    const std::uint64_t read_end = header_.data_offset + header_.count * header_.record_bytes;
    if (end_ > read_end) {
      header_.notes.push_back(
          fmt::format("{} bytes behind the last point are no points and are not read{}",
                      end_ - read_end, filled == 0 ? ": all are 0" : ""));
    }
    return {};
  }

 private:
  // Where points end at the latest: at the end of the file, or where something else begins.
  Status findEnd() {
    if (input_.size()) {
      end_ = *input_.size();
    } else {
      std::vector<std::byte> block(kBlockBytes);
      for (std::uint64_t at = header_.data_offset;;) {
        SURFEIT_ASSIGN_OR_RETURN(const std::size_t got, input_.readSome(at, block));
        at += got;
        end_ = at;
        if (got < block.size()) break;
      }
    }
    const std::uint64_t room = (end_ - std::min(end_, header_.data_offset)) / header_.record_bytes;
    if (header_.count > room) return {};
    const std::uint64_t counted_end = header_.data_offset + header_.count * header_.record_bytes;
    const auto stopAt = [&](std::uint64_t offset) {
      if (offset >= counted_end && offset < end_) end_ = offset;
    };
    if (header_.extended_count > 0) stopAt(header_.extended_offset);
    if (header_.minor >= 4) {
      stopAt(ByteReader(Bytes(header_.bytes).subspan(Places::kWaveforms)).get<std::uint64_t>());
    }
    return {};
  }

  // Behind the last byte from `at` on that is not 0: files that were made larger in advance end
  // with zeros.
  Result<std::uint64_t> findFilledEnd(std::uint64_t at) {
    std::vector<std::byte> block(kBlockBytes);
    if (!input_.isCompressed()) {
      for (std::uint64_t end = end_; end > at;) {
        const std::uint64_t begin = end - std::min<std::uint64_t>(end - at, block.size());
        const std::span part = std::span(block).first(static_cast<std::size_t>(end - begin));
        SURFEIT_RETURN_IF_ERROR(input_.readAt(begin, part));
        for (; end > begin; --end) {
          if (part[static_cast<std::size_t>(end - begin - 1)] != std::byte{0}) return end;
        }
      }
      return at;
    }
    std::uint64_t filled = at;
    for (std::uint64_t begin = at; begin < end_; begin += block.size()) {
      const std::span part = std::span(block).first(
          static_cast<std::size_t>(std::min<std::uint64_t>(end_ - begin, block.size())));
      SURFEIT_RETURN_IF_ERROR(input_.readAt(begin, part));
      for (std::size_t i = 0; i < part.size(); ++i) {
        if (part[i] != std::byte{0}) filled = begin + i + 1;
      }
    }
    return filled;
  }

  // Whether `count` records from `at` on may be points: they fill the place up, or the first of
  // them lie where the header says that points are, or not far from it.
  Result<bool> looksLikePoints(std::uint64_t at, std::uint64_t count) {
    if (count == 0) return false;
    if ((end_ - at) % header_.record_bytes == 0) return true;
    std::vector<std::byte> record(header_.record_bytes);
    for (std::uint64_t i = 0; i < std::min<std::uint64_t>(count, 64); ++i) {
      SURFEIT_RETURN_IF_ERROR(input_.readAt(at + i * header_.record_bytes, record));
      for (std::size_t axis = 0; axis < 3; ++axis) {
        std::int32_t stored = 0;
        double bounds[2];
        std::memcpy(&stored, &record[4 * axis], sizeof stored);
        std::memcpy(bounds, &header_.bytes[Places::kBounds + 16 * axis], sizeof bounds);
        const double value = stored * header_.scale[axis] + header_.origin[axis];
        const double size = bounds[0] - bounds[1];
        if (!(value >= bounds[1] - size && value <= bounds[0] + size)) return false;
      }
    }
    return true;
  }

  ByteInput& input_;
  LasHeader& header_;
  std::uint64_t end_ = 0;
};

// The data of a record, at most kMaxRecordBytes of it.
Result<std::vector<std::byte>> readData(ByteInput& input, const LasRecord& record) {
  const std::size_t head = record.is_extended ? kLasExtendedHeader : kLasRecordHeader;
  std::vector<std::byte> data(std::min<std::uint64_t>(record.bytes - head, kMaxRecordBytes));
  SURFEIT_RETURN_IF_ERROR(input.readAt(record.offset + head, data));
  return data;
}

// What the records of variable length say.
Status readRecords(ByteInput& input, LasHeader& header) {
  bool is_whole = true;
  SURFEIT_ASSIGN_OR_RETURN(const std::vector<LasRecord> records,
                           findLasRecords(input, header, is_whole));
  if (!is_whole) {
    header.notes.push_back(
        fmt::format("its records of variable length end early: {} of {} are read", records.size(),
                    std::uint64_t{header.variable_count} + header.extended_count));
  }
  LasCrs crs;
  std::string others;
  std::size_t other_count = 0;
  for (const LasRecord& record : records) {
    const bool is_extra = record.user == kLasSpecUser && record.number == kLasExtraBytesRecord;
    if (is_extra && header.descriptors.size() < kMaxRecordBytes) {
      SURFEIT_ASSIGN_OR_RETURN(std::vector<std::byte> data, readData(input, record));
      data.resize(data.size() / kLasDescriptorBytes * kLasDescriptorBytes);
      // One record describes what follows that of another; some writers repeat theirs at the end
      if (data != header.descriptors) {
        header.descriptors.insert(header.descriptors.end(), data.begin(), data.end());
      }
    } else if (record.user == kLasProjectionUser) {
      SURFEIT_ASSIGN_OR_RETURN(const std::vector<std::byte> data, readData(input, record));
      crs.add(record.number, data);
    } else if (!is_extra && ++other_count <= 6) {
      others += fmt::format(" {} {},", quoteText(record.user), record.number);
    }
  }
  header.crs = crs.comments();
  if (other_count > 0) {
    others.pop_back();
    header.notes.push_back(fmt::format("records of variable length are kept only by .las:{}{}",
                                       others, other_count > 6 ? ", ..." : ""));
  }
  return {};
}

}  // namespace

Result<std::vector<LasRecord>> findLasRecords(ByteInput& input, const LasHeader& header,
                                              bool& is_whole) {
  std::vector<LasRecord> records;
  is_whole = true;
  // Takes `count` records from `at` on that end at `end` or before
  const auto walk = [&](std::uint64_t at, std::uint64_t count, bool is_extended,
                        std::uint64_t end) -> Status {
    const std::size_t head_bytes = is_extended ? kLasExtendedHeader : kLasRecordHeader;
    std::array<std::byte, kLasExtendedHeader> head;
    for (; count > 0; --count) {
      SURFEIT_ASSIGN_OR_RETURN(const std::size_t got,
                               input.readSome(at, std::span(head).first(head_bytes)));
      ByteReader reader(Bytes(head).first(got));
      reader.take(2);
      LasRecord record;
      record.user = lasTextOf(reader.take(16));
      record.number = reader.get<std::uint16_t>();
      record.is_extended = is_extended;
      record.offset = at;
      record.bytes = is_extended ? reader.get<std::uint64_t>() : reader.get<std::uint16_t>();
      const bool fits = got == head_bytes && at <= end && end - at >= head_bytes &&
                        record.bytes <= end - at - head_bytes;
      if (!fits || records.size() == kMaxRecords) {
        is_whole = false;
        return {};
      }
      record.bytes += head_bytes;
      at += record.bytes;
      records.push_back(std::move(record));
    }
    return {};
  };
  SURFEIT_RETURN_IF_ERROR(
      walk(header.header_size, header.variable_count, false, header.data_offset));
  if (header.extended_count > 0) {
    const std::uint64_t end = input.size().value_or(~std::uint64_t{0} >> 1);
    SURFEIT_RETURN_IF_ERROR(walk(header.extended_offset, header.extended_count, true, end));
  }
  return records;
}

Result<LasHeader> readLasHeader(ByteInput& input) {
  std::array<std::byte, kLasHeaderBytes15> bytes;
  SURFEIT_ASSIGN_OR_RETURN(const std::size_t got, input.readSome(0, bytes));
  SURFEIT_ASSIGN_OR_RETURN(LasHeader header,
                           HeaderParser(Bytes(bytes).first(got), input.path()).parse());
  SURFEIT_RETURN_IF_ERROR(readRecords(input, header));
  SURFEIT_RETURN_IF_ERROR(PointCounter(input, header).count());
  const auto encoding =
      ByteReader(Bytes(header.bytes).subspan(Places::kEncoding)).get<std::uint16_t>();
  if ((encoding & (kLasInternalWaveforms | kLasExternalWaveforms)) != 0) {
    header.notes.push_back("waveforms are not read, only where they stand");
  }
  return header;
}

}  // namespace surfeit
