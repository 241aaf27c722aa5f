#include "cloud/scans/pcd_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "cloud/parts/bytes_behind.h"
#include "cloud/parts/counted_row_reader.h"
#include "cloud/parts/fixed_record_reader.h"
#include "cloud/parts/property_renames.h"
#include "cloud/parts/spooled_input.h"
#include "cloud/rows/number_change.h"
#include "cloud/rows/packed_colors.h"
#include "cloud/scans/lzf_stream.h"
#include "cloud/text/text_rows.h"
#include "cloud/text/xyz_layout.h"

namespace surfeit {
namespace {

constexpr std::size_t kTextBlockRows = 4096;
constexpr std::size_t kPassBytes = 256 << 10;

// How records become rows.
class PcdLayout {
 public:
  // Of points as `header` has them. In a text, 64-bit integers stand in records as doubles, and so
  // do floats that code a color, and all positions: a text may have more digits than floats.
  static Result<PcdLayout> create(const PcdHeader& header, std::span<const ChannelRename> renames,
                                  const std::string& path, RowLayout& element) {
    PcdLayout layout;
    for (const PcdField& field : header.fields) layout.addField(field, header.is_text);

    // Names after renames, then places in a row
    const std::vector<RowProperty> renamed = renamedProperties(layout.all_, renames);
    for (std::size_t i = 0; i < renamed.size(); ++i) {
      if (renamed[i].name.empty()) continue;
      if (element.find(renamed[i].name) != nullptr) {
        return Status::corruption(
            fmt::format("{}: field {} would be a second {}, expected another name", path,
                        layout.all_.properties[i].name, renamed[i].name));
      }
      layout.addMove(layout.values_[i], element.row_bytes);
      for (PackedReal& packed : layout.packed_) {
        const std::size_t at = layout.values_[i].offset;
        if (at >= packed.offset && at < packed.offset + 4) packed.to.push_back(element.row_bytes);
      }
      element.properties.push_back(renamed[i]);
      element.properties.back().offset = element.row_bytes;
      element.row_bytes += valueTypeBytes(element.properties.back().type);
    }
    SURFEIT_RETURN_IF_ERROR(checkChannelsLeft(element, path));
    layout.row_bytes_ = element.row_bytes;
    return layout;
  }

  std::size_t recordBytes() const { return record_bytes_; }
  const std::vector<TextColumn>& columns() const { return columns_; }

  // Whether rows are the records as they stand.
  bool areRecordsRows() const {
    return record_bytes_ == row_bytes_ && moves_are_plain_ &&
           std::all_of(moves_.begin(), moves_.end(),
                       [](const Move& move) { return move.from == move.to; });
  }

  // Whether colors stand in floats, and how many that were decoded were nan: no color, and black.
  bool hasPackedReals() const { return !packed_.empty(); }
  std::uint64_t lostColors() const { return lost_colors_; }
  const LostDigits& digits() const { return digits_; }

  // What a text has for packed colors becomes their four bytes.
  void packColors(std::byte* records, std::size_t count) const {
    for (const std::size_t offset : packed_reals_) {
      std::byte* at = records + offset;
      for (std::size_t i = 0; i < count; ++i, at += record_bytes_) {
        double value;
        std::memcpy(&value, at, sizeof value);
        digits_.add(value);
        const std::uint32_t bits = packedBits(value);
        std::memcpy(at, &bits, sizeof bits);
      }
    }
  }

  void decode(const std::byte* records, std::size_t count, std::byte* rows) const {
    for (const Move& move : moves_) {
      const StoredPlace place{move.type, false, move.components, record_bytes_};
      decodeStored(place, records + move.from, count, rows + move.to, row_bytes_);
    }
    for (const PackedReal& packed : packed_) blacken(packed, records, count, rows);
  }

 private:
  struct Value {  // of a record
    StoredType type = StoredType::kFloat32;
    std::size_t offset = 0;
  };
  struct Move {  // of neighbours in record and row
    StoredType type = StoredType::kFloat32;
    std::size_t from = 0, to = 0, components = 1;
  };

