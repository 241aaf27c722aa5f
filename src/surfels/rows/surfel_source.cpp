#include "surfels/rows/surfel_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "cloud/rows/channels.h"
#include "cloud/rows/comment_notes.h"
#include "cloud/rows/property_aliases.h"
#include "cloud/rows/row_reader.h"
#include "cloud/rows/surfel_names.h"
#include "core/crs_comment.h"
#include "core/up_comment.h"
#include "surfels/rows/dark_colors.h"
#include "surfels/rows/no_data.h"
#include "surfels/rows/unused_alpha.h"

namespace surfeit {
namespace {

constexpr std::size_t kRowBufferBytes = 256 << 10;

class RowSurfelSource final : public SurfelSource {
 public:
  RowSurfelSource(std::unique_ptr<RowReader> reader, SurfelMapping mapping, bool strict)
      : reader_(std::move(reader)), mapping_(std::move(mapping)), is_strict_(strict) {}

  const std::string& path() const override { return reader_->path(); }
  std::uint64_t recordCount() const override { return reader_->element().count; }
  CloudChannels channels() const override { return mapping_.channels(); }
  void setOrigin(const glm::dvec3& origin) override { mapping_.setOrigin(origin); }
  UpAxis up() const override { return statedUpAxis(reader_->comments()).value_or(kDefaultUpAxis); }
  std::vector<std::string> comments() const override { return reader_->comments(); }
  bool hasFloatPositions() const override { return mapping_.hasFloatPositions(); }
  bool hasCoverage() const override { return mapping_.hasCoverage(); }
  const SurfelDefects& defects() const override { return defects_; }

  std::vector<std::string> notes() const override {
    std::vector<std::string> notes = reader_->notes();
    const CloudChannels& has = mapping_.channels();
    const LackingChannels lacking = {.color = !has.radiosity && !has.albedo,
                                     .normal = !has.normal,
                                     .size = !has.radius && !has.area,
                                     .opacity = !has.opacity && !hasCoverage()};
    for (std::string& note : notesOfLookalikes(reader_->element(), lacking)) {
      notes.push_back(std::move(note));
    }
    noteOpacity(notes);
    noteCoverage(notes);
    if (std::string note = noteOfDegrees(statedCrs(comments())); !note.empty()) {
      notes.push_back(std::move(note));
    }
    if (std::string note = noteOfGeocentric(statedCrs(comments())); !note.empty()) {
      notes.push_back(std::move(note));
    }
    for (std::string& note : notesOfComments(comments())) notes.push_back(std::move(note));
    if (!row_notes_) row_notes_ = notesOfRows();
    notes.insert(notes.end(), row_notes_->begin(), row_notes_->end());
    return notes;
  }

  std::string albedoAdvice() const override {
    const RowLayout& element = reader_->element();
    if (element.find(kAlbedoNames[0]) != nullptr) {
      const std::string drops = dropsOf(element, "albedo");
      return drops.empty() ? "" : fmt::format("--channels {} leaves the albedo out", drops);
    }
    const std::string renaming = renamingOf(element, "color", "radiosity");
    if (element.find(kColorNames[0]) == nullptr || renaming.empty()) return {};
    return fmt::format("where colors are light, --channels {} reads them as such alone", renaming);
  }

  SizeNames sizeNames() const override {
    const RowLayout& element = reader_->element();
    SizeNames names;
    names.has_area = element.find("area") != nullptr;
    for (const char* name : {kRadiusNames[0], kRadiusNames[1], kRadiusNames[2], "area"}) {
      if (element.find(name) == nullptr) continue;
      if (names.property.empty()) names.property = name;
      const std::string drops = dropsOf(element, name);
      names.drops += (names.drops.empty() || drops.empty() ? "" : ",") + drops;
    }
    return names;
  }

  std::size_t rowBytes() const override { return mapping_.rowBytes(); }
  bool isSeekable() const override { return reader_->isSeekable(); }

  Result<std::size_t> read(std::span<Surfel> surfels) override {
    std::size_t size = 0;
    while (size < surfels.size()) {
      // Fetch rows
      if (rows_.empty()) {
        const std::size_t max_rows = std::max<std::size_t>(1, kRowBufferBytes / rowBytes());
        SURFEIT_ASSIGN_OR_RETURN(rows_, readRows(max_rows, buffer_));
        if (rows_.empty()) break;
      }

      // Decode as many as there is room for
      const std::size_t count = std::min(rows_.size() / rowBytes(), surfels.size() - size);
      const Bytes rows = rows_.first(count * rowBytes());
      const std::uint64_t first_record = record_;
      rows_ = rows_.subspan(rows.size());
      record_ += count;
      SURFEIT_ASSIGN_OR_RETURN(const std::size_t valid,
                               decodeRows(rows, first_record, surfels.subspan(size), defects_));
      size += valid;
    }
    return size;
  }

