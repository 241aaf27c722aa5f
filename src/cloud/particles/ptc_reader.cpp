#include "cloud/particles/ptc_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "cloud/parts/bytes_behind.h"
#include "cloud/parts/fixed_record_reader.h"

namespace surfeit {
namespace {

constexpr std::size_t kNormalOffset = 12, kRadiusOffset = 16;
constexpr std::size_t kTwinNameChars = 48;
constexpr std::uint64_t kRadiusSamples = 10'000;

// Whether the points have no sizes: each has a radius, and so zero stands for none. By a sample of
// the whole file; false for a compressed one, which cannot be read here and there.
Result<bool> lacksRadii(ByteInput& input, const PtcHeader& header) {
  if (!input.size() || header.count == 0) return false;
  const std::uint64_t samples = std::min(header.count, kRadiusSamples);
  for (std::uint64_t i = 0; i < samples; ++i) {
    const std::uint64_t point = i * (header.count / samples);
    float radius = 0;
    SURFEIT_ASSIGN_OR_RETURN(
        const std::size_t size,
        input.readSome(header.data_offset + point * header.recordBytes() + kRadiusOffset,
                       std::as_writable_bytes(std::span(&radius, 1))));
    if (size < sizeof radius) return false;  // the reader says that the file ends early
    if (radius != 0) return false;
  }
  return true;
}

class PtcReader : public FixedRecordReader {
 public:
  static Result<std::unique_ptr<RowReader>> open(const std::string& path,
                                                 const RowReaderOptions& options) {
    SURFEIT_ASSIGN_OR_RETURN(ByteInput input, ByteInput::open(path, options.access));
    SURFEIT_ASSIGN_OR_RETURN(PtcHeader header, readPtcHeader(input));
    SURFEIT_ASSIGN_OR_RETURN(const bool lacks_radii, lacksRadii(input, header));
    auto reader = std::unique_ptr<PtcReader>(new PtcReader(std::move(input), std::move(header)));
    reader->lacks_radii_ = lacks_radii;
    reader->refuseBytesBehind();
    SURFEIT_RETURN_IF_ERROR(reader->addChannels(options.channels));
    SURFEIT_RETURN_IF_ERROR(
        reader->setRecords(reader->header_.data_offset, reader->header_.recordBytes()));
    return std::unique_ptr<RowReader>(std::move(reader));
  }

  const PtcCamera& camera() const { return header_.camera; }

  std::string formatName() const override { return fmt::format("PTC {}", header_.version); }

  std::vector<std::string> notes() const override {
    std::vector<std::string> notes;
    if (lacks_radii_) notes.emplace_back("all radii are 0: the points are read without sizes");
    if (trailingBytes() > 0) {
      notes.push_back(noteOfBytesBehind(trailingBytes(), "point"));
    }
    return notes;
  }

 private:
  struct Copy {  // floats that stay together
    std::size_t record_offset = 0, row_offset = 0, bytes = 0;
  };

  PtcReader(ByteInput input, PtcHeader header)
      : FixedRecordReader(std::move(input)), header_(std::move(header)) {
    element_.name = "vertex";
    element_.count = header_.count;
  }

  Status addChannels(std::span<const ChannelRename> renames) {
    std::size_t offset = 0;
    SURFEIT_RETURN_IF_ERROR(addFloats("P", ChannelKind::kPoint, 3, offset, renames));
    SURFEIT_ASSIGN_OR_RETURN(normal_row_offset_, add("N", ChannelKind::kNormal, 3, renames));
    offset = kRadiusOffset;
    if (lacks_radii_) {
      offset += sizeof(float);
    } else {
      SURFEIT_RETURN_IF_ERROR(addFloats("radius", ChannelKind::kFloat, 1, offset, renames));
    }
    for (const PtcVariable& variable : header_.variables) {
      SURFEIT_RETURN_IF_ERROR(
          addFloats(variable.name, variable.kind, variable.floatCount(), offset, renames));
    }
    SURFEIT_RETURN_IF_ERROR(checkChannelsLeft(element_, path()));
    return {};
  }

  // Floats that stand in a record at `offset`, which is moved behind them.
  Status addFloats(std::string_view name, ChannelKind kind, std::size_t count, std::size_t& offset,
                   std::span<const ChannelRename> renames) {
    SURFEIT_ASSIGN_OR_RETURN(const std::optional<std::size_t> at, add(name, kind, count, renames));
    const std::size_t bytes = count * sizeof(float);
    if (at) {
      // Neighbours in record and row are copied at once
      Copy* const last = copies_.empty() ? nullptr : &copies_.back();
      if (last && last->record_offset + last->bytes == offset &&
          last->row_offset + last->bytes == *at) {
        last->bytes += bytes;
      } else {
        copies_.push_back({offset, *at, bytes});
      }
    }
    offset += bytes;
    return {};
  }

  // Where the channel begins in a row; nothing when it is dropped. Variables may share a name, and
  // may have that of another channel after renames and well-known names. Long names are cut off so
  // that what tells twins apart is kept.
  Result<std::optional<std::size_t>> add(std::string_view name, ChannelKind kind, std::size_t count,
                                         std::span<const ChannelRename> renames) {
    const std::size_t at = element_.row_bytes;
    std::string free_name(name);
    for (int twin = 2; isTaken(propertyNames(free_name, count, kind, renames)); ++twin) {
      free_name = fmt::format("{}_{}", name.substr(0, kTwinNameChars), twin);
    }
    SURFEIT_RETURN_IF_ERROR(
        addChannel(free_name, count, kind, ValueType::kFloat32, renames, path(), element_));
    if (element_.row_bytes == at) return std::optional<std::size_t>();
    return std::optional(at);
  }

  bool isTaken(const std::vector<std::string>& names) const {
    return std::any_of(names.begin(), names.end(),
                       [this](const std::string& name) { return element_.find(name) != nullptr; });
  }

  void decodeRecords(const std::byte* records, std::size_t count, std::byte* rows) const override {
    const std::size_t record_bytes = header_.recordBytes();
    for (std::size_t i = 0; i < count; ++i) {
      const std::byte* const record = records + i * record_bytes;
      std::byte* const row = rows + i * element_.row_bytes;
      for (const Copy& copy : copies_) {
        std::memcpy(row + copy.row_offset, record + copy.record_offset, copy.bytes);
      }
      if (!normal_row_offset_) continue;
      std::uint16_t code[2];
      float normal[3];
      std::memcpy(code, record + kNormalOffset, sizeof code);
      decodePtcNormal({code[0], code[1]}, normal);
      std::memcpy(row + *normal_row_offset_, normal, sizeof normal);
    }
  }

  PtcHeader header_;
  bool lacks_radii_ = false;
  std::vector<Copy> copies_;
  std::optional<std::size_t> normal_row_offset_;
};

}  // namespace

Result<std::unique_ptr<RowReader>> openPtc(const std::string& path,
                                           const RowReaderOptions& options) {
  return PtcReader::open(path, options);
}

const PtcCamera* ptcCameraOf(const RowReader& reader) {
  const auto* const ptc = dynamic_cast<const PtcReader*>(&reader.file());
  return ptc ? &ptc->camera() : nullptr;
}

}  // namespace surfeit