  struct PackedReal {             // a color in a float
    std::size_t offset = 0;       // of a record
    std::vector<std::size_t> to;  // places of its codes in a row
  };

  // Codes of no color.
  void blacken(const PackedReal& packed, const std::byte* records, std::size_t count,
               std::byte* rows) const {
    for (std::size_t i = 0; i < count; ++i) {
      std::uint32_t bits;
      std::memcpy(&bits, records + i * record_bytes_ + packed.offset, sizeof bits);
      if (bits != kNoPackedColor) continue;
      ++lost_colors_;
      for (const std::size_t to : packed.to) rows[i * row_bytes_ + to] = std::byte{0};
    }
  }

  static bool isPosition(std::string_view name) {
    return name == "x" || name == "y" || name == "z" || name == "X" || name == "Y" || name == "Z";
  }

  void addField(const PcdField& field, bool is_text) {
    ValueType row_type = plyTypeOf(field.type);
    const bool is_float_text = is_text && row_type == ValueType::kFloat32;
    if (is_float_text && field.isPackedColor()) {
      row_type = ValueType::kFloat64;
      packed_reals_.push_back(record_bytes_);
    } else if (is_float_text && isPosition(field.name)) {
      row_type = ValueType::kFloat64;
    }
    const StoredType type = is_text ? surfeit::storedTypeOf(row_type) : field.type;
    const std::size_t bytes = field.count * storedBytes(type);
    if (is_text) {
      for (std::size_t i = 0; i < field.count; ++i) {
        columns_.push_back(
            {field.name, row_type, record_bytes_ + i * storedBytes(type), !field.isPadding()});
      }
    }
    if (field.isPackedColor()) {
      if (field.type == StoredType::kFloat32) packed_.push_back({record_bytes_, {}});
      // Little-endian: blue is the first byte
      addProperty("red", {StoredType::kUint8, record_bytes_ + 2});
      addProperty("green", {StoredType::kUint8, record_bytes_ + 1});
      addProperty("blue", {StoredType::kUint8, record_bytes_});
      if (field.name == "rgba") addProperty("alpha", {StoredType::kUint8, record_bytes_ + 3});
    } else if (!field.isPadding()) {
      for (std::size_t i = 0; i < field.count; ++i) {
        const std::string name =
            field.count == 1 ? field.name : fmt::format("{}_{}", field.name, i);
        addProperty(propertyName(name), {type, record_bytes_ + i * storedBytes(type)});
      }
    }
    record_bytes_ += bytes;
  }

  // The letters of the file, made fit for a property.
  static std::string propertyName(const std::string& name) {
    std::string fit = name.substr(0, 56);
    std::replace_if(
        fit.begin(), fit.end(), [](char c) { return !(c > ' ' && c < '\x7f'); }, '_');
    return fit;
  }

  void addProperty(const std::string& name, Value value) {
    RowProperty property;
    property.name = names_.add(name);
    property.type = plyTypeOf(value.type);
    all_.properties.push_back(std::move(property));
    values_.push_back(value);
  }

  void addMove(const Value& value, std::size_t to) {
    if (plyTypeOf(value.type) == ValueType::kFloat64 && value.type != StoredType::kFloat64) {
      moves_are_plain_ = false;
    }
    const std::size_t bytes = storedBytes(value.type);
    if (!moves_.empty()) {
      Move& last = moves_.back();
      const std::size_t size = last.components * bytes;
      if (last.type == value.type && last.from + size == value.offset && last.to + size == to) {
        ++last.components;
        return;
      }
    }
    moves_.push_back({value.type, value.offset, to, 1});
  }