  Status rewind() override {
    rows_ = {};
    record_ = 0;
    defects_ = {};
    return reader_->rewind();
  }

  Result<Bytes> readRows(std::size_t max_rows, AlignedBuffer& buffer) override {
    is_untouched_ = false;
    return reader_->readRows(max_rows, buffer);
  }

  Result<std::size_t> decodeRows(Bytes rows, std::uint64_t first_record, std::span<Surfel> surfels,
                                 SurfelDefects& defects) const override {
    SurfelDefects found;
    const std::size_t size = mapping_.decodeRows(rows, first_record, surfels, found);
    if (is_strict_ && found.total() > 0) {
      const std::uint64_t record = found.firstRecord();
      const std::size_t row = static_cast<std::size_t>(record - first_record);
      return Status::corruption(
          fmt::format("{}: record {}: {}", path(), record,
                      mapping_.describeDefect(rows.data() + row * rowBytes())));
    }
    defects.add(found);
    return size;
  }

  Status seekRow(std::uint64_t record) override {
    is_untouched_ = false;
    return reader_->seekRow(record);
  }

 private:
  // Looks at rows, and so only before anyone else does. A failure will be the reader's, too.
  std::vector<std::string> notesOfRows() const {
    std::vector<std::string> notes;
    if (!is_untouched_) return notes;
    for (const Result<std::string>& note :
         {noteOfUnusedAlpha(*reader_, mapping_.channels().opacity), noteOfDarkColors(*reader_),
          noteOfNoData(*reader_)}) {
      if (note.ok() && !note->empty()) notes.push_back(*note);
    }
    return notes;
  }

  // What of an opacity is not used.
  void noteOpacity(std::vector<std::string>& notes) const {
    const RowLayout& element = reader_->element();
    const CloudChannels& has = mapping_.channels();
    const bool has_one = element.find("opacity") != nullptr;
    const bool has_tint = element.find(kOpacityNames[0]) != nullptr;
    const RowProperty* const coverage = element.find("coverage");
    const bool is_made = coverage != nullptr && coverage->is_made;  // of the same opacity
    if (!has.opacity && !is_made && (has_one || has_tint) && element.find("f_dc_0") == nullptr) {
      notes.push_back(
          fmt::format("opacity is not used beside coverage: --channels {} leaves that out",
                      dropsOf(element, "coverage")));
    }
    if (has.tint && has_one) {
      notes.push_back(fmt::format(
          "opacity is not used beside opacity_r opacity_g opacity_b: --channels {} leaves it out",
          dropsOf(element, "opacity")));
    }
  }

  // A coverage without effect.
  void noteCoverage(std::vector<std::string>& notes) const {
    if (mapping_.hasCoverage() || reader_->element().find("coverage") == nullptr) return;
    const CloudChannels& has = mapping_.channels();
    if (has.area) {
      notes.push_back(fmt::format(
          "coverage is not used beside area: convert --set \"area *= coverage\" multiplies both, "
          "--channels {} leaves it out",
          dropsOf(reader_->element(), "coverage")));
      return;
    }
    notes.push_back(fmt::format(
        "coverage is not used without a radius: --channels {0}=opacity takes it for how opaque "
        "surfels are, --channels {0}=- leaves it out",
        typedNames(reader_->element(), "coverage").front()));
  }

  std::unique_ptr<RowReader> reader_;
  SurfelMapping mapping_;
  bool is_strict_;
  bool is_untouched_ = true;  // no row was read
  mutable std::optional<std::vector<std::string>> row_notes_;

  // Of read(): rows in the buffer that are still to be decoded, the first of them record_
  SurfelDefects defects_;
  AlignedBuffer buffer_;
  Bytes rows_;
  std::uint64_t record_ = 0;
};

}  // namespace

Result<std::unique_ptr<SurfelSource>> makeSurfelSource(std::unique_ptr<RowReader> reader,
                                                       bool strict) {
  SURFEIT_ASSIGN_OR_RETURN(SurfelMapping mapping,
                           SurfelMapping::create(reader->element(), reader->path()));
  return std::unique_ptr<SurfelSource>(
      std::make_unique<RowSurfelSource>(std::move(reader), std::move(mapping), strict));
}

}  // namespace surfeit
