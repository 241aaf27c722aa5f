#include "cloud/ply/ply_rows.h"

#include <fmt/format.h>

#include <optional>
#include <utility>

#include "cloud/parts/property_renames.h"
#include "cloud/ply/packed_splat_reader.h"
#include "cloud/ply/ply_reader.h"
#include "cloud/ply/ply_writer.h"
#include "cloud/ply/splat_reader.h"
#include "cloud/rows/channels.h"
#include "cloud/rows/surfel_names.h"

namespace surfeit {
namespace {

// The element as rows have it: scalars alone, renamed, without those that are dropped. Their places
// in a row stay the same. kCorruption when a name is taken twice.
Result<RowLayout> rowElement(const RowLayout& original, std::span<const ChannelRename> renames,
                             const std::string& path) {
  for (const RowProperty& property : original.properties) {
    if (!property.is_list || !isSurfelProperty(property.name)) continue;
    return Status::corruption(
        fmt::format("{}: element {}: property {} is a list, expected a scalar", path, original.name,
                    property.name));
  }
  return renamedElement(original, renames, path);
}

// The element to read.
Result<std::size_t> findPart(const PlyHeader& header, const std::string& part,
                             const std::string& path) {
  if (part.empty()) return findSurfelElement(header, path);
  if (const std::optional<std::size_t> index = header.findElement(part)) return *index;
  std::string names;
  for (const RowLayout& element : header.elements) names += " " + element.name;
  return Status::corruption(
      fmt::format("{}: found no element {}, expected one of{}", path, quoteText(part), names));
}

class PlyRowReader final : public RowReader {
 public:
  PlyRowReader(PlyReader reader, std::size_t index, RowLayout element)
      : reader_(std::move(reader)),
        index_(index),
        element_(std::move(element)),
        is_seekable_(reader_.hasFixedRows()) {}

  const std::string& path() const override { return reader_.path(); }
  std::string formatName() const override { return "PLY"; }
  const RowLayout& element() const override { return element_; }
  std::vector<std::string> comments() const override { return reader_.header().comments; }

  std::vector<std::string> notes() const override {
    std::vector<std::string> notes;
    const std::vector<RowLayout>& elements = reader_.header().elements;
    for (const RowProperty& property : elements[index_].properties) {
      if (property.wide != WideInteger::kNone && !property.is_list) {
        notes.push_back(
            fmt::format("integers of 64 bits become float64, exact to 2^53: '{}'", property.name));
      }
      if (!property.is_list) continue;
      notes.push_back(fmt::format("list property {} is not kept", property.name));
    }
    const std::vector<std::string> missing = missingOfSplats(element_);
    if (!missing.empty()) {
      notes.push_back(fmt::format(
          "these are Gaussian splats without {}: read as points, with opacity and scales as they "
          "are; --channels {} leaves opacity out",
          fmt::join(missing, " "), dropsOf(element_, "opacity")));
    }
    for (std::size_t i = 0; i < elements.size(); ++i) {
      // An element without rows has nothing to keep
      if (i != index_ && elements[i].count > 0)
        notes.push_back(fmt::format("element {} is not kept", elements[i].name));
    }
    return notes;
  }

  Result<Bytes> readRows(std::size_t max_rows, AlignedBuffer& buffer) override {
    return reader_.readRowView(max_rows, buffer);
  }
  Status rewind() override { return reader_.seekElement(index_); }
  bool isSeekable() const override { return is_seekable_; }
  Status seekRow(std::uint64_t row) override { return reader_.seekRow(row); }

 private:
  PlyReader reader_;
  std::size_t index_;
  RowLayout element_;
  bool is_seekable_;
};

class PlyRowWriter final : public RowWriter {
 public:
  explicit PlyRowWriter(PlyWriter writer) : writer_(std::move(writer)) {}

  const RowLayout& element() const override { return writer_.element(); }
  Status writeRows(std::span<const std::byte> rows) override { return writer_.writeRows(rows); }
  Status finish() override { return writer_.finish(); }

 private:
  PlyWriter writer_;
};

}  // namespace

bool recognisesPly(std::string_view first_bytes) {
  if (!first_bytes.starts_with("ply")) return false;
  const std::size_t end = first_bytes.find_first_not_of(" \t", 3);
  return end != first_bytes.npos && (first_bytes[end] == '\n' || first_bytes[end] == '\r');
}

Result<std::unique_ptr<RowReader>> openPlyRows(const std::string& path,
                                               const RowReaderOptions& options) {
  SURFEIT_ASSIGN_OR_RETURN(PlyReader reader, PlyReader::open(path, options.access));
  if (options.part.empty() && arePackedSplats(reader.header())) {
    SURFEIT_ASSIGN_OR_RETURN(std::unique_ptr<RowReader> splats,
                             openPackedSplats(path, options.access));
    return readSplatsAsDisks(std::move(splats));
  }
  SURFEIT_ASSIGN_OR_RETURN(const std::size_t index, findPart(reader.header(), options.part, path));
  SURFEIT_ASSIGN_OR_RETURN(RowLayout element,
                           rowElement(reader.header().elements[index], options.channels, path));
  SURFEIT_RETURN_IF_ERROR(reader.seekElement(index));
  std::unique_ptr<RowReader> rows =
      std::make_unique<PlyRowReader>(std::move(reader), index, std::move(element));
  if (areSplats(rows->element())) return readSplatsAsDisks(std::move(rows));
  return rows;
}

Result<std::unique_ptr<RowWriter>> createPlyRows(const std::string& path,
                                                 const RowWriterOptions& options) {
  SURFEIT_ASSIGN_OR_RETURN(PlyWriter writer,
                           PlyWriter::create(path, options.ply_encoding, options.properties,
                                             options.comments, options.progress));
  return std::unique_ptr<RowWriter>(std::make_unique<PlyRowWriter>(std::move(writer)));
}

}  // namespace surfeit