  RowLayout all_;  // properties as the file has them, and where they stand in a record
  DistinctNames names_;
  std::vector<Value> values_;
  std::vector<TextColumn> columns_;
  std::size_t record_bytes_ = 0, row_bytes_ = 0;
  std::vector<Move> moves_;
  bool moves_are_plain_ = true;
  std::vector<std::size_t> packed_reals_;  // where doubles stand in records that code colors
  std::vector<PackedReal> packed_;
  mutable std::uint64_t lost_colors_ = 0;
  mutable LostDigits digits_;
};

std::string nameOfFormat(const PcdHeader& header) {
  return fmt::format("PCD {} {}", header.version,
                     header.is_text         ? "ascii"
                     : header.is_compressed ? "binary_compressed"
                                            : "binary");
}

std::vector<std::string> notesOf(const PcdHeader& header) {
  std::vector<std::string> notes;
  if (header.has_view_point) {
    notes.emplace_back(
        "the view point is not kept: positions are as the file has them; convert --transform moves "
        "them, where they are relative to it");
  }
  if (header.grid_count) {
    notes.push_back(
        fmt::format("WIDTH times HEIGHT are {} points, POINTS {}: the latter are read, in the "
                    "order of the file",
                    *header.grid_count, header.count));
  }
  std::map<std::string, int> times;
  for (const PcdField& field : header.fields) times[field.name] += field.isPadding() ? 0 : 1;
  for (const auto& [name, count] : times) {
    if (count < 2) continue;
    notes.push_back(fmt::format("field {} comes {} times: the later ones get numbers behind it",
                                quoteText(name), count));
  }
  for (const PcdField& field : header.fields) {
    const bool is_wide = field.type == StoredType::kInt64 || field.type == StoredType::kUint64;
    if (!is_wide || field.isPadding()) continue;
    notes.push_back(
        fmt::format("integers of 64 bits become float64, exact to 2^53: '{}'", field.name));
  }
  return notes;
}

class PcdBinaryReader final : public FixedRecordReader {
 public:
  PcdBinaryReader(ByteInput input, PcdHeader header)
      : FixedRecordReader(std::move(input)), header_(std::move(header)) {}

  Status open(std::span<const ChannelRename> renames) {
    element_.name = "vertex";
    element_.count = header_.count;
    SURFEIT_ASSIGN_OR_RETURN(layout_, PcdLayout::create(header_, renames, path(), element_));
    refuseBytesBehind();
    return setRecords(header_.data_offset, layout_.recordBytes());
  }

  std::string formatName() const override { return nameOfFormat(header_); }
  std::vector<std::string> notes() const override {
    std::vector<std::string> notes = notesOf(header_);
    if (!note_.empty()) notes.push_back(note_);
    if (trailingBytes() > 0) {
      const std::uint64_t points = trailingBytes() / layout_.recordBytes();
      notes.push_back(fmt::format(
          "{} bytes after the last point are not read{}", trailingBytes(),
          points == 0 ? ""
                      : fmt::format(": they may be {} points that the header does not count, which "
                                    "right numbers in WIDTH and POINTS add",
                                    points)));
    }
    return notes;
  }
  const PcdLayout& layout() const { return layout_; }
  void addNote(std::string note) { note_ = std::move(note); }

 private:
  void decodeRecords(const std::byte* records, std::size_t count, std::byte* rows) const override {
    layout_.decode(records, count, rows);
  }
  bool areRecordsRows() const override { return layout_.areRecordsRows(); }

  PcdHeader header_;
  PcdLayout layout_;
  std::string note_;
};

class PcdTextReader final : public CountedRowReader {
 public:
  PcdTextReader(ByteInput input, PcdHeader header)
      : source_(std::move(input)), header_(std::move(header)) {}

  Status open(std::span<const ChannelRename> renames) {
    path_ = source_.input().path();
    format_name_ = nameOfFormat(header_);
    notes_ = notesOf(header_);
    element_.name = "vertex";
    element_.count = header_.count;
    source_.jumpTo(header_.data_offset, header_.data_line);
    SURFEIT_ASSIGN_OR_RETURN(layout_, PcdLayout::create(header_, renames, path(), element_));
    parser_.emplace(layout_.columns(), layout_.recordBytes(), TextExtras{});
    SURFEIT_RETURN_IF_ERROR(checkCount());
    return moveTo(0);
  }

  const PcdLayout& layout() const { return layout_; }
  void addNote(std::string note) {
    if (!note.empty()) notes_.push_back(std::move(note));
  }

