#include "io/formats/pcd_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <optional>
#include <utility>
#include <vector>

#include "io/formats/counted_row_reader.h"
#include "io/formats/fixed_record_reader.h"
#include "io/formats/property_renames.h"
#include "io/formats/text_rows.h"

namespace surfeit {
namespace {

constexpr std::size_t kTextBlockRows = 4096;

// How records become rows.
class PcdLayout {
 public:
  // Of points as `header` has them. In a text, 64-bit integers stand in records as doubles.
  static Result<PcdLayout> create(const PcdHeader& header, std::span<const ChannelRename> renames,
                                  const std::string& path, PlyElement& element) {
    PcdLayout layout;
    for (const PcdField& field : header.fields) layout.addField(field, header.is_text, renames);

    // Names after renames, then places in a row
    const std::vector<std::string> names = renamedProperties(layout.all_, renames);
    for (std::size_t i = 0; i < names.size(); ++i) {
      if (names[i].empty()) continue;
      if (element.find(names[i]) != nullptr) {
        return Status::corruption(
            fmt::format("{}: field {} would be a second {}, expected another name", path,
                        layout.all_.properties[i].name, names[i]));
      }
      layout.addMove(layout.values_[i], element.row_bytes);
      element.properties.push_back(layout.all_.properties[i]);
      element.properties.back().name = names[i];
      element.properties.back().offset = element.row_bytes;
      element.row_bytes += plyTypeBytes(element.properties.back().type);
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

  void decode(const std::byte* records, std::size_t count, std::byte* rows) const {
    for (const Move& move : moves_) {
      const StoredPlace place{move.type, false, move.components, record_bytes_};
      decodeStored(place, records + move.from, count, rows + move.to, row_bytes_);
    }
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

  void addField(const PcdField& field, bool is_text, std::span<const ChannelRename> renames) {
    const PlyType row_type = plyTypeOf(field.type);
    const StoredType type = is_text ? surfeit::storedTypeOf(row_type) : field.type;
    const std::size_t bytes = field.count * storedBytes(type);
    if (is_text) {
      for (std::size_t i = 0; i < field.count; ++i) {
        columns_.push_back(
            {field.name, row_type, record_bytes_ + i * storedBytes(type), !field.isPadding()});
      }
    }
    if (field.isPackedColor()) {
      // Little-endian: blue is the first byte
      addProperty("red", {StoredType::kUint8, record_bytes_ + 2});
      addProperty("green", {StoredType::kUint8, record_bytes_ + 1});
      addProperty("blue", {StoredType::kUint8, record_bytes_});
      if (field.name == "rgba") addProperty("alpha", {StoredType::kUint8, record_bytes_ + 3});
    } else if (!field.isPadding()) {
      for (std::size_t i = 0; i < field.count; ++i) {
        const std::string name =
            field.count == 1 ? field.name : fmt::format("{}_{}", field.name, i);
        addProperty(propertyName(name, renames), {type, record_bytes_ + i * storedBytes(type)});
      }
    }
    record_bytes_ += bytes;
  }

  static std::string propertyName(const std::string& name, std::span<const ChannelRename> renames) {
    const bool is_renamed = std::any_of(renames.begin(), renames.end(),
                                        [&](const auto& rename) { return rename.from == name; });
    if (!is_renamed && name.starts_with("normal_") && name.size() == 8 && name.back() >= 'x' &&
        name.back() <= 'z') {
      return fmt::format("n{}", name.back());
    }
    // The letters of the file, made fit for a property
    std::string fit = name.substr(0, 56);
    std::replace_if(
        fit.begin(), fit.end(), [](char c) { return !(c > ' ' && c < '\x7f'); }, '_');
    return fit;
  }

  void addProperty(const std::string& name, Value value) {
    PlyProperty property;
    property.name = names_.add(name);
    property.type = plyTypeOf(value.type);
    all_.properties.push_back(std::move(property));
    values_.push_back(value);
  }

  void addMove(const Value& value, std::size_t to) {
    if (plyTypeOf(value.type) == PlyType::kFloat64 && value.type != StoredType::kFloat64) {
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

  PlyElement all_;  // properties as the file has them, and where they stand in a record
  DistinctNames names_;
  std::vector<Value> values_;
  std::vector<TextColumn> columns_;
  std::size_t record_bytes_ = 0, row_bytes_ = 0;
  std::vector<Move> moves_;
  bool moves_are_plain_ = true;
};

std::string nameOfFormat(const PcdHeader& header) {
  return fmt::format("PCD {} {}", header.version, header.is_text ? "ascii" : "binary");
}

std::vector<std::string> notesOf(const PcdHeader& header) {
  if (!header.has_view_point) return {};
  return {"the view point is not kept: positions are as the file has them"};
}

class PcdBinaryReader final : public FixedRecordReader {
 public:
  PcdBinaryReader(ByteInput input, PcdHeader header)
      : FixedRecordReader(std::move(input)), header_(std::move(header)) {}

  Status open(std::span<const ChannelRename> renames) {
    element_.name = "vertex";
    element_.count = header_.count;
    SURFEIT_ASSIGN_OR_RETURN(layout_, PcdLayout::create(header_, renames, path(), element_));
    return setRecords(header_.data_offset, layout_.recordBytes());
  }

  std::string formatName() const override { return nameOfFormat(header_); }
  std::vector<std::string> notes() const override {
    std::vector<std::string> notes = notesOf(header_);
    if (trailingBytes() > 0) {
      notes.push_back(fmt::format("{} bytes after the last point are not read", trailingBytes()));
    }
    return notes;
  }

 private:
  void decodeRecords(const std::byte* records, std::size_t count, std::byte* rows) const override {
    layout_.decode(records, count, rows);
  }
  bool areRecordsRows() const override { return layout_.areRecordsRows(); }

  PcdHeader header_;
  PcdLayout layout_;
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
    SURFEIT_ASSIGN_OR_RETURN(layout_, PcdLayout::create(header_, renames, path(), element_));
    parser_.emplace(layout_.columns(), layout_.recordBytes(), TextExtras{});
    SURFEIT_RETURN_IF_ERROR(checkCount());
    return moveTo(0);
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

template <typename Reader>
Result<std::unique_ptr<RowReader>> openAs(ByteInput input, PcdHeader header,
                                          std::span<const ChannelRename> renames) {
  auto reader = std::make_unique<Reader>(std::move(input), std::move(header));
  SURFEIT_RETURN_IF_ERROR(reader->open(renames));
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
  return openAs<PcdBinaryReader>(std::move(input), std::move(header), options.channels);
}

}  // namespace surfeit
