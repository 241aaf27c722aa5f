#include "cloud/scans/las_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <optional>
#include <utility>
#include <vector>

#include "cloud/parts/fixed_record_reader.h"
#include "cloud/parts/property_renames.h"
#include "core/up_comment.h"

namespace surfeit {
namespace {

constexpr std::string_view kWithheld = "withheld", kClassification = "classification";

// Which component of a normal other programs mean by the name of extra bytes; nothing for others.
std::optional<char> normalAxis(std::string_view name) {
  constexpr std::string_view kStem = "normal";
  std::string plain;
  for (const char c : name) {
    if (c == '_' || c == ' ') continue;
    plain += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  if (plain.size() != kStem.size() + 1 || !plain.starts_with(kStem)) return {};
  const char axis = plain.back();
  return axis == 'x' || axis == 'y' || axis == 'z' ? std::optional(axis) : std::nullopt;
}

class LasReader : public FixedRecordReader {
 public:
  static Result<std::unique_ptr<RowReader>> open(const std::string& path,
                                                 const RowReaderOptions& options) {
    SURFEIT_ASSIGN_OR_RETURN(ByteInput input, ByteInput::open(path, options.access));
    SURFEIT_ASSIGN_OR_RETURN(LasHeader header, readLasHeader(input));
    auto reader = std::unique_ptr<LasReader>(new LasReader(std::move(input), std::move(header)));
    SURFEIT_RETURN_IF_ERROR(reader->addFields(options.channels));
    SURFEIT_RETURN_IF_ERROR(
        reader->setRecords(reader->header_.data_offset, reader->header_.record_bytes));
    return std::unique_ptr<RowReader>(std::move(reader));
  }

  const LasHeader& header() const { return header_; }

  std::string formatName() const override {
    return fmt::format("LAS 1.{} point format {}", header_.minor, header_.point_format);
  }
  std::vector<std::string> comments() const override {
    std::vector<std::string> comments = header_.crs;
    stateUpAxis(UpAxis::kZ, comments);  // of elevations
    return comments;
  }
  std::vector<std::string> notes() const override { return notes_; }

  RowExclusions exclusions() const override {
    return {{{"withheld", std::string(kWithheld)},
             {"of noise (classes 7 and 18)", "classification == 7 or classification == 18"}},
            {withheld_, classification_}};
  }

 private:
  LasReader(ByteInput input, LasHeader header)
      : FixedRecordReader(std::move(input)), header_(std::move(header)), notes_(header_.notes) {
    element_.name = "vertex";
    element_.count = header_.count;
  }

  Status addFields(std::span<const ChannelRename> renames) {
    std::vector<std::string> notes;
    const std::vector<LasField> fields = header_.fields(&notes);
    notes_.insert(notes_.end(), notes.begin(), notes.end());
    for (const LasField& field : fields) SURFEIT_RETURN_IF_ERROR(addField(field, renames));
    SURFEIT_RETURN_IF_ERROR(checkChannelsLeft(element_, path()));
    // What decides whether a point is used is in every row, whether it is asked for or not
    for (const LasField& field : fields) {
      if (field.is_extra) continue;
      if (field.name == kWithheld) keepHidden(field, withheld_);
      if (field.name == kClassification) keepHidden(field, classification_);
    }
    return {};
  }

  Status addField(const LasField& field, std::span<const ChannelRename> renames) {
    const std::vector<std::string> names = lasPropertyNames(field, renames);
    for (std::size_t i = 0; i < names.size(); ++i) {
      RowProperty property;
      property.name = names[i];
      if (element_.find(names[i]) != nullptr) {
        if (!field.is_extra) {
          return Status::corruption(fmt::format(
              "{}: channel {}: found a second property {}, expected another name (--channels "
              "{}=NAME gives it one, {}=- drops it)",
              path(), quoteText(field.name), names[i], field.name, field.name));
        }
        property.name = distinctName(names[i]);
        notes_.push_back(fmt::format("extra bytes {} are called {}, since there is a {}",
                                     quoteText(field.name), property.name, names[i]));
      }
      if (property.name != field.name) property.typed = field.name;
      property.type = field.type;
      property.offset = element_.row_bytes;
      element_.row_bytes += valueTypeBytes(field.type);
      if (!field.is_extra && field.name == kWithheld) withheld_ = property;
      if (!field.is_extra && field.name == kClassification) classification_ = property;
      values_.emplace_back(field, i, property.offset, property.type);
      element_.properties.push_back(std::move(property));
    }
    return {};
  }

  std::string distinctName(const std::string& name) const {
    DistinctNames names;
    for (const RowProperty& property : element_.properties) names.add(property.name);
    return names.add(name);
  }

  // Gives the value a place in rows, unless it has one, and the name by which exclusions() call it.
  void keepHidden(const LasField& field, RowProperty& property) {
    if (property.name.empty()) {
      property.type = field.type;
      property.offset = element_.row_bytes++;
      values_.emplace_back(field, 0, property.offset, property.type);
    }
    property.name = field.name;
  }

  void decodeRecords(const std::byte* records, std::size_t count, std::byte* rows) const override {
    // A value at a time, of so many points that they stay in the first-level cache
    constexpr std::size_t kBlock = 256;
    for (std::size_t begin = 0; begin < count; begin += kBlock) {
      for (const LasValue& value : values_) {
        decodeLas(value, records + begin * header_.record_bytes, header_.record_bytes,
                  std::min(kBlock, count - begin), rows + begin * element_.row_bytes,
                  element_.row_bytes);
      }
    }
  }

  LasHeader header_;
  std::vector<std::string> notes_;
  std::vector<LasValue> values_;
  RowProperty withheld_, classification_;  // with their places in a row
};

}  // namespace

bool recognisesLas(std::string_view first_bytes) { return first_bytes.starts_with(kLasMagic); }

Result<std::unique_ptr<RowReader>> openLas(const std::string& path,
                                           const RowReaderOptions& options) {
  return LasReader::open(path, options);
}

const LasHeader* lasHeaderOf(const RowReader* reader) {
  const auto* las = dynamic_cast<const LasReader*>(reader);
  return las != nullptr ? &las->header() : nullptr;
}

std::vector<std::string> lasPropertyNames(const LasField& field,
                                          std::span<const ChannelRename> renames) {
  const bool is_renamed = std::any_of(renames.begin(), renames.end(), [&](const auto& rename) {
    return rename.from == field.name;
  });
  const std::optional<char> axis = field.is_extra && field.components == 1 && !is_renamed
                                       ? normalAxis(field.name)
                                       : std::nullopt;
  if (axis) return {std::string("n") + *axis};
  // Bytes without a meaning are no vector, however many
  if (field.stored == LasType::kBytes && (field.components > 1 || field.name == kLasExtraBytes)) {
    std::vector<std::string> names;
    for (const std::string& name : propertyNames(field.name, 1, field.kind, renames)) {
      for (std::size_t i = 0; i < field.components; ++i) {
        names.push_back(fmt::format("{}_{}", name, i));
      }
    }
    return names;
  }
  return propertyNames(field.name, field.components, field.kind, renames);
}

}  // namespace surfeit