 private:
  // A value takes a digit and a blank or line end, which the last line may lack.
  Status checkCount() const {
    if (!source_.input().size()) return {};
    const std::uint64_t size = *source_.input().size();
    const std::uint64_t data_bytes = size - std::min(size, header_.data_offset);
    const std::uint64_t rows_that_fit = (data_bytes + 1) / (2 * layout_.columns().size());
    if (header_.count <= rows_that_fit) return {};
    return Status::corruption(
        fmt::format("{}: file ends early: {} bytes at {} hold at most {} points, expected {}",
                    path_, data_bytes, header_.data_offset, rows_that_fit, header_.count));
  }

  Status decodeRows(std::size_t count, std::byte* rows) override {
    records_.resize(std::min(count, kTextBlockRows) * layout_.recordBytes());
    for (std::size_t done = 0; done < count;) {
      const std::size_t block = std::min(kTextBlockRows, count - done);
      SURFEIT_RETURN_IF_ERROR(parser_->readRows(source_, row() + done, block, records_.data()));
      layout_.packColors(records_.data(), block);
      layout_.decode(records_.data(), block, rows + done * element_.row_bytes);
      done += block;
    }
    return {};
  }

  Status moveTo(std::uint64_t) override {
    source_.jumpTo(header_.data_offset, header_.data_line);
    return {};
  }

  Status checkEnd() override { return parser_->checkEnd(source_); }

  LineSource source_;
  PcdHeader header_;
  PcdLayout layout_;
  std::optional<TextRowParser> parser_;
  std::vector<std::byte> records_;
};

// Points that are compressed as one stream, field by field: they are decoded to a temporary file,
// where the values of each field stand together.
class PcdCompressedReader final : public CountedRowReader {
 public:
  PcdCompressedReader(ByteInput input, PcdHeader header)
      : input_(std::move(input)), header_(std::move(header)) {}

  Status open(std::span<const ChannelRename> renames) {
    path_ = input_.path();
    format_name_ = nameOfFormat(header_);
    notes_ = notesOf(header_);
    element_.name = "vertex";
    element_.count = header_.count;
    SURFEIT_ASSIGN_OR_RETURN(layout_, PcdLayout::create(header_, renames, path(), element_));
    return unpack();
  }

  bool isSeekable() const override { return true; }

  const PcdLayout& layout() const { return layout_; }
  void addNote(std::string note) {
    if (!note.empty()) notes_.push_back(std::move(note));
  }

 private:
  // [ bytes that follow : u32 ] [ bytes that come out : u32 ] LZF
  Status unpack() {
    std::uint32_t sizes[2];
    SURFEIT_RETURN_IF_ERROR(
        input_.readAt(header_.data_offset, std::as_writable_bytes(std::span(sizes))));
    const std::uint64_t begin = header_.data_offset + sizeof sizes;
    if (header_.count != sizes[1] / layout_.recordBytes() ||
        sizes[1] % layout_.recordBytes() != 0) {
      return damagedAt(header_.data_offset,
                       fmt::format("{} bytes of points, expected {} points of {} bytes", sizes[1],
                                   header_.count, layout_.recordBytes()));
    }
    if (input_.size() && *input_.size() - std::min(*input_.size(), begin) < sizes[0]) {
      return Status::corruption(fmt::format("{}: file ends early: {} bytes, expected {} at {}",
                                            path_, *input_.size(), sizes[0], begin));
    }
    if (input_.size()) addNote(noteOfBytesBehind(*input_.size() - begin - sizes[0], "point"));
    SURFEIT_RETURN_IF_ERROR(checkNothingBehind(input_, begin + sizes[0], "point"));
    SURFEIT_ASSIGN_OR_RETURN(TemporaryFile spool, TemporaryFile::create(spoolDirectory()));
    spool_.emplace(std::move(spool));
    return decodeLzf(input_, begin, sizes[0], sizes[1], *spool_);
  }

  Status decodeRows(std::size_t count, std::byte* rows) override {
    const std::size_t record_bytes = layout_.recordBytes();
    const std::size_t block_rows = std::max<std::size_t>(1, kBlockBytes / record_bytes);
    for (std::size_t done = 0; done < count;) {
      const std::size_t block = std::min(count - done, block_rows);
      records_.resize(block * record_bytes);
      std::size_t place = 0;  // of a field in a record, and of its values for one point
      for (const PcdField& field : header_.fields) {
        const std::size_t bytes = field.count * storedBytes(field.type);
        SURFEIT_ASSIGN_OR_RETURN(const Bytes values,
                                 spool_->readView(header_.count * place + (row() + done) * bytes,
                                                  block * bytes, values_));
        for (std::size_t i = 0; i < block; ++i) {
          std::memcpy(&records_[i * record_bytes + place], &values[i * bytes], bytes);
        }
        place += bytes;
      }
      layout_.decode(records_.data(), block, rows + done * element_.row_bytes);
      done += block;
    }
    return {};
  }

  Status checkEnd() override { return input_.checkUnchanged(); }

  static constexpr std::size_t kBlockBytes = 256 << 10;

  ByteInput input_;
  PcdHeader header_;
  PcdLayout layout_;
  std::optional<TemporaryFile> spool_;
  std::vector<std::byte> records_;
  AlignedBuffer values_;
};

// How many colors are nan, of points from all over the file, or of all where it cannot be sought
// in; empty where there are none.
template <typename Reader>
Result<std::string> noteOfLostColors(Reader& reader) {
  constexpr std::uint64_t kPlaces = 64, kPointsOfPlace = 1024;
  if (!reader.layout().hasPackedReals()) return std::string();
  const std::uint64_t count = reader.element().count;
  const bool takes_places = reader.isSeekable() && count > kPlaces * kPointsOfPlace;
  const std::size_t most = std::max<std::size_t>(
      1, kPassBytes / std::max<std::size_t>(1, reader.layout().recordBytes()));
  const std::size_t at_once = takes_places ? std::min<std::size_t>(most, kPointsOfPlace) : most;
  std::uint64_t seen = 0;
  AlignedBuffer buffer;
  for (std::uint64_t place = 0; !takes_places || place < kPlaces; ++place) {
    if (takes_places && !reader.seekRow((count - kPointsOfPlace) / (kPlaces - 1) * place).ok())
      break;
    // Whoever reads the points is told of what is wrong with them
    const Result<Bytes> rows = reader.readRows(at_once, buffer);
    if (!rows.ok() || rows->empty()) break;
    seen += rows->size() / reader.element().row_bytes;
  }
  const std::uint64_t lost = reader.layout().lostColors();
  const LostDigits digits = reader.layout().digits();
  SURFEIT_RETURN_IF_ERROR(reader.rewind());
  if (digits.areLost()) {
    return digits.describe("the color", "write PCD with DATA binary, or TYPE U");
  }
  if (lost == 0) return std::string();
  return fmt::format(
      "the color is nan in {} of {} points looked at, which is none and becomes black: texts lose "
      "the bits of colors with alpha 255 and red above 127; write PCD with TYPE U",
      lost, seen);
}

template <typename Reader>
Result<std::unique_ptr<RowReader>> openAs(ByteInput input, PcdHeader header,
                                          std::span<const ChannelRename> renames) {
  auto reader = std::make_unique<Reader>(std::move(input), std::move(header));
  SURFEIT_RETURN_IF_ERROR(reader->open(renames));
  SURFEIT_ASSIGN_OR_RETURN(std::string note, noteOfLostColors(*reader));
  reader->addNote(std::move(note));
  return std::unique_ptr<RowReader>(std::move(reader));
}

}  // namespace

Result<std::unique_ptr<RowReader>> openPcd(const std::string& path,
                                           const RowReaderOptions& options) {
  SURFEIT_ASSIGN_OR_RETURN(ByteInput input, ByteInput::open(path, options.access));
  SURFEIT_ASSIGN_OR_RETURN(PcdHeader header, readPcdHeader(input));
  if (header.is_text) {
    return openAs<PcdTextReader>(std::move(input), std::move(header), options.channels);
  }
  if (header.is_compressed) {
    return openAs<PcdCompressedReader>(std::move(input), std::move(header), options.channels);
  }
  return openAs<PcdBinaryReader>(std::move(input), std::move(header), options.channels);
}

}  // namespace surfeit
